"""Output items of FASTRAK.

Source: FASTRAK User Manual OPM00PI002, output list command ('O'); the two characters of item 16 after VRPN's
driver.
"""

from __future__ import annotations

from shukotsu.trackers.protocols.output_items import EXTENDED, Item, OutputItems

SPACE, LINE_END, STYLUS = 0, 1, 16
_NUMBERS = {
    2: (("x", "y", "z"), "%7.2f"),
    3: (("moved_x", "moved_y", "moved_z"), "%7.2f"),
    4: (("azimuth", "elevation", "roll"), "%7.2f"),
    5: (("cosine_xx", "cosine_xy", "cosine_xz"), "%7.4f"),
    6: (("cosine_yx", "cosine_yy", "cosine_yz"), "%7.4f"),
    7: (("cosine_zx", "cosine_zy", "cosine_zz"), "%7.4f"),
    11: (("qw", "qx", "qy", "qz"), "%7.4f"),
}
ITEMS = {
    SPACE: Item(("blank",), "u1", " "),
    LINE_END: Item(("cr", "lf"), "u1", "\r\n"),
    STYLUS: Item(("blank", "button"), "u1", " %d"),
    **{number: Item(fields, "f4", text * len(fields)) for number, (fields, text) in _NUMBERS.items()},
    **{50 + number: Item(fields, "f4", EXTENDED * len(fields)) for number, (fields, _) in _NUMBERS.items()},
}
"""Item 50 + x is item x written with an exponent."""


def _decodable(items: tuple[int, ...], mode: str) -> tuple[int, ...]:
    """End a record with an item that is always the same, by which its decoder holds on to it."""
    if mode == "ascii":
        return items if items[-1] == LINE_END else (*items, LINE_END)
    return items if items[-1] in (SPACE, LINE_END) else (*items, SPACE)


OUTPUT_ITEMS = OutputItems(
    family="FASTRAK",
    items=ITEMS,
    stations=range(1, 5),
    max_items=32,
    max_record_bytes=1000,
    header=(("zero", "u1"), ("station", "u1"), ("error", "u1")),
    text_header_bytes=3,
    full=(2, 11, STYLUS, LINE_END),
    short=(2, 11, SPACE),
    decodable=_decodable,
)
"""The lists of a recorder: position, quaternion, stylus and a line's end; or only what must be."""
