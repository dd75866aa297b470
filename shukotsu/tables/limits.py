"""Limit what a file may be before it is read: every limit that guards a reader; units of lengths and times.

A study comes from anywhere, and a few bytes can ask for any amount of memory or time. A reader takes regular
files, refuses one that grows too far when it is unpacked, and then works within WORKING_MEMORY. What a file
may hold is wide of what recordings and configuration hold; docs/reliability.md lists it for users.
"""

from __future__ import annotations

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

RATES_HZ = (0.001, 1e6)
"""Frames a second: times in s of any number of frames stay numbers."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres of every unit that a position may come in."""

SECONDS_PER_UNIT = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds of every unit that times may come in."""

UNIT_NAMES = {
    **{unit: unit for unit in MM_PER_UNIT},
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inches"), "inch"),
}
"""What programs write of a unit, in lower case, and the mapping's name for it."""

_KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
}


def check_regular(path: Path, expected: str) -> int:
    """Return the size of a file [bytes] before it is opened: a pipe lets one wait, a device never ends.

    Raises InputError where it is no regular file, FileNotFoundError and other OSErrors as the system does.
    """
    try:
        status = path.stat()
    except ValueError as error:  # a zero byte in the path
        raise InputError(f"{path}: no file can have this name; expected {expected}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "no regular file")
        raise InputError(f"{path}: is {kind}; expected {expected}, a regular file")
    return status.st_size


def read_whole(path: Path, expected: str, most_bytes: int | None = None) -> bytes:
    """Read a regular file at once; most_bytes : of what is never longer.

    Raises InputError where it is no regular file or too long, OSErrors as the system does.
    """
    size = check_regular(path, expected)
    if most_bytes is not None and size > most_bytes:
        raise InputError(f"{path}: has {size} bytes; expected {expected}, at most {most_bytes} bytes")
    return path.read_bytes()


def check_expansion(path: Path, unpacked_bytes: float, remedy: str) -> None:
    """Raise InputError where what a file says it unpacks to is far beyond its size."""
    size = path.stat().st_size
    if unpacked_bytes > MOST_EXPANSION * size + MEMORY_BYTES:
        raise InputError(
            f"{path}: would unpack from {size / 1e6:.1f} MB to {unpacked_bytes / 1e9:.1f} GB, which no "
            f"recording does; {remedy}"
        )
