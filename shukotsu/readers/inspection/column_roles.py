"""Infer roles and units of a table's columns from their titles, checked against their numbers."""

from __future__ import annotations

import functools
import operator
import os
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.readers.formats.mapped import snake_case
from shukotsu.readers.inspection.description import CHECK, IMPOSSIBLE_EXTENTS, extent, median_step, rate_line
from shukotsu.tables.limits import MM_PER_UNIT, SECONDS_PER_UNIT, UNIT_NAMES

_ANGLES = {"deg": ("deg", "degree", "degrees", "°"), "rad": ("rad", "radian", "radians")}
_TIMES = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "usec", "µs", "μs", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}
_UNITS = {
    **UNIT_NAMES,
    **{word: unit for units in (_ANGLES, _TIMES) for unit, words in units.items() for word in words},
}
"""Spellings of units in titles, in lower case, and the unit's name in mappings."""
_WORDS = "|".join(sorted(map(re.escape, _UNITS), key=len, reverse=True))
_STATED = re.compile(
    rf"[\W_]*[(\[]\s*(?P<bracketed>{_WORDS})\s*[)\]]"
    rf"|(?<=[^\W_])[\W_]+(?P<last>{_WORDS})(?!(?<=[\W_].)\d)(?=[\W_]*\d*[\W_]*$)",
    re.I,
)
"""A unit in brackets, or as the last word before an optional number; other letters may name a finger.

A single letter at a number, as in q0_S01 or x_M1, names a receiver.
"""


class Title(NamedTuple):
    """A title without its unit, and the unit's name in mappings, or ""."""

    name: str
    unit: str


def split_title(title: str) -> Title:
    """Split a title into its name and its unit."""
    match = _STATED.search(title)
    if match is None:
        return Title(title, "")
    word = match["bracketed"] or match["last"]
    return Title(title[: match.start()] + title[match.end() :], _UNITS[word.lower()])


_NORM_SHARE = 0.9
_NORM_OFF = 0.02
_MOST_STATION = 64

_TIME = re.compile(r"time|stamp|^t$|^t_|sec", re.I)
_FRAME = re.compile(r"frame|sample|count|^index$|^n$|^#$", re.I)
_RECEIVER = re.compile(r"child_frame_id|receiver|sensor|station|segment|marker|^id$|device|channel", re.I)
_QUALITY = re.compile(r"quality|^q(ual)?[\W_]*\d*$", re.I)
_ASIDE = re.compile(
    r"quality|error|dist(ortion)?$|sub_?frame|button|stylus|sync|status|conf|flag|temp|(?<![a-z])(acc(?!ur)|gyr|magneto"
    r"|veloc|omega|(hours?|minutes?|date|handle|state|rate|force|torque|emg|pressure|gravity|mag)(?![a-z])"
    r"|(id|index|count|port)(_?\d+)?$)"
)
"""Words of columns that are not poses; searched in titles in snake case."""
_SCALAR_FIRST = re.compile(r"q(?:uat)?[\W_]?(?P<digit>[0-3])(?!\d)", re.I)
_MANY_ROWS = 20
"""Over this many rows no position increases in every row or stays constant to the last digit."""
_ANGLE = re.compile(
    r"az|el(ev)?(ation)?\d*$|roll|pitch|yaw|euler|ori|rot|ang|att|psi|theta|phi|(?<![a-z])r[xyz](?![a-z])",
    re.I,
)
_AXIS = re.compile(
    r"(?P<before>.*?)(?P<axis>(?<![a-z])az(imuth)?|(?<![a-z])el(ev(ation)?)?|(?<![a-z])rol?l?"
    r"|(?<![a-z])[aer](?![a-z])|[wxyz])"
    r"(?P<after>[\W_]*(mm|cm|m|in|inch|deg|rad)?[\W_]*\d*[\W_]*)",
    re.I,
)
_AXIS_WITHIN = re.compile(r"(?P<before>(.*[\W_])?[a-z]?)(?P<axis>[wxyz])(?P<after>[\W_].*)", re.I)
"""The axis in a title, and the parts before and after it, which a receiver's titles share."""


def _axis_in(name: str) -> re.Match[str] | None:
    return _AXIS.fullmatch(name) or _AXIS_WITHIN.fullmatch(name)


_NAMED_GROUPS = (("w", "x", "y", "z"), ("x", "y", "z"), ("a", "e", "r"))


@dataclass(frozen=True)
class Roles:
    """Presumed roles of a table's columns, by title.

    quaternions, matrices, angles, positions : groups of four, nine, three and three titles in the order of
    the table, except that azimuth, elevation and roll are put in this order. quality : of each receiver, or
    of all. aside : other numbers; text : columns without numbers; empty : columns without values, even if
    their names put them in a group. nanoseconds : column to be added to the seconds in `time`. guessed :
    titles whose role follows only from their position in the table, not from their name or numbers.
    """

    time: str | None = None
    nanoseconds: str | None = None
    frame: str | None = None
    receiver: str | None = None
    quaternions: list[list[str]] = field(default_factory=list)
    matrices: list[list[str]] = field(default_factory=list)
    angles: list[list[str]] = field(default_factory=list)
    positions: list[list[str]] = field(default_factory=list)
    quality: list[str] = field(default_factory=list)
    aside: list[str] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    guessed: set[str] = field(default_factory=set)

    @property
    def orientations(self) -> tuple[str, list[list[str]]]:
        """Return the most frequent kind of orientation, and its groups."""
        kinds = {"quaternion": self.quaternions, "matrix": self.matrices, "euler": self.angles}
        kind = max(kinds, key=lambda name: len(kinds[name]))
        return kind, kinds[kind]


def find_roles(
    titles: Sequence[str], numbers: Mapping[str, Array], words: Mapping[str, Integers], clocks: Sequence[str]
) -> Roles:
    """Infer the roles of columns from their numbers, and from their names if the numbers are ambiguous.

    titles : all columns; numbers : columns with numbers or without values, title -> (N,); words : columns of
    text without empty cells, title -> (N,) codes of their texts; clocks : columns of times of day or dates.
    """
    numeric = [title for title in titles if title in numbers]
    inertial = [[t for t in numeric if re.fullmatch(rf"{x}_?[xyz]", t, re.I)] for x in "agm"]
    whole = sum(len(axes) == 3 for axes in inertial) > 1  # accelerometer, gyroscope, magnetometer
    moved = {t for axes in inertial for t in axes if whole}
    aside = [t for t in numeric if t in moved or _ASIDE.search(snake_case(t))]
    named = _named_groups([t for t in numeric if t not in aside], numbers)
    empty = [t for t in numeric if not np.isfinite(numbers[t]).any()]
    numeric = [t for t in numeric if t in named or t not in empty]
    unnamed = [t for t in numeric if t not in named]
    split = {t: split_title(t) for t in unnamed}
    times = [t for t in unnamed if split[t].unit in _TIMES or any(map(_TIME.search, (t, split[t].name)))]
    coded = [t for t in unnamed if (t not in aside or _RECEIVER.search(t)) and _few_wholes(numbers[t])]
    stations = {**words, **{t: np.unique(numbers[t], return_inverse=True)[1] for t in coded}}
    starts = [np.diff(codes) != 0 for codes in stations.values()]
    time = next((t for t in (*clocks, *times) if _grows(numbers[t], starts)), None)
    within = {t: re.sub(r"n(?:ano)?(secs?)$", r"\1", t, flags=re.I) for t in unnamed}
    nanoseconds = next((t for t, seconds in within.items() if seconds != t and seconds in unnamed), None)
    time = within[nanoseconds] if nanoseconds else time
    clocklike = [t for t in numeric if _grows(numbers[t], starts)]
    counts = [t for t in clocklike if (numbers[t] == np.floor(numbers[t])).all()]
    frame = next((t for t in counts if t != time and _FRAME.search(t)), None)
    wide = len({id(group) for group in named.values() if len(group) == 4}) > 1
    possible = [] if wide else [t for t in titles if t not in (time, frame)]
    named_so = [t for t in possible if _RECEIVER.search(t) and not re.search("stat[eu]", t, re.I)]
    receiver = next((t for t in named_so if t not in numbers or _few_wholes(numbers[t])), None)
    guessed: set[str] = set()
    if receiver is None:
        # a counter takes turns, too, but only rows of different receivers have times or frames in common
        in_common = any(len(np.unique(numbers[t])) <= len(numbers[t]) / 2 for t in clocklike)
        turns = [t for t in possible if t in words or (t in coded and (in_common or t == titles[0]))]
        clock = numbers.get(time or frame or "", np.zeros(1))
        receiver = next((t for t in turns if _take_turns(stations[t], clock)), None)
        guessed = {receiver} if receiver else set()
    text = [title for title in titles if title not in numbers and title != receiver]
    left = [title for title in numeric if title not in (time, nanoseconds, frame, receiver)]
    free = [t for t in left if t not in named and not _ASIDE.search(t) and len(numbers[t]) > 1]
    growing = [t for t in free if (receiver and t in clocklike) or (np.diff(numbers[t]) > 0).all()]
    if time is None and growing == left[: len(growing)]:  # the only increasing columns, and the first
        if frame is None:  # in a long table, a column that grows in every row numbers the rows
            frames = [t for t in growing if not receiver or (np.diff(numbers[t]) <= 0).any()]
            frame = next((t for t in frames if t in counts and median_step(numbers[t]) == 1), None)
        timed = [t for t in growing if t not in counts] or [t for t in growing if t != frame]
        if len(timed) <= 1:
            time, left = next(iter(timed), None), left[len(growing) :]
            guessed |= {*growing}
    quality = [title for title in left if _QUALITY.search(title) and title not in named]
    others = [t for t in left if t in times or not named.get(t, not _counts(t, numbers[t]))]
    aside = [title for title in left if title in (*aside, *others) and title not in quality]
    listed = Roles(quality=quality, aside=aside, text=text, empty=empty, guessed=guessed)
    roles = replace(listed, time=time, nanoseconds=nanoseconds, frame=frame, receiver=receiver)
    _sort([title for title in left if title not in (*quality, *aside)], numbers, named, roles)
    roles.angles[:] = [by_azimuth(group) or group for group in roles.angles]
    roles.quaternions[:] = [by_scalar(group) or group for group in roles.quaternions]
    return roles


def pair_receivers(roles: Roles) -> list[tuple[list[str], list[str]]]:
    """Return pairs of position and orientation columns of each receiver; a missing one is an empty list.

    Columns are paired by the words of their titles. The remaining ones are paired by their order and marked
    as guessed, if there are as many positions as orientations and no name contradicts.
    """
    groups = roles.positions, roles.orientations[1]
    partner: dict[int, int] = {}  # orientation by position
    for ignored in (_KINDS, _KINDS + "|[ptrmo]"):
        words = [[_shared_words(titles, ignored) for titles in alike] for alike in groups]
        left = [at for at in range(len(groups[0])) if at not in partner]
        free = [at for at in range(len(groups[1])) if at not in partner.values()]
        counts = [Counter(words[0][at] for at in left), Counter(words[1][at] for at in free)]
        for at in left:
            if counts[0][words[0][at]] == counts[1][words[0][at]] == 1:
                partner[at] = next(other for other in free if words[1][other] == words[0][at])
    left = [at for at in left if at not in partner]
    free = [at for at in free if at not in partner.values()]
    common = [[len({*words[0][at]} & {*words[1][other]}) for other in free] for at in left]
    if len(left) == len(free) and all(
        shared[at] == max(shared) and (shared[at] or not (words[0][left[at]] and words[1][free[at]]))
        for at, shared in enumerate(common)
    ):
        partner |= dict(zip(left, free, strict=True))
        roles.guessed.update(title for at in left for title in groups[0][at] + groups[1][partner[at]])
    pairs = [(titles, groups[1][partner[at]] if at in partner else []) for at, titles in enumerate(groups[0])]
    return pairs + [([], titles) for at, titles in enumerate(groups[1]) if at not in partner.values()]


_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+|[^\W0-9_A-Za-z]+")
_KINDS = (
    "pos(ition)?|loc(ation)?|trans(lation)?|rot(ation)?|q(uat(ernion)?)?|ori(entation)?|att(itude)?|euler"
    "|ang(le)?|mat(rix)?|number"
)
"""Words for positions and orientations in titles; ignored when titles are paired."""


def _shared_words(titles: Sequence[str], ignored: str) -> tuple[str, ...]:
    """Return the words, in lower case, that all of a receiver's titles share, or else their common prefix."""
    names = [split_title(title).name for title in titles]
    every = (Counter(word.lower() for word in _WORD.findall(name)) for name in names)
    begins = os.path.commonprefix(names).lower().rstrip("q")  # noqa: RUF071 : letters, as of handx and handqx
    shared = functools.reduce(operator.and_, every) or Counter([begins])
    return tuple(sorted(word for word in shared.elements() if not re.fullmatch(f"({ignored})?", word)))


def _counts(title: str, values: Array) -> bool:
    """Return whether a column increases in every row, or has a name and is one whole number throughout."""
    still = np.ptp(values) == 0 and values[0] == np.floor(values[0]) and not title.startswith("number ")
    return len(values) >= _MANY_ROWS and bool(still or (np.diff(values) > 0).all())


def _spell_title(title: str, names: Iterable[str]) -> Title:
    """Split a title into name and unit, with q0 to q3 renamed qw, qx, qy and qz if the receiver has a q0."""
    name, unit = split_title(title)
    if match := _SCALAR_FIRST.search(name):
        at = match.start("digit")
        if (name[:at] + "0" + name[at + 1 :]).lower() in names:
            name = name[:at] + "wxyz"[int(name[at])] + name[at + 1 :]
    return Title(name, unit)


def _named_groups(titles: Sequence[str], numbers: Mapping[str, Array]) -> dict[str, list[str]]:
    """Group titles that differ only in their axis; return title -> its group in the order of the table.

    w, x, y, z form a group only if their norm is 1 in all complete rows. Columns that are named like a
    quaternion but are not one have an empty group.
    """
    alike: dict[tuple[str, str, str], dict[str, str]] = {}
    spellings = {split_title(title).name.lower() for title in titles}
    for title in titles:
        name, unit = _spell_title(title, spellings)
        if match := _axis_in(name):
            axes = alike.setdefault((match["before"].lower(), match["after"].lower(), unit), {})
            axes.setdefault(match["axis"][0].lower(), title)
    groups: dict[str, list[str]] = {}
    for (before, _, _), axes in alike.items():
        for names in _NAMED_GROUPS:
            group = [title for axis, title in axes.items() if axis in names]
            if len(group) < len(names) or group[0] in groups:
                continue
            off = _off_rotation(group, numbers, 4) if len(names) == 4 else 0.0
            if off < _NORM_OFF or off == np.inf or re.search(r"q(uat\w*)?[\W_]*$", before):
                groups |= dict.fromkeys(group, group if off < _NORM_OFF or off == np.inf else [])
    return groups


def _sort(
    free: Sequence[str], numbers: Mapping[str, Array], named: Mapping[str, list[str]], roles: Roles
) -> None:
    """Group columns into `roles`: rotations by their numbers, then by names, the remaining ones by threes."""
    run: list[str] = []
    while free:
        group = named.get(free[0], [])
        sizes = [n for n in (9, 4) if _is_rotation(free, numbers, n)]
        # a rotation must not split a named group
        size = next((n for n in sizes if all({*named.get(t, ())} <= {*free[:n]} for t in free[:n])), 0)
        taken = list(free[:size]) or (group if {*group} <= {*free} else [])
        if not taken:
            run.append(free[0])
            free = free[1:]
            continue
        _sort_triples(run, numbers, roles)
        run = []
        triples = roles.angles if _named_angles(taken) else roles.positions
        {9: roles.matrices, 4: roles.quaternions, 3: triples}[len(taken)].append(taken)
        free = [title for title in free if title not in taken]
    _sort_triples(run, numbers, roles)


def _named_angles(titles: Sequence[str]) -> bool:
    names, units = zip(*map(split_title, titles), strict=True)
    angular = any(unit in _ANGLES for unit in units)
    if angular or any(unit in MM_PER_UNIT for unit in units):
        return angular
    return bool(by_azimuth(titles)) or sum(bool(_ANGLE.search(name)) for name in names) >= 2


def by_azimuth(titles: Sequence[str]) -> list[str]:
    """Return titles in the order azimuth, elevation, roll, or an empty list for other angles."""
    return _by_axis(titles, "aer")


def by_scalar(titles: Sequence[str]) -> list[str]:
    """Return titles in the order w, x, y, z, or an empty list if titles do not name these."""
    return _by_axis(titles, "wxyz")


def _by_axis(titles: Sequence[str], axes: str) -> list[str]:
    spellings = {split_title(title).name.lower() for title in titles}
    named = {_spell_title(title, spellings).name: title for title in titles}
    by_axis = {match["axis"][0].lower(): named[name] for name in named if (match := _axis_in(name))}
    return [by_axis[axis] for axis in axes] if by_axis.keys() == {*axes} else []


def _grows(values: Array, starts: Iterable[Bools]) -> bool:
    """Return whether numbers (N,) never go back, or exactly where a receiver's rows may start.

    starts : for each column that may name receivers, whether its name changes after each row, (N - 1,).
    """
    steps = np.diff(values[np.isfinite(values)])
    back = steps < 0
    anew = back.any() and any(np.array_equal(back, changes) for changes in starts)
    return bool((steps > 0).any()) and (anew or not back.any())


def _take_turns(codes: Integers, clock: Array) -> bool:
    """Return whether codes (N,) of names are of receivers that take turns, or change as the clock goes back.

    clock : times or frames, shape (N,), or none.
    """
    n_names, steps = len(np.unique(codes)), np.diff(codes)
    if not 2 <= n_names <= min(_MOST_STATION, len(codes) / 2):
        return False
    in_turn = np.mean(steps % n_names == 1) > _NORM_SHARE
    return bool(in_turn or (np.ptp(clock) > 0 and np.array_equal(np.diff(clock) < 0, steps != 0)))


def _few_wholes(values: Array) -> bool:
    return 2 <= len(np.unique(values)) <= 64 and bool((values == np.floor(values)).all())


def _is_rotation(free: Sequence[str], numbers: Mapping[str, Array], size: int) -> bool:
    """Return whether the next columns are a rotation, and closer to one than groups that start later.

    The comparison is needed because a small z in metres followed by three numbers of a quaternion may have
    norm 1, too, if the quaternion's last number is small.
    """
    off = _off_rotation(free[:size], numbers, size)
    later = (_off_rotation(free[start : start + size], numbers, size) for start in range(1, size))
    return off < _NORM_OFF and off <= min(later)


def _off_rotation(titles: Sequence[str], numbers: Mapping[str, Array], size: int) -> float:
    """Return how far most rows deviate from norm 1 (size 4) or a rotation (size 9); inf without such rows."""
    if len(titles) < size:
        return float("inf")
    rows = np.stack([numbers[title] for title in titles], -1)
    rows = rows[np.isfinite(rows).all(-1) & rows.any(-1)]
    if not len(rows):
        return float("inf")
    if size == 4:
        off = np.abs(np.linalg.norm(rows, axis=-1) - 1)
    else:
        m = rows.reshape(-1, 3, 3)
        off = np.abs(m @ np.swapaxes(m, 1, 2) - np.eye(3)).max((1, 2))
    return float(np.quantile(off, _NORM_SHARE))


def _sort_triples(run: Sequence[str], numbers: Mapping[str, Array], roles: Roles) -> None:
    """Split columns into threes: angles if named so, or unnamed ones behind a position without angles."""
    whole = len(run) - len(run) % 3
    roles.aside.extend(run[whole:])
    for triple in (list(run[start : start + 3]) for start in range(0, whole, 3)):
        named = _named_angles(triple)
        unnamed = all(title.startswith("number ") for title in triple)
        second = unnamed and len(roles.positions) > len(roles.angles)
        second &= bool(np.nanmax(np.abs([numbers[t] for t in triple])) <= 360)
        (roles.angles if named or second else roles.positions).append(triple)
        if not named:
            roles.guessed.update(triple)


STATED = "as the columns' titles say"
LEAST_HZ, MOST_HZ = 1.0, 5000.0
"""Plausible frame rates of any tracker, Hz."""
_DATES_S = (9e8, 4.2e9)
"""Plausible dates of a recording, in seconds since 1970."""
TWO_PI = 2 * np.pi + 0.01


class Unit(NamedTuple):
    """A unit for the mapping, or CHECK; the reason, for a comment; evidence against the titles' unit."""

    unit: str
    why: str
    doubt: str = ""

    @property
    def stated(self) -> str:
        """The unit that titles state and numbers do not contradict, or ""."""
        return self.unit if self.why == STATED else ""


class Units(NamedTuple):
    """The units of a table's columns."""

    position: Unit
    angle: Unit
    time: Unit


def find_units(roles: Roles, numbers: Mapping[str, Array]) -> Units:
    """Infer the units of columns with these roles; numbers : title -> (N,)."""
    position, angle = _position_unit(roles.positions, numbers), _angle_unit(roles.angles, numbers)
    return Units(position, angle, _time_unit(roles.time, numbers) if roles.time else Unit(CHECK, ""))


def _position_unit(groups: Iterable[Sequence[str]], numbers: Mapping[str, Array]) -> Unit:
    """Infer the unit of positions from all their titles together."""
    titles = [title for group in groups for title in group]
    span = max((float(np.ptp(values)) for values in _finite(titles, numbers)), default=0.0)
    why = "mm, cm, m or inch" + (f"; positions span {span:.3g} in this unit" if titles else "")
    units = _stated_units(titles, MM_PER_UNIT)
    if span and len(units) == 1 and units[0]:
        would_be = extent(span * MM_PER_UNIT[units[0]])
        if would_be in IMPOSSIBLE_EXTENTS:
            doubt = f"the titles of positions state {units[0]}, in which their span is {would_be}"
            return _doubt_unit(why, doubt)
    return _settle_unit(units, why, "positions")


def _angle_unit(groups: Iterable[Sequence[str]], numbers: Mapping[str, Array]) -> Unit:
    """Infer the unit of angles from all their titles together, or else from the largest angle."""
    titles = [title for group in groups for title in group]
    by_size = angle_unit_by_size(titles, numbers)
    units = _stated_units(titles, _ANGLES)
    if by_size.unit == "deg" and "rad" not in units:
        return Unit("deg", STATED if units == ["deg"] else by_size.why)
    if units == ["deg"] or (units == ["rad"] and by_size.unit == "deg"):
        doubt = f"the titles of angles state {units[0]}; they look like {by_size.why}"
        return _doubt_unit("deg or rad", doubt)
    return _settle_unit(units, f"deg or rad; {by_size.why}", "angles")


def angle_unit_by_size(titles: Iterable[str], numbers: Mapping[str, Array]) -> Unit:
    """Infer the unit of angles from the largest of them alone."""
    largest = max((float(np.abs(values).max()) for values in _finite(titles, numbers)), default=0.0)
    if largest > TWO_PI:
        return Unit("deg", f"degrees, as {largest:.4g} is more than two pi")
    return Unit(CHECK, "radians, or degrees of very small turns")


def _time_unit(title: str, numbers: Mapping[str, Array]) -> Unit:
    """Infer the unit of times from the title, or else from numbers that are plausible dates."""
    times, unit = numbers[title], split_title(title).unit
    why = rate_line("s, ms, us or ns", times, SECONDS_PER_UNIT)
    step = median_step(times)
    if unit not in _TIMES:
        for name, seconds in SECONDS_PER_UNIT.items():
            date = _DATES_S[0] < np.nanmedian(times) * seconds < _DATES_S[1]
            if date and step and LEAST_HZ <= 1 / (step * seconds) <= MOST_HZ:
                return Unit(name, "as its numbers are then dates, counted from 1970")
        return Unit(CHECK, why)
    rate_hz = None if step is None else 1 / (step * SECONDS_PER_UNIT[unit])
    if rate_hz is None or LEAST_HZ <= rate_hz <= MOST_HZ:
        return Unit(unit, STATED)
    return _doubt_unit(why, f"the title {title} states {unit}, in which the rate is {rate_hz:.4g} Hz")


_TRACKERS_HZ = 5, 2000
"""Range of trackers' frame rates, Hz."""


def time_unit_of_tracker(unit: Unit, time: Array) -> Unit:
    """Return the only unit in which the times have a tracker's frame rate; the given unit if ambiguous."""
    step = median_step(time)
    hz = {} if step is None else {name: 1 / (step * seconds) for name, seconds in SECONDS_PER_UNIT.items()}
    meant = [name for name, rate in hz.items() if _TRACKERS_HZ[0] < rate < _TRACKERS_HZ[1]]
    if len(meant) != 1:
        return unit
    return Unit(meant[0], f"{hz[meant[0]]:.4g} Hz; no tracker has the rate in any other unit")


def _finite(titles: Iterable[str], numbers: Mapping[str, Array]) -> Iterator[Array]:
    for title in titles:
        if (values := numbers[title][np.isfinite(numbers[title])]).size:
            yield values


def _stated_units(titles: Iterable[str], units: Collection[str]) -> list[str]:
    """Return the distinct units of one kind in titles, with "" for titles without one."""
    every = (split_title(title).unit for title in titles)
    return list(dict.fromkeys(unit if unit in units else "" for unit in every))


def _settle_unit(units: Sequence[str], why: str, what: str) -> Unit:
    """Return the unit that all titles state; raise a doubt if only some do or if they differ."""
    stated = [unit for unit in units if unit]
    if len(units) == 1 and stated:
        return Unit(units[0], STATED)
    if not stated:
        return Unit(CHECK, why)
    others = ", others none" if "" in units else ""
    return _doubt_unit(why, f"titles of {what} state {' and '.join(stated)}{others}")


def _doubt_unit(why: str, doubt: str) -> Unit:
    return Unit(CHECK, f"{why}; {doubt}", doubt)
