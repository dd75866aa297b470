"""Command line: show what studies need, what is missing, and what this machine can do."""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import NamedTuple

from shukotsu import command_line
from shukotsu.commands.run_study import SNAKEFILE

LEAST_DISK_GB = 1.0
"""Free disk space, GB, that a study like the demo needs."""


class Check(NamedTuple):
    """Result of one check. needed : whether studies need it. remedy : what to do if it is not there."""

    name: str
    state: str
    there: bool
    remedy: str
    needed: bool = False

    def line(self) -> str:
        """Return the result as a line of text."""
        mark = "ok" if self.there else "MISSING" if self.needed else "-"
        return f"{mark:8}{self.name:10}{self.state}{'' if self.there else f'; {self.remedy}'}"


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu doctor",
        "Show what is installed, what is missing and what for, and what this machine can do. Exit code: 2 if "
        "no study can run.",
        "shukotsu doctor",
    )
    what = "print only the Snakefile's path, to pass to Snakemake"
    parser.add_argument("--snakefile", action="store_true", help=what)
    return parser


def checks() -> Iterator[Check]:
    """Yield the results of all checks: packages and disk, which studies need, then serial ports."""
    state = f"Python {platform.python_version()} at {sys.executable}, on {platform.system()}"
    needed = (requires("shukotsu") or []) if _is_installed("shukotsu") else []
    names = [re.split(r"[^\w.-]", each)[0] for each in needed if "extra ==" not in each]  # not optional
    missing = [name for name in ("shukotsu", *names) if not _is_installed(name)]
    remedy = f"not installed: {', '.join(missing)}; install this program again"
    yield Check("packages", state, not missing, remedy, needed=True)
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    writable = os.access(Path.cwd(), os.W_OK)
    state = f"{free:.0f} GB free in {Path.cwd()}" + ("" if writable else ", where this user may not write")
    remedy = "results go into the folder that a study is run from; run it from another"
    yield Check("disk", state, writable and free >= LEAST_DISK_GB, remedy, needed=True)
    try:
        from serial.tools.list_ports import comports
    except ModuleNotFoundError:
        yield Check("tracker", "no serial port can be opened", False, "pyserial is not installed")
        return
    ports = [port.device for port in comports()]
    closed = [port for port in ports if not os.access(port, os.R_OK | os.W_OK)]
    state = f"serial ports: {', '.join(ports)}" if ports else "no serial port"
    state += f"; this user has no permission for {', '.join(closed)}" if closed else ""
    remedy = "join the ports' group (often dialout) and log in again" if closed else "only `record` needs one"
    yield Check("tracker", state, bool(ports) and not closed, remedy)


def _is_installed(package: str) -> bool:
    with suppress(PackageNotFoundError):
        return bool(version(package))
    return False


def doctor(options: argparse.Namespace) -> int:
    """Print the results of all checks; return 0 if a study can run, else 2."""
    if options.snakefile:
        print(SNAKEFILE)
        return 0
    results = list(checks())
    print("\n".join(check.line() for check in results))
    return 0 if all(check.there for check in results if check.needed) else command_line.EXIT_BAD_INPUT


main = command_line.script(build_parser, doctor)
