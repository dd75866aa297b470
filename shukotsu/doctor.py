"""Command line: what is installed, what is missing, what this machine can do."""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from stages import command_line

ROOT = Path(__file__).parents[1]
LOCK = ROOT / "requirements.lock"
INSTALL = f"run ./bootstrap {LOCK.name} in {ROOT}"
PINNED = re.compile(r"^([\w.-]+)==([^\s;\\]+)(?: *; *([^\\\n]+?))? *\\?$", re.MULTILINE)
"""A line of a lock file: name, version, and the systems that it is for."""
LEAST_MEMORY_GB, LEAST_DISK_GB = 2.0, 1.0
"""An hour of sixteen receivers at 240 Hz takes as much a job; a study of the demo's kind as much on disk."""
JAPANESE_FONTS = ("NotoSansCJK", "ipaexg", "ipag", "TakaoGothic", "BIZUDGothic", "VL-Gothic")
"""Beginnings of the files of open fonts that hold Japanese."""
FONT_FOLDERS = (
    "/usr/share/fonts",
    "/usr/local/share/fonts",
    "~/.local/share/fonts",
    "~/.fonts",
    "/Library/Fonts",
)


class Check(NamedTuple):
    """What was looked at. needed : whether studies cannot run without it; remedy : where it is not there."""

    name: str
    found: str
    there: bool
    remedy: str = ""
    needed: bool = False

    def line(self, width: int) -> str:
        """The check as a line of text."""
        state = "ok" if self.there else "MISSING" if self.needed else "-"
        remedy = f"; {self.remedy}" if self.remedy and not self.there else ""
        return f"{state:8}{self.name:{width}}  {self.found}{remedy}"


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    return command_line.parser(
        "shukotsu doctor",
        "Say what is installed, what is missing and what for, and what this machine can do. Ends with 2 "
        "where no study can run.",
        "shukotsu doctor",
        records_failure=False,
    )


def checks() -> Iterator[Check]:
    """Look at everything, what studies need first."""
    yield _python()
    yield _packages()
    yield _memory()
    yield _disk()
    yield _locks()
    yield _encoding()
    yield _ports()
    yield _japanese_font()
    yield _program("Slurm", "sbatch", "studies on a cluster (docs/cluster.md)")
    yield _program("Blender", "blender", "FBX files (docs/blender.md)")
    yield _program("git", "git", "the program's version in every table")


def _python() -> Check:
    found = f"{platform.python_version()} at {sys.executable}, on {platform.system()} {platform.machine()}"
    return Check("Python", found, sys.version_info >= (3, 11), "3.11 or newer is needed", needed=True)


def _packages() -> Check:
    """Compare what is installed with the versions that were tested together."""
    try:
        from packaging.markers import Marker
    except ModuleNotFoundError:
        return Check("packages", "none is installed", False, INSTALL, needed=True)
    pinned = PINNED.findall(LOCK.read_text("utf-8"))
    locked = {name: wanted for name, wanted, of in pinned if not of or Marker(of).evaluate()}
    lacking, other = [], []
    for name, wanted in locked.items():
        try:
            installed = version(name)
        except PackageNotFoundError:
            lacking.append(name)
            continue
        if installed != wanted:
            other.append(f"{name} {installed} (tested: {wanted})")
    found = f"{len(locked) - len(lacking)} of {len(locked)} are installed"
    found += f"; others than tested: {', '.join(other)}" if other else ""
    remedy = f"not installed: {', '.join(lacking[:9])}; {INSTALL}"
    return Check("packages", found, not lacking, remedy, needed=True)


def _memory() -> Check:
    from schemas.limits import available_memory_bytes

    free = available_memory_bytes()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if free is None:
        return Check("memory", f"this system does not say; {cores} cores", there=True)
    jobs = max(1, min(cores, int(free / 1e9 / LEAST_MEMORY_GB)))
    found = f"{free / 1e9:.1f} GB free, {cores} cores: enough for {jobs} jobs on hours of recording"
    remedy = f"an hour of recording takes up to {LEAST_MEMORY_GB:.0f} GB a job; shorter ones less"
    return Check("memory", found, free / 1e9 >= LEAST_MEMORY_GB, remedy)


def _disk() -> Check:
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    writable = os.access(Path.cwd(), os.W_OK)
    found = f"{free:.0f} GB free in {Path.cwd()}" + ("" if writable else ", where this user may not write")
    remedy = "results go into the folder that a study is run from; run it from another"
    return Check("disk", found, writable and free >= LEAST_DISK_GB, remedy, needed=True)


def _locks() -> Check:
    """Try whether the file system of this folder has locks, which keep two runs of a study apart."""
    import fcntl

    try:
        with tempfile.TemporaryFile(dir=Path.cwd()) as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return Check("locks", f"none here ({error.strerror})", False, "start no study twice at once")
    return Check("locks", "two runs of one study are kept apart", there=True)


def _encoding() -> Check:
    name = sys.getfilesystemencoding()
    return Check("encoding", name, name.lower() == "utf-8", "set LANG=C.UTF-8")


def _ports() -> Check:
    """List serial ports, and say which of them this user may not open."""
    try:
        from serial.tools.list_ports import comports
    except ModuleNotFoundError:
        return Check("tracker", "pyserial is not installed", there=False)
    ports = [port.device for port in comports()]
    closed = [port for port in ports if not os.access(port, os.R_OK | os.W_OK)]
    found = f"serial ports: {', '.join(ports)}" if ports else "no serial port"
    found += f"; not to be opened by this user: {', '.join(closed)}" if closed else ""
    remedy = "join the ports' group (often dialout) and log in anew" if closed else "only `record` needs one"
    return Check("tracker", found, bool(ports) and not closed, remedy)


def _japanese_font() -> Check:
    """Look for a font that figures in Japanese can use."""
    folders = [Path(folder).expanduser() for folder in FONT_FOLDERS]
    files = sorted(
        path.name for folder in folders for path in folder.rglob("*") if path.name.startswith(JAPANESE_FONTS)
    )
    remedy = "only reports with `language: ja` need one, e.g. Debian's fonts-noto-cjk"
    return Check("Japanese", f"font {files[0]}" if files else "no open font", bool(files), remedy)


def _program(name: str, program: str, purpose: str) -> Check:
    path = shutil.which(program)
    return Check(name, path or "not installed", path is not None, f"only for {purpose}")


def doctor(arguments: argparse.Namespace) -> None:
    """Print a line a check; note in the arguments whether what studies need is there."""
    found = list(checks())
    width = max(len(check.name) for check in found)
    for check in found:
        print(check.line(width))
    arguments.lacking = [check.name for check in found if check.needed and not check.there]


def main(argv: list[str]) -> int:
    """Look; give the exit code."""
    arguments = build_parser().parse_args(argv)
    status = command_line.run(arguments, doctor)
    return status or (command_line.EXIT_BAD_INPUT if arguments.lacking else 0)
