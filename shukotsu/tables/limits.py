"""Limits of input files, checked before they are read; units of lengths and times.

A study may come from any source, and a small file can demand any amount of memory or time. Readers therefore
accept regular files only, refuse files that expand too far when unpacked, and use limited memory. The limits
are far beyond real recordings and configurations; docs/reliability.md lists them for users.
"""

from __future__ import annotations

import stat
from collections.abc import Callable
from pathlib import Path

from shukotsu.errors import InputError

MEMORY_PER_BYTE, MEMORY_BYTES = 4, 300 * 10**6
"""Largest memory of a reader: a multiple of the file's size plus a constant."""

MOST_EXPANSION = 30
"""Largest expansion of a packed table, beyond MEMORY_BYTES.

Recordings shrink to about a fifth; a file that expands much more mostly repeats one number, so it is not a
measurement.
"""

CONFIG_BYTES = 2 * 10**6
"""Largest size of a study, layout, model or mapping."""
CONFIG_DEPTH = 40
"""Deepest nesting of lists and mappings; the shipped files have 6 levels."""
CONFIG_VALUES = 100_000
"""Largest number of values in a configuration; an alias counts as everything that it refers to."""

LARGEST_WHOLE = 10**18
"""Largest whole number in a configuration; it fits into an integer column."""

LINE_LETTERS = 1_000_000
"""Longest line of a table; the poses of sixteen receivers take 2000 characters."""

SHEET_BYTES = 50 * 10**6
FILE_NAME_BYTES = 255
"""Longest file name that file systems accept."""
NAMES_BYTES = 200
"""Longest total of subject, task and trial, which are part of longer file names."""

FARTHEST_MM = 1e8
"""Largest coordinate: a hundred kilometres, possible if millimetres are declared as metres."""

HAND_SIZES_MM = {"hand_length_mm": (50.0, 400.0), "hand_breadth_mm": (30.0, 200.0)}
"""Plausible sizes of a hand; anything beyond is in another unit."""

RATES_HZ = (0.001, 1e6)
"""Frame rates within which times in s remain finite numbers."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres per unit of position."""

SECONDS_PER_UNIT = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds per unit of time."""

UNIT_NAMES = {
    **{unit: unit for unit in MM_PER_UNIT},
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inches"), "inch"),
}
"""Spellings of units in other programs, in lower case, and the unit as mappings name it."""

_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFDIR: "a folder"}
_KINDS |= dict.fromkeys((stat.S_IFCHR, stat.S_IFBLK), "a device")


def check_regular(path: Path, expected: str) -> int:
    """Check that a path is a regular file before it is opened; a pipe would block and a device never ends.

    Returns
    -------
    int
        Size in bytes.

    Raises
    ------
    InputError
        If it is not a regular file.
    OSError
        If the system cannot access it, for example FileNotFoundError.

    """
    try:
        status = path.stat()
    except ValueError as error:  # a zero byte in the path
        raise InputError(f"{path}: no file can have this name; expected {expected}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "not a regular file")
        raise InputError(f"{path}: is {kind}; expected {expected}, a regular file")
    return status.st_size


def read_whole(path: Path, expected: str, most_bytes: int | None = None) -> bytes:
    """Read a regular file at once.

    Parameters
    ----------
    path : Path
        The file.
    expected : str
        What the file should be, for the error message.
    most_bytes : int, optional
        Largest accepted size.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    InputError
        If it is not a regular file or too large.
    OSError
        If the system cannot read it.

    """
    size = check_regular(path, expected)
    if most_bytes is not None and size > most_bytes:
        raise InputError(f"{path}: has {size} bytes; expected {expected}, at most {most_bytes} bytes")
    return path.read_bytes()


def check_expansion(path: Path, unpacked_bytes: float, remedy: Callable[[], str]) -> None:
    """Refuse a packed file that declares to unpack to far more than its size.

    Parameters
    ----------
    path : Path
        The file.
    unpacked_bytes : float
        Size that it declares.
    remedy : callable
        Returns what to do, for the message.

    Raises
    ------
    InputError
        If that is more than MOST_EXPANSION times its size plus MEMORY_BYTES.

    """
    size = path.stat().st_size
    if unpacked_bytes > MOST_EXPANSION * size + MEMORY_BYTES:
        raise InputError(
            f"{path}: would unpack from {size / 1e6:.1f} MB to {unpacked_bytes / 1e9:.1f} GB, which no "
            f"recording does; {remedy()}"
        )
