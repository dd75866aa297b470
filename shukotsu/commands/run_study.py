"""Command line: run a study with Snakemake, and print its outcome."""

from __future__ import annotations

import argparse
import ctypes
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
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
"""Environment variables of the user that would change what a run does; Snakemake does not get them."""

GRACE_S, CLUSTER_GRACE_S = 1.2, 5.0
"""Time for jobs to end by themselves after a signal; longer if Snakemake may have to cancel cluster jobs."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu run",
        "Run a study with Snakemake, whose command is printed; only what is out of date is made again. "
        "Results go to results/<study>/ in this folder.",
        "shukotsu run study.yaml --cores 8 -- --keep-going",
    )
    add_study(parser)
    parser.add_argument("--cores", default="all", metavar="N", help="jobs at once (default: all)")
    parser.add_argument("--dry-run", action="store_true", help="list what would be run, and run nothing")
    parser.add_argument("--verbose", action="store_true", help="show Snakemake's own messages")
    parser.usage = (
        "shukotsu run [-h] [--cores N] [--dry-run] [--verbose] [STUDY] [-- OPTION_OF_SNAKEMAKE ...]"
    )
    return parser


def run_study(arguments: argparse.Namespace) -> int:
    """Read the study, run it and print the first sentences of its report; return Snakemake's exit code."""
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
    plans = [files.results.plan(*who) for who in files.study.sessions]
    snakemake_files = [one_run.FOLDER / name / "file" for name in ("log", "metadata", "incomplete")]
    one_run.refuse_unwritable([*snakemake_files, files.results.report, *plans])
    lock = None if arguments.dry_run or arguments.more else one_run.hold(files.results.folder)
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--configfile", str(arguments.study)]
    if not arguments.verbose:  # before --cores, since --quiet would take the words after it as its values
        command += ["--quiet", "rules" if arguments.dry_run else "reason"]
    command += ["--cores", arguments.cores, *(["--dry-run"] if arguments.dry_run else []), *arguments.more]
    print(f"$ {shlex.join(command)}", file=sys.stderr, flush=True)
    os.environ[one_run.SHOWN] = one_run.EVERYTHING if arguments.verbose else one_run.PROGRESS
    status = _run(command, lock, CLUSTER_GRACE_S if arguments.more else GRACE_S)
    report = files.results.folder / "report.html"
    if status:
        return status if status > 0 else 128 - status
    if not arguments.dry_run and not arguments.more and report.is_file():
        from shukotsu.report.judged_models import outcome_text
        from shukotsu.report.study_results import read_results

        print(outcome_text(read_results(files.study, files.results.folder)))
        print(f"report: {report}")
    return 0


def _run(command: list[str], lock: TextIO | None, grace_s: float = GRACE_S) -> int:
    """Run a command to its end, even if its output is no longer read; return its exit code.

    The command runs in a process group of its own, with all processes that it starts. If a signal asks this
    process to end, the group is ended by SIGTERM, after grace_s by SIGKILL; then `command_line.Ended` is
    raised.
    """

    def begin() -> None:
        """Ask the system to kill this process when its parent ends for whatever reason."""
        command_line.block_ending(False)
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG

    def pause(*_: object) -> None:
        os.killpg(process.pid, signal.SIGSTOP)
        os.kill(os.getpid(), signal.SIGSTOP)  # until the shell resumes this process
        os.killpg(process.pid, signal.SIGCONT)

    printed = None if sys.stdout.isatty() else subprocess.PIPE
    handed = {} if lock is None else {one_run.HANDED: lock.fileno()}
    command_line.block_ending()  # until `process` is assigned, which a signal's handler needs
    process = subprocess.Popen(
        command,
        stdout=printed,
        text=True,
        errors="backslashreplace",
        env=_environment() | {name: str(number) for name, number in handed.items()},
        pass_fds=handed.values(),
        preexec_fn=begin,
        start_new_session=True,
    )
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # `&` in scripts ignores it
        signal.signal(signal.SIGTSTP, pause)
        command_line.block_ending(False)
        try:
            for line in process.stdout or ():
                print(line, end="", flush=True)
        except OSError:
            process.communicate()
            raise
        return process.wait()
    except (KeyboardInterrupt, command_line.Ended) as asked:
        command_line.block_ending()
        _end_group(process, grace_s)
        number = getattr(asked, "number", signal.SIGINT)
        raise command_line.Ended(number, "the same command goes on from there") from None
    finally:
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)


def _end_group(process: subprocess.Popen[str], grace_s: float) -> None:
    """End all processes of a process's group: by SIGTERM, after grace_s by SIGKILL."""
    until_s = time.monotonic() + grace_s
    with suppress(ProcessLookupError):  # all processes of the group have ended
        os.killpg(process.pid, signal.SIGTERM)
        while time.monotonic() < until_s:
            time.sleep(0.02)
            process.poll()
            os.killpg(process.pid, 0)
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _environment() -> dict[str, str]:
    """Return the environment for Snakemake, with caches in this folder if the user's cannot be written."""
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

    return command_line.script(with_more, run_study)(argv[:end])
