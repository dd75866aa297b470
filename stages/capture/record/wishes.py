"""What the user asked of a recording, checked as far as that needs no tracker."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from schemas.errors import InputError
from stages.capture.trackers.fastrak.items import ITEMS as FASTRAK_ITEMS
from stages.capture.trackers.liberty.items import (
    FULL_LIST,
    ITEMS,
    LINE_END,
    MAX_ITEMS,
    MAX_RECORD_BYTES,
    SHORT_LIST,
    SPACE,
    STATIONS,
    record_bytes,
)
from stages.capture.trackers.settings import StreamSettings

FASTRAK_LISTS = {"full": (2, 11, 16, 1), "short": (2, 11, 0)}
"""Position, quaternion, stylus and a line's end; or only what must be."""

TIMESTAMP, FRAME_COUNT = 8, 9
"""Items of LIBERTY that count; without either nothing tells when a record was measured."""

TRACK = (0.0, 0.0, 0.0)
FORWARD = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Wishes:
    """What a recording shall be like.

    items : output list as LIBERTY numbers its items. stations : None for all that are connected.
    hemisphere : vector of the half of space, TRACK to have the tracker follow the receiver.
    rate_hz : None for what is usual.
    """

    family: str
    mode: str = "binary"
    items: tuple[int, ...] = FULL_LIST
    rate_hz: int | None = None
    stations: tuple[int, ...] | None = None
    hemisphere: tuple[float, float, float] = FORWARD
    no_filters: bool = False


class Driver(Protocol):
    """Sets up one family of trackers; made of a `Conversation` and the `Wishes`.

    warnings : what the user should know of the tracker, after `set_up`.
    """

    warnings: list[str]

    def set_up(self) -> StreamSettings:
        """Stop the tracker, ask for its settings, set what is needed, ask again and compare.

        Raises InputError where it does not answer, or did not take a setting.
        """
        ...

    def start(self) -> Mapping[str, Any]:
        """Have it stream; gives what the archive shall say of that, as JSON types."""
        ...

    def stop(self) -> None:
        """Have it stop."""
        ...

    def put_back(self) -> None:
        """Set what `set_up` changed to what it was."""
        ...


def parse_items(text: str, mode: str, family: str = "liberty") -> tuple[int, ...]:
    """Read --items: `full`, `short` or numbers with commas. Raises InputError.

    In text, LIBERTY puts no blank of its own around counters and the like, so that one is put behind each,
    and a record ends its line. A FASTRAK's record ends with an item that is always the same, by which its
    decoder holds on to it.
    """
    if family in ("viper", "trakstar"):
        if text != "full":
            raise InputError(f"--items: a {family} has no output lists; leave it out")
        return ()
    fastrak = family == "fastrak"
    known = sorted(FASTRAK_ITEMS if fastrak else ITEMS)
    named = FASTRAK_LISTS if fastrak else {"full": FULL_LIST, "short": SHORT_LIST}
    try:
        items = named.get(text) or tuple(int(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--items: is {text!r}; expected full, short or numbers such as 9,2,7") from error
    unknown = [item for item in items if item not in known]
    if unknown:
        raise InputError(f"--items: {unknown[0]} is no item; expected some of {', '.join(map(str, known))}")
    if fastrak:
        return _fastrak_list(items, text, mode)
    if mode == "ascii":
        items = text_list(items)
    size = record_bytes(items, mode)
    if len(items) > MAX_ITEMS or size > MAX_RECORD_BYTES:
        raise InputError(
            f"--items: has {len(items)} items and {size} bytes a record; "
            f"the tracker takes {MAX_ITEMS} and {MAX_RECORD_BYTES}"
        )
    if not {2, 3} & set(items):
        raise InputError(f"--items: {text} has no position; expected item 2 or 3 among them")
    if not {TIMESTAMP, FRAME_COUNT} & set(items):
        raise InputError(
            f"--items: {text} has neither the frame count ({FRAME_COUNT}) nor the timestamp ({TIMESTAMP}), "
            f"so a lost frame could not be seen; add {FRAME_COUNT}"
        )
    return items


def _fastrak_list(items: tuple[int, ...], text: str, mode: str) -> tuple[int, ...]:
    if not {2, 52} & set(items):
        raise InputError(f"--items: {text} has no position; expected item 2 or 52 among them")
    if mode == "ascii":
        return items if items[-1] == LINE_END else (*items, LINE_END)
    return items if items[-1] in (SPACE, LINE_END) else (*items, SPACE)


def text_list(items: tuple[int, ...]) -> tuple[int, ...]:
    """Give an output list with what makes its text readable: blanks behind numbers, a line's end."""
    parted: list[int] = []
    for item, following in zip(items, (*items[1:], LINE_END), strict=True):
        parted.append(item)
        if item >= 8 and following not in (SPACE, LINE_END):
            parted.append(SPACE)
    return tuple(parted) if parted[-1] == LINE_END else (*parted, LINE_END)


def parse_stations(text: str) -> tuple[int, ...]:
    """Read --stations: numbers and stretches, such as 1-8,12. Raises InputError."""
    stations: set[int] = set()
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            stations.update(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"--stations: is {text!r}; expected numbers such as 1-8,12") from error
    wrong = sorted(stations - set(STATIONS))
    if wrong or not stations:
        raise InputError(f"--stations: is {text!r}; expected numbers from 1 to {STATIONS[-1]}")
    return tuple(sorted(stations))


def parse_hemisphere(text: str) -> tuple[float, float, float]:
    """Read --hemisphere: three numbers with commas, or `track`. Raises InputError."""
    if text == "track":
        return TRACK
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--hemisphere: is {text!r}; expected x,y,z such as 1,0,0, or track") from error
    if not 0 < math.hypot(x, y, z) < math.inf:
        raise InputError(f"--hemisphere: {text} is no direction; `track` has the tracker follow the receiver")
    return (x, y, z)
