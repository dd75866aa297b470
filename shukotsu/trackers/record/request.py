"""Hold what the user asks of a recording, checked as far as that needs no tracker."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES, output_items

LARGEST_STATION = 16
TRACK = (0.0, 0.0, 0.0)
"""Hemisphere of a tracker that follows the receiver."""
FORWARD = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class RecordingRequest:
    """Hold what a recording shall be like.

    items : output list as the family numbers its items; empty for the family's full one. stations : None for
    all that are connected. hemisphere : vector of the half of space, TRACK to have the tracker follow the
    receiver. rate_hz : None for what is usual. Raises InputError for what the family cannot do.
    """

    family: str
    mode: str = "binary"
    items: tuple[int, ...] = ()
    rate_hz: int | None = None
    stations: tuple[int, ...] | None = None
    hemisphere: tuple[float, float, float] = FORWARD
    no_filters: bool = False

    def __post_init__(self) -> None:
        family = FAMILIES[self.family]
        used = {
            "--ascii": self.mode == "ascii",
            "--stations": self.stations is not None,
            "--hemisphere": self.hemisphere != FORWARD,
            "--hemisphere track": self.hemisphere == TRACK,
            "--no-filters": self.no_filters,
        }
        for option, sentence in family.unsupported.items():
            if used[option]:
                raise InputError(sentence)
        if self.rate_hz is not None and len(family.rates_hz) < 2:
            raise InputError(f"--rate: a {self.family} has a rate of its own; leave it out")
        known = output_items(self.family)
        if known is not None and not self.items:
            object.__setattr__(self, "items", known.full)

    @property
    def usual_rate_hz(self) -> int:
        """Frames a second: what was asked for, or else what is usual."""
        return self.rate_hz or FAMILIES[self.family].rates_hz[0]


def parse_items(text: str, mode: str, family: str = "liberty") -> tuple[int, ...]:
    """Read --items: `full`, `short` or numbers with commas. Raises InputError.

    What the family's records need to be decoded is put in (see `OutputItems.decodable`).
    """
    known = output_items(family)
    if known is None:
        if text != "full":
            raise InputError(f"--items: a {family} has no output lists; leave it out")
        return ()
    try:
        named = {"full": known.full, "short": known.short}
        items = named.get(text) or tuple(int(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--items: is {text!r}; expected full, short or numbers such as 9,2,7") from error
    unknown = [item for item in items if item not in known.items]
    if unknown:
        numbers = ", ".join(map(str, sorted(known.items)))
        raise InputError(f"--items: {unknown[0]} is no item; expected some of {numbers}")
    items = known.decodable(items, mode)
    size = known.record_bytes(items, mode)
    if len(items) > known.max_items or size > known.max_record_bytes:
        raise InputError(
            f"--items: has {len(items)} items and {size} bytes a record; "
            f"the tracker takes {known.max_items} and {known.max_record_bytes}"
        )
    fields = {field for item in items for field in known.items[item].fields}
    if "x" not in fields:
        positions = " or ".join(str(item) for item in sorted(known.items) if "x" in known.items[item].fields)
        raise InputError(f"--items: {text} has no position; expected item {positions} among them")
    counters = {"frame", "device_ms"}
    counts = any(counters & set(item.fields) for item in known.items.values())
    if counts and not counters & fields:
        raise InputError(
            f"--items: {text} has neither the frame count (9) nor the timestamp (8), so a lost frame could "
            "not be seen; add 9"
        )
    return items


def parse_stations(text: str, last_station: int = LARGEST_STATION) -> tuple[int, ...]:
    """Read --stations: numbers and stretches, such as 1-8,12. Raises InputError."""
    stations: set[int] = set()
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            stations.update(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"--stations: is {text!r}; expected numbers such as 1-8,12") from error
    if not stations or min(stations) < 1 or max(stations) > last_station:
        raise InputError(f"--stations: is {text!r}; expected numbers from 1 to {last_station}")
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
