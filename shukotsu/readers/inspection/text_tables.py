"""Describe text tables: presumed columns, with reasons, and a mapping that would read them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError, count_of
from shukotsu.readers.formats.cells import DATES, Cells, unwrapped_s
from shukotsu.readers.formats.mapped import snake_case, without_marks
from shukotsu.readers.formats.mapped_csv import TIME_OF_DAY
from shukotsu.readers.formats.text_table import open_table_text, open_tidy_csv, tables_of
from shukotsu.readers.formats.tidy import wanted_columns
from shukotsu.readers.inspection import column_roles
from shukotsu.readers.inspection.column_roles import Roles, Unit, Units
from shukotsu.readers.inspection.description import CHECK, Description, draft, extent_line, rate_line
from shukotsu.readers.inspection.text_form import TextForm, detect_form
from shukotsu.readers.inspection.tidy_files import describe_tidy, is_tidy
from shukotsu.study.layout import Layout
from shukotsu.tables.limits import MM_PER_UNIT, SECONDS_PER_UNIT, UNIT_NAMES
from shukotsu.tables.text_files import open_text

GUESSED = f"{CHECK}: guessed from the place in the table; are these the right columns?"
_JOINT_ANGLE = re.compile(r"flex|spread|abduct|extension", re.I)
FORWARD, BACKWARD = "receiver-to-transmitter", "transmitter-to-receiver"
MOST_LINES = 16
"""With more receivers than this, positions and angles are each summarised in one line."""
_NEAREST_MM = 30.0
"""Usual distance of neighbouring receivers on a hand with one per phalanx."""
REPEATED_SHARE = 0.2
"""Share of rows that repeat the previous one, above which receivers are not in step with the rows."""


@dataclass(frozen=True)
class _ReadTable:
    """Columns of a table that were read.

    numbers : title -> (N,). time_units : title -> `time_unit` of columns with times of day or dates.
    receivers : names in the receiver column if the table has one row per receiver and frame.
    """

    n_rows: int
    numbers: Mapping[str, Array]
    time_units: Mapping[str, str]
    roles: Roles
    receivers: Sequence[str]


def describe_table(path: Path, layout: Layout) -> Description:
    """Describe every table of a text, and draft a mapping of the first one with orientations.

    Raises InputError if no table can be read.
    """
    tables = tables_of(path)
    if len(tables) == 1:
        return _describe(path, layout, detect_form(path, tables[0]))
    lines, drafts = [], list[tuple[int, str]]()
    for number, data in enumerate(tables, 1):
        title = data.lstrip().split(b"\n", 1)[0].decode("utf-8", "replace").strip(" ,;\t")
        lines.append(f"table {number} of {len(tables)}, under {title!r}:")
        try:
            form = replace(detect_form(path, data), table=number)
            description = _describe(path, layout, form)
            drafts.append((number, description.draft))
            lines += [f"  {line}" for line in description.lines]
        except InputError as error:
            if number == len(tables) and not drafts:
                raise
            lines.append(f"  {error}")
    number, drafted = max(drafts, key=lambda each: ("\norientation:" in each[1], -each[0]))
    lines.append(f"the mapping is for table {number}; csv.table in it states which")
    return Description(tuple(lines), drafted)


@np.errstate(over="ignore", invalid="ignore")  # infinite numbers are reported as such
def _describe(path: Path, layout: Layout, form: TextForm) -> Description:
    """Describe the presumed columns of a table. Raises InputError if the text is not a table."""
    text = open_table_text(path, {"skip_lines": 0, "missing": [], **form.config()})
    table = _read_columns(text.cells(text.titles))
    roles = table.roles
    joint_angles = [title for title in text.titles if _JOINT_ANGLE.search(title)]
    if len(joint_angles) > 2 and not roles.orientations[1]:
        raise InputError(
            f"{path}: has joint angles ({', '.join(joint_angles[:3])} and so on), from which receiver poses "
            "cannot be computed; export positions and orientations"
        )
    units = column_roles.find_units(roles, table.numbers)
    before = re.search(r"\bunits?\W+(\w+)", form.before, re.I)
    if before and units.position.unit == CHECK and (unit := UNIT_NAMES.get(before[1].lower())):
        units = units._replace(position=Unit(unit, "as the lines before the table say"))
    size = f"{count_of(table.n_rows, 'row')}, {count_of(len(text.titles), 'column')}"
    lines = [f"a table as text: {size}; {form.sentence()}"]
    lines += filter(None, [text.cut_off(text.titles)])
    lines += _column_lines(table, units)
    repeated = 0.0 if roles.receiver else _repeats(roles, table.numbers, lines)
    if roles.orientations[1] and not roles.positions:
        lines.append("no positions were found")
    if roles.positions and not roles.orientations[1]:
        lines.append("no orientations were found, which receivers need")
    asynchronous = repeated > REPEATED_SHARE and roles.time is not None
    pairs = [] if roles.receiver else column_roles.pair_receivers(roles)
    remarks = _remarks(roles, pairs)
    whole = [pair for pair in pairs if all(pair) or not roles.orientations[1]]
    drafted = _receivers(roles, table.receivers, whole, layout)
    of_stations = _by_station(drafted, layout)
    if of_stations and roles.time and units.time.unit == CHECK:
        units = units._replace(time=column_roles.time_unit_of_tracker(units.time, table.numbers[roles.time]))
    config = _draft_config(table, units, of_stations or (drafted,), layout, asynchronous)
    config["csv"] = _csv(form, roles, units.time, asynchronous)
    if time_unit := table.time_units.get(roles.time or ""):
        config["csv"]["time_unit"] = time_unit
    return Description(tuple(lines + remarks), draft(path, config, (f"# {line}" for line in remarks)))


def _read_columns(cells: Cells) -> _ReadTable:
    """Read each column as numbers, times of day or dates, depending on its cells."""
    numbers = _numbers(lambda title: without_marks(cells.reals(title)), cells.names)
    texts = [title for title in cells.names if title not in numbers]
    if not any(np.isfinite(values).any() for values in numbers.values()):
        cells.reals(cells.names[0])  # raises the error that names the cell
    of_day = _numbers(lambda title: unwrapped_s(cells.times_of_day_s(title)), texts)
    dates = _numbers(lambda title: cells.times_s(title, DATES), [t for t in texts if t not in of_day])
    numbers |= of_day | dates
    time_units = dict.fromkeys(of_day, TIME_OF_DAY) | dict.fromkeys(dates, DATES)
    words: dict[str, Integers] = {}
    for title in texts:
        if title not in numbers:
            with suppress(InputError):  # an empty cell
                words[title] = cells.names_in(title)[0]
    roles = column_roles.find_roles(cells.names, numbers, words, [*time_units])
    if roles.time and roles.nanoseconds:
        numbers[roles.time] = numbers[roles.time] + 1e-9 * numbers[roles.nanoseconds]
    names = cells.names_in(roles.receiver)[1] if roles.receiver else []
    receivers = sorted(names, key=int) if all(map(str.isdecimal, names)) else names
    return _ReadTable(cells.rows, numbers, time_units, roles, receivers)


def _column_lines(table: _ReadTable, units: Units) -> list[str]:
    """Return a line for each column or group of columns: its role and the range of its numbers."""
    roles, numbers, lines = table.roles, table.numbers, []
    if roles.time:
        stated = units.time.stated
        meant = ([stated], "as its title says") if stated else (SECONDS_PER_UNIT, "")
        and_nanoseconds = f" and {roles.nanoseconds}" if roles.nanoseconds else ""
        lines.append(rate_line(f"time column {roles.time}{and_nanoseconds}", numbers[roles.time], *meant))
    lines += [f"frame column {roles.frame}: {_range(numbers[roles.frame])}"] if roles.frame else []
    if roles.receiver:
        names = ", ".join(table.receivers)
        lines.append(f"receiver column {roles.receiver}: one row a receiver and frame; it has {names}")
    lines += _orientation_lines(roles, numbers, units.angle)
    stated = units.position.stated
    if len(roles.positions) > MOST_LINES:  # summarise all receivers in one line
        spans = [np.nanmax(np.ptp(_rows(numbers, group), axis=0), initial=0) for group in roles.positions]
        widest = roles.positions[int(np.argmax(spans))]
        what = f"positions of {count_of(len(roles.positions), 'receiver')}, the widest {' '.join(widest)}"
        lines.append(extent_line(what, _rows(numbers, widest), stated))
    else:
        lines += [extent_line(f"position {' '.join(g)}", _rows(numbers, g), stated) for g in roles.positions]
    lines += [f"unit in doubt: {unit.doubt}" for unit in units if unit.doubt]
    lines += [f"quality {title}: {_range(numbers[title])}" for title in roles.quality]
    lines += [f"other numbers: {', '.join(roles.aside)} (quality?)"] if roles.aside else []
    return lines + ([f"text: {', '.join(roles.text)}"] if roles.text else [])


def _remarks(roles: Roles, pairs: Sequence[tuple[list[str], list[str]]]) -> list[str]:
    """Return remarks on columns that the mapping leaves out: empty ones, and groups without a counterpart."""
    remarks = [f"empty: {', '.join(roles.empty)}"] if roles.empty else []
    return remarks + [
        f"{' '.join(position + turning)}: no {'orientation' if position else 'position'} matches it by "
        "name; it is left out of the mapping"
        for position, turning in pairs
        if not (position and turning) and roles.orientations[1] and roles.positions
    ]


def _draft_config(
    table: _ReadTable, units: Units, of_hands: Sequence[Mapping[str, Any]], layout: Layout, asynchronous: bool
) -> dict[str, Any]:
    """Return the drafted mapping without its `csv` group; of_hands : receivers, or right and left ones."""
    roles = table.roles
    config: dict[str, Any] = {"format": "csv", "position_unit": units.position[:2]}
    if asynchronous:
        config["rate_hz"] = (CHECK, "the tracker's own rate: the grid that new values are put on")
    elif roles.time is None:
        config["rate_hz"] = (CHECK, "frames per second; delete the line if unknown")
    if units.position.unit == CHECK and len(roles.positions) > 3:
        near = _nearest(np.stack([_rows(table.numbers, group) for group in roles.positions], 1))
        config["position_unit"] = (CHECK, f"{units.position.why}{near}")
    if roles.orientations[1] or not roles.positions:
        config["orientation"] = _orientation(roles, units.angle)
    named = f"by segment of layout {layout.name}: {', '.join(layout.measured)}"
    if len(of_hands) > 1:
        named = f"{CHECK}: in the order of stations of layout {layout.name}; correct? The checks test it"
    config["receivers"] = (of_hands[0] or {CHECK: {}}, named)
    left = next(iter(of_hands[1:]), {})
    return config | ({"left_receivers": (left, "those after the right hand's")} if left else {})


def _numbers(read: Callable[[str], Array], titles: Sequence[str]) -> dict[str, Array]:
    """Return the columns that `read` converts without an error, title -> (N,)."""
    numbers = {}
    for title in titles:
        with suppress(InputError):
            numbers[title] = read(title)
    return numbers


def _rows(numbers: Mapping[str, Array], titles: Sequence[str]) -> Array:
    """Return the named columns as an array, shape (N, len(titles))."""
    return np.stack([numbers[title] for title in titles], -1)


def _range(values: Array) -> str:
    return f"{np.nanmin(values):g} to {np.nanmax(values):g}"


def _orientation_lines(roles: Roles, numbers: Mapping[str, Array], angle: Unit) -> list[str]:
    lines = []
    for group in filter({*roles.empty}.isdisjoint, roles.quaternions):
        rows = _rows(numbers, group)
        first, last = (float(np.nanmedian(np.abs(rows[:, i]))) for i in (0, 3))
        norm = float(np.nanmedian(np.linalg.norm(rows, axis=-1)))
        likelier = "wxyz" if first > last else "xyzw"
        order = (
            f"its first number is {first:.2f} in the median, its last {last:.2f}, so {likelier} is likelier "
            "if receivers are oriented roughly as the transmitter; the numbers cannot prove it"
        )
        order = "w, x, y and z as its titles say" if column_roles.by_scalar(group) else order
        lines.append(f"quaternion {' '.join(group)}: median norm {norm:.5f}; {order}")
    lines += [f"matrix {' '.join(group)}: nine numbers of a rotation" for group in roles.matrices]
    angles = roles.angles[:: len(roles.angles) if len(roles.angles) > MOST_LINES else 1]
    for group in filter({*roles.empty}.isdisjoint, angles):
        ranges = ", ".join(f"{title} {_range(numbers[title])}" for title in group)
        stated = f"in {angle.stated}, as their titles say"
        seem = stated if angle.stated else column_roles.angle_unit_by_size(group, numbers).why
        named = "azimuth, elevation and roll, " if column_roles.by_azimuth(group) else ""
        more = f"; so have {len(roles.angles) - 1} more receivers" if len(roles.angles) > MOST_LINES else ""
        lines.append(f"angles: {ranges}; {named}{seem}{more}")
    return lines


def _repeats(roles: Roles, numbers: Mapping[str, Array], lines: list[str]) -> float:
    """Return the largest share of rows in which a receiver repeats the previous row; append to lines."""
    worst = 0.0
    for group in roles.orientations[1] or roles.positions:
        rows, name = _rows(numbers, group), " ".join(group)
        share = float(np.mean((rows[1:] == rows[:-1]).all(-1))) if len(rows) > 1 else 0.0
        worst = max(worst, share)
        if share > REPEATED_SHARE:
            new = 1 + round((1 - share) * (len(rows) - 1))
            lines.append(
                f"{name}: {share:.0%} of the rows repeat the previous one ({new} new values): "
                "receivers are not in step with the rows, or did not move"
            )
        if zeros := int((rows == 0).all(-1).sum()):
            lines.append(f"{name}: {count_of(zeros, 'row', 'are')} all zeros; zeros may mean 'no value'")
    return worst


def _orientation(roles: Roles, angle: Unit) -> dict[str, Any]:
    kind, groups = roles.orientations
    rotates = (CHECK, f"{FORWARD}, or {BACKWARD}")
    config: dict[str, Any] = {"kind": kind if groups else CHECK}
    if kind == "quaternion" and groups:
        config["order"] = (CHECK, f"wxyz or xyzw: which of {' '.join(groups[0])} is the scalar?")
        if all(map(column_roles.by_scalar, groups)):
            config["order"] = ("wxyz", column_roles.STATED)
    if kind == "euler" and groups:
        about = "about which axis each turns; ZYX if they are azimuth, elevation, roll"
        config["axes"] = (CHECK, f"of {' '.join(groups[0])}: {about}")
        if all(map(column_roles.by_azimuth, groups)):
            config["axes"] = ("ZYX", "azimuth about z, elevation about y, roll about x")
            rotates = (FORWARD, "as azimuth, elevation and roll of Polhemus trackers and the trakSTAR")
        elif all(re.search(r"(^|[\W_])r[xyz](?![a-z])", title, re.I) for title in groups[0]):
            other = "rotation-vector, as Vicon Nexus writes segments: then delete axes"
            config["kind"] = (CHECK, f"euler, or {other}")
        config["unit"] = angle[:2]
    elif groups:
        rotates = (CHECK, f"{FORWARD} (Polhemus), or {BACKWARD} (trakSTAR)")
    return {**config, "rotates": rotates}


def _receivers(
    roles: Roles, receivers: Sequence[str], pairs: Sequence[tuple[list[str], list[str]]], layout: Layout
) -> dict[str, Any]:
    if roles.receiver:
        of_station = {str(layout.segments[name].receiver): name for name in layout.measured}
        stations = {name: of_station.get(name.lstrip("0")) for name in receivers}
        if roles.receiver in roles.guessed and None not in stations.values():
            doubt = f"{CHECK}: as layout {layout.name} numbers its stations; correct?"
            return {str(stations[name]): ({"value": name}, doubt) for name in receivers}
        segments = [
            _segment(name, layout, receivers) or f"{CHECK}_{n}" for n, name in enumerate(receivers, 1)
        ]
        return {s: ({"value": name}, "") for s, name in zip(segments, receivers, strict=True)}
    config: dict[str, Any] = {}
    names = [position[0] for position, _ in pairs]
    for index, (position, turning) in enumerate(pairs):
        columns: dict[str, Any] = {"position": _columns(position)}
        columns |= {"orientation": _columns(turning)} if turning else {}
        if len(roles.quality) == len(roles.positions):  # one quality column per receiver
            columns["quality"] = _column(roles.quality[roles.positions.index(position)])
        segment = _segment(names[index], layout, names) or f"{CHECK}_{index + 1}"
        config[segment] = (columns, _doubt(roles, position + turning))
    return config


def _by_station(drafted: Mapping[str, Any], layout: Layout) -> list[dict[str, Any]]:
    """Assign receivers without segment names to the layout's stations in order; return right and left ones.

    The list is empty unless the receivers are exactly one hand or two, none has a segment's name and the
    layout has stations. If each name has a distinct number, receivers are ordered by it, else by the file.
    """
    stations = {name: layout.segments[name].receiver for name in layout.measured}
    if None in stations.values() or not all(key.startswith(CHECK) for key in drafted):
        return []
    numbers = [re.findall(r"\d+", str(next(iter(entry[0].values())))) for entry in drafted.values()]
    each = [int(found[0]) for found in numbers if found and len({*found}) == 1]
    entries = [*drafted.values()]
    if len({*each}) == len(entries):
        entries = [entries[index] for index in np.argsort(each)]
    for worn in (layout.expected, layout.measured):
        ordered = sorted(worn, key=lambda name: stations[name] or 0)
        right, left = entries[: len(ordered)], entries[len(ordered) :]
        if len(right) == len(ordered) and len(left) in (0, len(ordered)):
            return [dict(zip(ordered, part, strict=False)) for part in (right, left)]
    return []


def _nearest(position: Array) -> str:
    """Describe the distance of neighbouring receivers, positions (T, R, 3), and the unit it suggests."""
    seen = position[np.isfinite(position).all((1, 2))][:1]
    if not len(seen):
        return ""
    apart = np.linalg.norm(seen[0][:, None] - seen[0], axis=-1) + np.diag(np.full(len(seen[0]), np.inf))
    near = float(np.median(apart.min(0)))
    unit = min(MM_PER_UNIT, key=lambda name: abs(np.log(max(near * MM_PER_UNIT[name], 1e-9) / _NEAREST_MM)))
    return f"; neighbouring receivers are {near:.2g} apart, which on one hand means {unit}"


def _doubt(roles: Roles, titles: Sequence[str]) -> str:
    return "" if roles.guessed.isdisjoint(titles) else GUESSED


def _segment(title: str, layout: Layout, titles: Iterable[str]) -> str:
    """Return the segment in a title such as `index_distal x_mm`, or "" if it has none or is not unique."""
    words = [f"_{snake_case(name)}_" for name in titles]
    named = [name for name in layout.measured if f"_{name}_" in f"_{snake_case(title)}_"]
    segment = max(named, key=len, default="")
    return segment if sum(f"_{segment}_" in word for word in words) == 1 else ""


def _columns(titles: Sequence[str]) -> list[int | str]:
    return [_column(title) for title in titles] or [CHECK]


def _column(title: str) -> int | str:
    number = title.removeprefix("number ")
    return int(number) if number != title else title


def _csv(form: TextForm, roles: Roles, time: Unit, asynchronous: bool) -> dict[str, Any]:
    """Return the mapping's `csv` group."""
    config: dict[str, Any] = {"rows": "long" if roles.receiver else "wide", **form.config()}
    if roles.time:
        config["time"] = (_column(roles.time), _doubt(roles, [roles.time]))
        config["time_unit"] = time[:2]
    if roles.nanoseconds:
        config["nanoseconds"] = _column(roles.nanoseconds)
    if roles.frame and not asynchronous:
        config["frame"] = (_column(roles.frame), _doubt(roles, [roles.frame]))
    if asynchronous:
        config["in_step"] = (False, "old values are repeated: each new one is kept once")
    if roles.quality and len(roles.quality) == (1 if roles.receiver else len(roles.positions)):
        config |= {"quality": _column(roles.quality[0])} if roles.receiver else {}
        config["quality_above"] = (CHECK, "the limit beyond which a pose is not used; or quality_below")
    if roles.receiver:
        config["receiver"] = (_column(roles.receiver), _doubt(roles, [roles.receiver]))
        position, turning = next(iter(roles.positions), []), next(iter(roles.orientations[1]), [])
        config["position"] = (_columns(position), _doubt(roles, position))
        if turning or not position:
            config["orientation"] = (_columns(turning), _doubt(roles, turning))
    return config


def describe_text(path: Path, layout: Layout) -> Description:
    """Describe a text file: a tidy recording if its first line has the required columns, else any table.

    Raises InputError if the text is not a table, or a cell of a tidy recording is not valid for its column.
    """
    with open_text(path) as stream:
        first = stream.readline(10_000).decode("utf-8", "replace")
    if not is_tidy([name.strip().strip('"') for name in re.split("[,\t]", first.lstrip("\ufeff"))]):
        return describe_table(path, layout)
    table = open_tidy_csv(path)
    blocks = table.blocks(wanted_columns(path, table.header))
    return describe_tidy("CSV", blocks, layout)
