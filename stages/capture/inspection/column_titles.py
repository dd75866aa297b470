"""Titles of columns taken apart: the name, and the unit stated, as in `x_cm`, `Time (ms)`, `roll [rad]`."""

from __future__ import annotations

import re
from typing import NamedTuple

from shukotsu.schemas.units import UNIT_NAMES

POSITION_UNITS = frozenset(UNIT_NAMES.values())

_ANGLES = {
    "deg": ("deg", "degree", "degrees", "°"),
    "rad": ("rad", "radian", "radians"),
}
_TIMES = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "usec", "µs", "μs", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}
ANGLE_UNITS, TIME_UNITS = frozenset(_ANGLES), frozenset(_TIMES)

_UNITS = {
    **UNIT_NAMES,
    **{word: unit for units in (_ANGLES, _TIMES) for unit, words in units.items() for word in words},
}
"""What titles write of a unit, in lower case, and the mapping's name for it."""

_WORDS = "|".join(sorted(map(re.escape, _UNITS), key=len, reverse=True))
_STATED = re.compile(
    rf"[\W_]*[(\[]\s*(?P<bracketed>{_WORDS})\s*[)\]]|(?<=[^\W_])[\W_]+(?P<last>{_WORDS})(?=[\W_]*\d*[\W_]*$)",
    re.I,
)
"""A unit in brackets anywhere, or as the last word but for a number: a letter elsewhere may be a finger's."""


class Title(NamedTuple):
    """A title without its unit, and the unit by the mapping's name; empty where it states none."""

    name: str
    unit: str


def split_title(title: str) -> Title:
    """Take the unit out of a title."""
    found = _STATED.search(title)
    if found is None:
        return Title(title, "")
    word = found["bracketed"] or found["last"]
    return Title(title[: found.start()] + title[found.end() :], _UNITS[word.lower()])
