"""Output items of LIBERTY and PATRIOT.

Source: LIBERTY User Manual URM03PH156, output list command ('O') and tables of output formats.
"""

from __future__ import annotations

from shukotsu.trackers.protocols.output_items import EXTENDED, Item, OutputItems

TAGS = {"liberty": b"LY", "patriot": b"PA"}
"""First two bytes of a binary record or reply."""

MAX_BODY_BYTES = 2800
"""The longest reply (a stored configuration) has 2384 bytes; a longer one is none."""

STREAMED, SINGLE = ord("C"), ord("P")
"""The command byte of a record: while streaming, and in answer to a single poll."""

SPACE, LINE_END, COSINES, QUATERNION, TIMESTAMP, FRAME_COUNT = 0, 1, 6, 7, 8, 9
_ANGLES = ("azimuth", "elevation", "roll")
ITEMS = {
    SPACE: Item(("blank",), "u1", " "),
    LINE_END: Item(("cr", "lf"), "u1", "\r\n"),
    2: Item(("x", "y", "z"), "f4", "%8.3f " * 3),
    3: Item(("x", "y", "z"), "f4", EXTENDED * 3),
    4: Item(_ANGLES, "f4", "%8.3f " * 3),
    5: Item(_ANGLES, "f4", EXTENDED * 3),
    COSINES: Item(
        tuple(f"cosine_{row}{column}" for row in "xyz" for column in "xyz"), "f4", ("%8.5f " * 3 + "\r\n") * 3
    ),
    QUATERNION: Item(("qw", "qx", "qy", "qz"), "f4", "%8.5f " * 4),
    TIMESTAMP: Item(("device_ms",), "u4", "%d"),
    FRAME_COUNT: Item(("frame",), "u4", "%d"),
    10: Item(("button",), "i4", "%d"),
    11: Item(("distortion",), "i4", "%d"),
    12: Item(("sync",), "i4", "%d"),
}

DEFAULT_LIST = (2, 4, 1)
FULL_LIST = (8, 9, 11, 10, 12, 3, 7)
"""What a recorder asks for: both counters, distortion, stylus, sync, position and quaternion; 56 bytes."""
SHORT_LIST = (9, 2, 7)
"""Frame count, position and quaternion: 40 bytes, for a line that cannot carry more."""


def _decodable(items: tuple[int, ...], mode: str) -> tuple[int, ...]:
    """Put a blank behind every counter in ASCII, where there is none of its own, and end the line."""
    if mode == "binary":
        return items
    parted: list[int] = []
    for item, following in zip(items, (*items[1:], LINE_END), strict=True):
        parted.append(item)
        if item >= TIMESTAMP and following not in (SPACE, LINE_END):
            parted.append(SPACE)
    return tuple(parted) if parted[-1] == LINE_END else (*parted, LINE_END)


OUTPUT_ITEMS = OutputItems(
    family="LIBERTY",
    items=ITEMS,
    stations=range(1, 17),
    max_items=20,
    max_record_bytes=1000,
    header=(
        *(("tag", "V2"), ("station", "u1"), ("command", "u1")),
        *(("error", "u1"), ("reserved", "u1"), ("size", "<i2")),
    ),
    text_header_bytes=4,
    full=FULL_LIST,
    short=SHORT_LIST,
    decodable=_decodable,
)

HEADER_BYTES = OUTPUT_ITEMS.header_bytes
