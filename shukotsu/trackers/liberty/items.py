"""Output items of LIBERTY and PATRIOT: what a binary record holds, and how many bytes it takes.

Source: LIBERTY User Manual URM03PH156, output list command ('O') and tables of output formats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shukotsu.errors import InputError

TAGS = {"liberty": b"LY", "patriot": b"PA"}
"""First two bytes of a binary record or reply."""

MAX_BODY_BYTES = 2800
"""The longest reply (a stored configuration) has 2384 bytes; a longer one is none."""

STREAMED, SINGLE = ord("C"), ord("P")
"""The command byte of a record: while streaming, and in answer to a single poll."""

STATIONS = range(1, 17)
HEADER = (
    ("tag", "V2"), ("station", "u1"), ("command", "u1"), ("error", "u1"), ("reserved", "u1"), ("size", "<i2"),
)  # fmt: skip
HEADER_BYTES = np.dtype(list(HEADER)).itemsize

QUATERNION = 7
ITEMS: dict[int, tuple[tuple[str, ...], str]] = {
    0: (("blank",), "u1"),
    1: (("cr", "lf"), "u1"),
    2: (("x", "y", "z"), "f4"),
    3: (("x", "y", "z"), "f4"),
    4: (("azimuth", "elevation", "roll"), "f4"),
    5: (("azimuth", "elevation", "roll"), "f4"),
    6: (tuple(f"cosine_{row}{column}" for row in "xyz" for column in "xyz"), "f4"),
    QUATERNION: (("qw", "qx", "qy", "qz"), "f4"),
    8: (("device_ms",), "u4"),
    9: (("frame",), "u4"),
    10: (("button",), "i4"),
    11: (("distortion",), "i4"),
    12: (("sync",), "i4"),
}
"""Item -> what its numbers are, in turn, and their NumPy letter in binary."""

MOST_ITEMS = 20
DEFAULT_LIST = (2, 4, 1)
FULL_LIST = (8, 9, 11, 10, 12, 3, 7)
"""What a recorder asks for: both counters, distortion, stylus, sync, position and quaternion; 56 bytes."""
SHORT_LIST = (9, 2, 7)
"""Frame count, position and quaternion: 40 bytes, for a line that cannot carry more."""


def record_type(items: Sequence[int]) -> np.dtype[np.void]:
    """NumPy type of a whole binary record; an item that is given twice keeps its first numbers."""
    fields, names = list(HEADER), {name for name, _ in HEADER}
    for index, item in enumerate(items):
        numbers, kind = ITEMS[item]
        for name in numbers:
            fields.append((f"{name}_{index}" if name in names else name, f"<{kind}"))
            names.add(name)
    return np.dtype(fields)


def list_of_all(lists: Mapping[int, Sequence[int]]) -> tuple[int, ...]:
    """Return the output list that all stations have; lists : station -> its list.

    Raises InputError where there is no such station or item, or the lists differ.
    """
    for station, items in lists.items():
        if station not in STATIONS or not items or not ITEMS.keys() >= set(items):
            raise InputError(
                f"settings of the tracker: output list {list(items)} of station {station}; a LIBERTY "
                f"has stations 1 to {STATIONS[-1]} and items {', '.join(map(str, ITEMS))}; correct the lists"
            )
    several = {tuple(items) for items in lists.values()}
    if len(several) != 1:
        raise InputError(
            f"settings of the tracker: has {len(several)} output lists; expected one for all stations"
        )
    return several.pop()
