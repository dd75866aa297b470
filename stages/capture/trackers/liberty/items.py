"""Output items of LIBERTY and PATRIOT: what a record can hold, and how many bytes it takes.

Source: LIBERTY User Manual URM03PH156, output list command ('O') and tables of output formats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from schemas.errors import InputError

HEADER_BYTES = 8
TEXT_HEADER_BYTES = 4
MAX_ITEMS = 20
MAX_RECORD_BYTES = 1000
STATIONS = range(1, 17)
TAGS = {"liberty": b"LY", "patriot": b"PA"}

STREAMED, SINGLE = ord("C"), ord("P")
"""The command byte of a record: while streaming, and in answer to a single poll."""


@dataclass(frozen=True)
class Item:
    """One item of an output list.

    fields : what its numbers are; kind : NumPy letter of a number in binary ("f4", "u4", "i4", "u1");
    text_bytes : its width in ASCII, the widest where it varies.
    """

    fields: tuple[str, ...]
    kind: str
    text_bytes: int

    @property
    def binary_bytes(self) -> int:
        """Bytes in a binary record."""
        return len(self.fields) * int(self.kind[1])


_COSINES = tuple(f"cosine_{row}{column}" for row in "xyz" for column in "xyz")

SPACE, LINE_END, QUATERNION = 0, 1, 7
ITEMS = {
    SPACE: Item(("blank",), "u1", 1),
    LINE_END: Item(("cr", "lf"), "u1", 2),
    2: Item(("x", "y", "z"), "f4", 27),
    3: Item(("x", "y", "z"), "f4", 45),
    4: Item(("azimuth", "elevation", "roll"), "f4", 27),
    5: Item(("azimuth", "elevation", "roll"), "f4", 45),
    6: Item(_COSINES, "f4", 87),
    QUATERNION: Item(("qw", "qx", "qy", "qz"), "f4", 36),
    8: Item(("device_ms",), "u4", 10),
    9: Item(("frame",), "u4", 10),
    10: Item(("button",), "i4", 1),
    11: Item(("distortion",), "i4", 1),
    12: Item(("sync",), "i4", 1),
}

DEFAULT_LIST = (2, 4, 1)
FULL_LIST = (8, 9, 11, 10, 12, 3, 7)
"""What a recorder asks for: both counters, distortion, stylus, sync, position and quaternion; 56 bytes."""

SHORT_LIST = (9, 2, 7)
"""Frame count, position and quaternion: 40 bytes, for a line that cannot carry more."""


def check_items(items: Sequence[int]) -> None:
    """Raise InputError where an output list names an item that there is not, or is too long."""
    odd = [item for item in items if item not in ITEMS]
    if odd:
        raise InputError(f"output list: item {odd[0]} is unknown; known are {', '.join(map(str, ITEMS))}")
    if len(items) > MAX_ITEMS or record_bytes(items) > MAX_RECORD_BYTES:
        raise InputError(
            f"output list: {len(items)} items, {record_bytes(items)} bytes; expected at most {MAX_ITEMS} "
            f"items and {MAX_RECORD_BYTES} bytes"
        )


def body_bytes(items: Sequence[int]) -> int:
    """Bytes of a binary record after its header."""
    return sum(ITEMS[item].binary_bytes for item in items)


def record_bytes(items: Sequence[int], mode: str = "binary") -> int:
    """Bytes of a whole record, header and all; in ASCII the most that it can be."""
    if mode == "binary":
        return HEADER_BYTES + body_bytes(items)
    return TEXT_HEADER_BYTES + sum(ITEMS[item].text_bytes for item in items)
