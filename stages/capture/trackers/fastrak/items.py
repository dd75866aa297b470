"""Output items of FASTRAK: what a record can hold.

Source: FASTRAK User Manual OPM00PI002, output list command ('O'); the two characters of item 16 after VRPN's
driver.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from schemas.errors import InputError
from stages.capture.trackers.settings import StreamSettings

HEADER_BYTES = 3
STATIONS = range(1, 5)
WIDTH, EXTENDED_WIDTH = 7, 15
"""Characters of a number in ASCII; of an extended one at the most."""


@dataclass(frozen=True)
class Item:
    """One item of an output list.

    fields : what its numbers are; kind : NumPy letter of a number in binary; decimals : of a number in
    ASCII, which is 7 characters wide, 0 where it is no such number; extended : whether ASCII writes it with
    an exponent.
    """

    fields: tuple[str, ...]
    kind: str = "f4"
    decimals: int = 0
    extended: bool = False


SPACE, LINE_END, STYLUS = 0, 1, 16
_NUMBERS = {
    2: (("x", "y", "z"), 2),
    3: (("moved_x", "moved_y", "moved_z"), 2),
    4: (("azimuth", "elevation", "roll"), 2),
    5: (("cosine_xx", "cosine_xy", "cosine_xz"), 4),
    6: (("cosine_yx", "cosine_yy", "cosine_yz"), 4),
    7: (("cosine_zx", "cosine_zy", "cosine_zz"), 4),
    11: (("qw", "qx", "qy", "qz"), 4),
}
ITEMS = {
    SPACE: Item(("blank",), "u1"),
    LINE_END: Item(("cr", "lf"), "u1"),
    STYLUS: Item(("stylus_blank", "button"), "u1"),
    **{number: Item(fields, decimals=decimals) for number, (fields, decimals) in _NUMBERS.items()},
    **{50 + number: Item(fields, extended=True) for number, (fields, _) in _NUMBERS.items()},
}

DEFAULT_LIST = (2, 4, 1)


def output_lists(settings: StreamSettings) -> Mapping[int, tuple[int, ...]]:
    """Give the output list of each station. Raises InputError where one has an item that FASTRAK has not."""
    lists = {station: tuple(items) for station, items in settings.items.items()}
    for station, items in lists.items():
        strange = [item for item in items if item not in ITEMS]
        if strange or station not in STATIONS or not items:
            raise InputError(
                f"settings of the tracker: output list {list(items)} of station {station}; a FASTRAK has "
                f"stations 1 to 4 and items {', '.join(map(str, ITEMS))}; correct its output lists"
            )
    return lists


def field_names(items: Sequence[int]) -> list[str]:
    """Names of all numbers of a record in turn; of what is given twice, the second is nameless."""
    names: list[str] = []
    for item in items:
        names += ["" if name in names else name for name in ITEMS[item].fields]
    return names


def record_bytes(items: Sequence[int], mode: str = "binary") -> int:
    """Bytes of a whole record, header and all; in ASCII the most that it can be."""
    sizes = (_item_bytes(ITEMS[item], mode) for item in items)
    return HEADER_BYTES + sum(sizes)


def _item_bytes(item: Item, mode: str) -> int:
    if mode == "binary" or item.kind == "u1":
        return len(item.fields) * int(item.kind[1])
    return len(item.fields) * (EXTENDED_WIDTH if item.extended else WIDTH)
