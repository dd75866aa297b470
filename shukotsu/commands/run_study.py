"""Command line: run a study by Snakemake, and say what came of it."""

from __future__ import annotations

import argparse
import ctypes
import os
import shlex
import signal
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO

from shukotsu import command_line
from shukotsu.commands import add_study, read_files
from shukotsu.errors import InputError
from shukotsu.resources import ROOT
from shukotsu.workflow import one_run

SNAKEFILE = ROOT / "Snakefile"
UNWANTED = ("PYTHONPATH", "SNAKEMAKE_PROFILE")
"""Variables of the person's environment that would have a run do something else."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu run",
        "Run a study by Snakemake, whose command is printed; what is up to date is not made again. Results "
        "go to results/<study>/ in this folder.",
        "shukotsu run study.yaml --cores 8 -- --keep-going",
    )
    add_study(parser)
    parser.add_argument("--cores", default="all", metavar="N", help="jobs at once (default: all)")
    parser.add_argument("--dry-run", action="store_true", help="say what would be run, and run nothing")
    parser.usage = "shukotsu run [-h] [--cores N] [--dry-run] [STUDY] [-- OPTION_OF_SNAKEMAKE ...]"
    return parser


def run_study(arguments: argparse.Namespace) -> int:
    """Read the study, run it, print its report's first sentences; return Snakemake's exit code."""
    if not hasattr(os, "fork"):
        raise InputError(
            "a study runs on Linux or macOS (on Windows: in WSL); copy this folder there, with recordings, "
            "and run it there"
        )
    files = read_files(arguments.study)
    if find_spec("snakemake") is None:
        raise ModuleNotFoundError("No module named 'snakemake'", name="snakemake")
    if arguments.cores != "all" and not (arguments.cores.isdecimal() and int(arguments.cores)):
        raise InputError(f"--cores: is {arguments.cores!r}; expected a number of jobs, or all")
    one_run.refuse_unwritable([one_run.FOLDER / "log"])
    lock = None if arguments.dry_run or arguments.more else one_run.hold(files.results.folder)
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--configfile", str(arguments.study)]
    command += ["--quiet", "rules"]  # takes any number of words, so it may not stand before the user's own
    command += ["--cores", arguments.cores, *(["--dry-run"] if arguments.dry_run else []), *arguments.more]
    print(f"$ {shlex.join(command)}", file=sys.stderr, flush=True)
    status = _run(command, lock)
    report = files.results.folder / "report.html"
    if status:
        return status if status > 0 else 128 - status
    if not arguments.dry_run and not arguments.more and report.is_file():
        from shukotsu.report.judged_models import outcome_text
        from shukotsu.report.study_results import read_results

        print(outcome_text(read_results(files.study, files.results.folder)))
        print(f"report: {report}")
    return 0


def _run(command: list[str], lock: TextIO | None) -> int:
    """Run a command to its end, whatever signal comes and whoever stops reading; return its exit code."""

    def end_with_parent() -> None:
        """Have the system end this process, and its jobs, as soon as its parent has ended, however."""
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG

    interrupted: list[int] = []
    printed = None if sys.stdout.isatty() else subprocess.PIPE
    handed = {} if lock is None else {one_run.HANDED: lock.fileno()}
    with subprocess.Popen(
        command,
        stdout=printed,
        text=True,
        errors="backslashreplace",
        env=_environment() | {name: str(number) for name, number in handed.items()},
        pass_fds=handed.values(),
        preexec_fn=end_with_parent if sys.platform == "linux" else None,
    ) as process:
        signal.signal(signal.SIGINT, lambda number, _: interrupted.append(number))  # reaches Snakemake too
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: process.terminate())
        try:
            for line in process.stdout or ():
                print(line, end="", flush=True)
        finally:
            for _ in process.stdout or ():
                pass
        status = process.wait()
    if interrupted:
        raise KeyboardInterrupt
    return status


def _environment() -> dict[str, str]:
    """Return the environment of Snakemake, with caches in the study's folder where the person's cannot be."""
    from platformdirs import user_cache_dir

    environment = {name: value for name, value in os.environ.items() if name not in UNWANTED}
    try:
        Path(user_cache_dir("snakemake", "snakemake")).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=user_cache_dir("snakemake", "snakemake")):
            return environment
    except OSError:
        caches = (one_run.FOLDER / "caches").absolute()
        return environment | {"XDG_CACHE_HOME": str(caches), "MPLCONFIGDIR": str(caches / "matplotlib")}


def main(argv: list[str]) -> int:
    """Run the study; return the exit code."""
    end = argv.index("--") if "--" in argv else len(argv)

    def with_more() -> argparse.ArgumentParser:
        parser = build_parser()
        parser.set_defaults(more=argv[end + 1 :])
        return parser

    return command_line.run(with_more, argv[:end], run_study)
