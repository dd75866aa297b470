"""Limit what a file may be before it is read: every limit that guards a reader stands here.

A study comes from anywhere, and a few bytes can ask for any amount of memory or time. A reader takes regular
files, refuses one that grows too far when it is unpacked, and then works within WORKING_MEMORY. What a file
may hold is wide of what recordings and configuration hold; docs/reliability.md lists it for users.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from shukotsu.errors import InputError

MEMORY_PER_BYTE, MEMORY_BYTES = 4, 300 * 10**6
"""A reader needs at most so many bytes a byte of its file, and so many besides."""

MOST_EXPANSION = 30
"""A table of so many times the bytes of its file, and MEMORY_BYTES besides, is no recording: those shrink to
a fifth, and what repeats one number for hours measures nothing."""

CONFIG_BYTES = 2 * 10**6
"""A study, layout, model or mapping."""
CONFIG_DEPTH = 40
"""Lists and mappings inside each other; what is shipped has 6."""
CONFIG_VALUES = 100_000
"""Values in a configuration, an alias counted as all that it stands for."""

LARGEST_WHOLE = 10**18
"""A whole number in a configuration: what a column of a table holds."""

LINE_LETTERS = 1_000_000
"""A line of a table: sixteen receivers' poses take 2000."""

SHEET_BYTES = 50 * 10**6
FILE_NAME_BYTES = 255
"""No file system takes a longer name."""
NAMES_BYTES = 200
"""Subject, task and trial together, as they stand in the name of a file, which says more."""

FARTHEST_MM = 1e8
"""A hundred kilometres: what is left of a motion laboratory where millimetres are given as metres."""

HAND_SIZES_MM = {"hand_length_mm": (50.0, 400.0), "hand_breadth_mm": (30.0, 200.0)}
"""Between these a hand's size is: what is beyond is in another unit."""

START_BYTES = 600 * 2**20
"""Address space that the libraries of a stage take before it has read a byte. With less, one of them ends the
process in words of its own, or in none."""
RATES_HZ = (0.001, 1e6)
"""Frames a second: times in s of any number of frames stay numbers."""

_KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
}


def check_regular(path: Path, expected: str) -> int:
    """Give the size of a file [bytes] before it is opened: a pipe lets one wait, a device never ends.

    Raises InputError where it is no regular file, FileNotFoundError and other OSErrors as the system does.
    """
    try:
        found = path.stat()
    except ValueError as error:  # a zero byte in the path
        raise InputError(f"{path}: no file can have this name; expected {expected}") from error
    if not stat.S_ISREG(found.st_mode):
        kind = _KINDS.get(stat.S_IFMT(found.st_mode), "no regular file")
        raise InputError(f"{path}: is {kind}; expected {expected}, a regular file")
    return found.st_size


def check_memory(path: Path, needed_bytes: float, expected: str) -> None:
    """Raise InputError where reading a file whole takes more memory than is free."""
    free = available_memory_bytes()
    if free is not None and needed_bytes > free:
        raise InputError(
            f"{path}: {expected} takes about {needed_bytes / 1e9:.1f} GB of memory to read and "
            f"{free / 1e9:.1f} GB are free; cut it into shorter recordings or use a larger machine"
        )


def read_whole(path: Path, expected: str, most_bytes: int | None = None) -> bytes:
    """Read a regular file at once; most_bytes : of what is never longer, else what free memory allows.

    Raises InputError where it is no regular file or too long, OSErrors as the system does.
    """
    size = check_regular(path, expected)
    if most_bytes is not None and size > most_bytes:
        raise InputError(f"{path}: has {size} bytes; expected {expected}, at most {most_bytes} bytes")
    check_memory(path, MEMORY_PER_BYTE * size, expected)
    return path.read_bytes()


def too_little_to_start() -> str:
    """Say that a limit of this process leaves less than a stage needs to start; empty where it does not."""
    free = _free_of_process()
    if free is None or free >= START_BYTES:
        return ""
    return (
        f"not enough memory: a limit (ulimit -v, or the batch job's) leaves {free >> 20} MB of address "
        f"space and a stage needs {START_BYTES >> 20} MB to start; raise it"
    )


def check_expansion(path: Path, unpacked_bytes: float, remedy: str) -> None:
    """Raise InputError where what a file says it unpacks to is far beyond its size."""
    size = path.stat().st_size
    if unpacked_bytes > MOST_EXPANSION * size + MEMORY_BYTES:
        raise InputError(
            f"{path}: would unpack from {size / 1e6:.1f} MB to {unpacked_bytes / 1e9:.1f} GB, which no "
            f"recording does; {remedy}"
        )


def available_memory_bytes() -> int | None:
    """Memory that this process may still take, the limits of a container or batch job among the bounds."""
    bounds = [
        value for value in (_free_of_system(), _free_of_group(), _free_of_process()) if value is not None
    ]
    return min(bounds, default=None)


def _free_of_system() -> int | None:
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, StopIteration):  # no Linux
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):  # no Unix
        return None


def _free_of_group() -> int | None:
    """Return the bytes that the control group (a container, a batch job) leaves."""
    folder = Path("/sys/fs/cgroup")
    try:
        most, used = (int((folder / name).read_text("ascii")) for name in ("memory.max", "memory.current"))
    except (OSError, ValueError):  # none, or "max"
        return None
    return max(0, most - used)


def _free_of_process() -> int | None:
    try:
        import resource
    except ModuleNotFoundError:  # Windows, which has no such limit
        return None
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY:
        return None
    try:
        used = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    except (OSError, ValueError):
        used = 0
    return max(0, most - used)
