"""In which units a table's columns are: what their titles state, unless their numbers cannot be that."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shukotsu.hand.rotations import Array
from shukotsu.readers.inspection.column_roles import (
    ANGLE_UNITS,
    POSITION_UNITS,
    TIME_UNITS,
    Roles,
    split_title,
)
from shukotsu.readers.inspection.description import CHECK, IMPOSSIBLE_EXTENTS, extent, median_step, rate_line
from shukotsu.tables.units import MM_PER_UNIT, SECONDS_PER_UNIT

STATED = "as the columns' titles say"
LEAST_HZ, MOST_HZ = 1.0, 5000.0
"""Frames come at such rates, whatever the tracker."""
_DATES_S = (9e8, 4.2e9)
"""Seconds since 1970 of a recording's day."""
TWO_PI = 2 * np.pi + 0.01


class Unit(NamedTuple):
    """A unit for the mapping, or CHECK; why, in a comment; what speaks against the one that titles state."""

    unit: str
    why: str
    doubt: str = ""

    @property
    def stated(self) -> str:
        """The unit that titles state and numbers do not contradict; else empty."""
        return self.unit if self.why == STATED else ""


class Units(NamedTuple):
    """The units of a table's columns."""

    position: Unit
    angle: Unit
    time: Unit


def find_units(roles: Roles, numbers: Mapping[str, Array]) -> Units:
    """Return the units of columns with these roles; numbers : title -> (N,)."""
    return Units(
        _position_unit(roles.positions, numbers),
        _angle_unit(roles.angles, numbers),
        _time_unit(roles.time, numbers) if roles.time else Unit(CHECK, ""),
    )


def _position_unit(groups: Iterable[Sequence[str]], numbers: Mapping[str, Array]) -> Unit:
    """The unit of positions, by the titles of all of them together."""
    titles = [title for group in groups for title in group]
    span = max((float(np.ptp(values)) for values in _finite(titles, numbers)), default=0.0)
    why = "mm, cm, m or inch" + (f"; positions span {span:.3g} of it" if titles else "")
    units = _stated(titles, POSITION_UNITS)
    if span and len(units) == 1 and units[0]:
        would_be = extent(span * MM_PER_UNIT[units[0]])
        if would_be in IMPOSSIBLE_EXTENTS:
            return _doubted(why, f"the titles of positions say {units[0]}, in which their span is {would_be}")
    return _settled(units, why, "positions")


def _angle_unit(groups: Iterable[Sequence[str]], numbers: Mapping[str, Array]) -> Unit:
    """The unit of angles, by the titles of all of them together, else by the largest."""
    titles = [title for group in groups for title in group]
    by_size = angle_unit_by_size(titles, numbers)
    units = _stated(titles, ANGLE_UNITS)
    if by_size.unit == "deg" and "rad" not in units:
        return Unit("deg", STATED if units == ["deg"] else by_size.why)
    if units == ["deg"] or (units == ["rad"] and by_size.unit == "deg"):
        return _doubted("deg or rad", f"the titles of angles say {units[0]}; they look like {by_size.why}")
    return _settled(units, f"deg or rad; {by_size.why}", "angles")


def angle_unit_by_size(titles: Iterable[str], numbers: Mapping[str, Array]) -> Unit:
    """The unit of angles, by the largest of them alone."""
    largest = max((float(np.abs(values).max()) for values in _finite(titles, numbers)), default=0.0)
    if largest > TWO_PI:
        return Unit("deg", f"degrees, as {largest:.4g} is more than two pi")
    return Unit(CHECK, "radians, or degrees of very small turns")


def _time_unit(title: str, numbers: Mapping[str, Array]) -> Unit:
    """The unit of the column of times, by its title."""
    times, unit = numbers[title], split_title(title).unit
    why = rate_line("s, ms, us or ns", times, SECONDS_PER_UNIT)
    step = median_step(times)
    if unit not in TIME_UNITS:
        for name, seconds in SECONDS_PER_UNIT.items():
            date = _DATES_S[0] < np.nanmedian(times) * seconds < _DATES_S[1]
            if date and step and LEAST_HZ <= 1 / (step * seconds) <= MOST_HZ:
                return Unit(name, "as its numbers then are dates, counted from 1970")
        return Unit(CHECK, why)
    rate_hz = None if step is None else 1 / (step * SECONDS_PER_UNIT[unit])
    if rate_hz is None or LEAST_HZ <= rate_hz <= MOST_HZ:
        return Unit(unit, STATED)
    return _doubted(why, f"the title {title} says {unit}, in which frames come at {rate_hz:.4g} Hz")


def _finite(titles: Iterable[str], numbers: Mapping[str, Array]) -> Iterator[Array]:
    for title in titles:
        yield numbers[title][np.isfinite(numbers[title])]


def _stated(titles: Iterable[str], units: frozenset[str]) -> list[str]:
    """The units of that kind that titles state, empty among them where one states none."""
    every = (split_title(title).unit for title in titles)
    return list(dict.fromkeys(unit if unit in units else "" for unit in every))


def _settled(units: Sequence[str], why: str, what: str) -> Unit:
    """The one unit that all titles state; what some or several state is a doubt."""
    stated = [unit for unit in units if unit]
    if len(units) == 1 and stated:
        return Unit(units[0], STATED)
    if not stated:
        return Unit(CHECK, why)
    others = ", others nothing" if "" in units else ""
    return _doubted(why, f"titles of {what} say {' and '.join(stated)}{others}")


def _doubted(why: str, doubt: str) -> Unit:
    return Unit(CHECK, f"{why}; {doubt}", doubt)
