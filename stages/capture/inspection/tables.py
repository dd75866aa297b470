"""Tables as text: what their columns seem to be, why, and the mapping that would read them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kinematics.rotations import Array
from schemas.errors import InputError
from schemas.layout import Layout
from stages.capture.formats.text_table import TextColumns, open_text, read_columns
from stages.capture.inspection.columns import Roles, find_roles
from stages.capture.inspection.findings import CHECK, Findings, comment, extent_line, heading, rate_line
from stages.capture.inspection.sniff import Dress, sniff

TIME_UNITS = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6))

GUESSED = f"{CHECK}: guessed from the place in the table; are these the right columns?"

REPEATED_SHARE = 0.2
"""More rows than this that repeat the one before, and receivers are not in step with the rows."""


def look_at_table(path: Path, layout: Layout) -> Findings:
    """Say what the columns of a table seem to be. Raises InputError where the text is no table."""
    dress = sniff(path)
    text = open_text(path, dress.config())
    columns = read_columns(text, text.titles)
    numbers = _numbers(columns, text.titles)
    roles = find_roles(text.titles, numbers)
    lines = [f"a table as text: {columns.rows} rows, {len(text.titles)} columns; {dress.words()}"]
    if roles.time:
        lines.append(rate_line(f"time column {roles.time}", numbers[roles.time], TIME_UNITS))
    lines += [f"frame column {roles.frame}: {_range(numbers[roles.frame])}"] if roles.frame else []
    values: list[str] = []
    if roles.receiver:
        values = _values(columns, roles.receiver)
        lines.append(
            f"receiver column {roles.receiver}: one row a receiver and frame; it has {', '.join(values)}"
        )
    lines += _orientation_lines(roles, numbers)
    lines += [
        extent_line(f"position {' '.join(group)}", np.stack([numbers[title] for title in group], -1))
        for group in roles.positions
    ]
    lines += [f"other numbers: {', '.join(roles.aside)} (quality?)"] if roles.aside else []
    lines += [f"text: {', '.join(roles.text)}"] if roles.text else []
    repeated = 0.0 if roles.receiver else _repeats(roles, numbers, lines)
    if roles.orientations[1] and not roles.positions:
        lines.append("no positions were found")
    if roles.positions and not roles.orientations[1]:
        lines.append("no orientations were found: a joint cannot be found from positions alone")
    return Findings(tuple(lines), _draft(path, dress, roles, numbers, values, repeated, layout))


def _numbers(columns: TextColumns, titles: Sequence[str]) -> dict[str, Array]:
    found = {}
    for title in titles:
        try:
            values = columns.reals(title)
        except InputError:
            continue
        if np.isfinite(values).any():
            found[title] = values
    return found


def _values(columns: TextColumns, title: str) -> list[str]:
    return sorted(columns.words(title)[1], key=lambda word: (len(word), word))


def _range(values: Array) -> str:
    return f"{np.nanmin(values):g} to {np.nanmax(values):g}"


def _orientation_lines(roles: Roles, numbers: Mapping[str, Array]) -> list[str]:
    lines = []
    for group in roles.quaternions:
        rows = np.stack([numbers[title] for title in group], -1)
        first, last = (float(np.nanmedian(np.abs(rows[:, i]))) for i in (0, 3))
        norm = float(np.nanmedian(np.linalg.norm(rows, axis=-1)))
        likelier = "wxyz" if first > last else "xyzw"
        lines.append(
            f"quaternion {' '.join(group)}: median norm {norm:.5f}; its first number is {first:.2f} in the "
            f"median, its last {last:.2f}, so {likelier} is likelier if receivers lie "
            "roughly as the transmitter does; the numbers cannot prove it"
        )
    lines += [f"matrix {' '.join(group)}: nine numbers of a rotation" for group in roles.matrices]
    for group in roles.angles:
        rows = np.stack([numbers[title] for title in group], -1)
        ranges = ", ".join(f"{title} {_range(numbers[title])}" for title in group)
        lines.append(f"angles: {ranges}; {_angle_unit(rows)[1]}")
    return lines


def _angle_unit(angles: Array) -> tuple[str, str]:
    largest = float(np.nanmax(np.abs(angles)))
    if largest > 2 * np.pi + 0.01:
        return "deg", f"degrees, as {largest:.4g} is more than two pi"
    return CHECK, "radians, or degrees of very small turns"


def _repeats(roles: Roles, numbers: Mapping[str, Array], lines: list[str]) -> float:
    """Largest share of rows in which a receiver's numbers are those of the row before."""
    worst = 0.0
    for group in roles.orientations[1] or roles.positions:
        rows = np.stack([numbers[title] for title in group], -1)
        share = float(np.mean((rows[1:] == rows[:-1]).all(-1))) if len(rows) > 1 else 0.0
        worst = max(worst, share)
        if share > REPEATED_SHARE:
            new = 1 + round((1 - share) * (len(rows) - 1))
            told = f"{' '.join(group)}: {share:.0%} of the rows repeat the one before ({new} new values)"
            lines.append(f"{told}: receivers are not in step with the rows, or did not move")
        zeros = int((rows == 0).all(-1).sum())
        lines += (
            [f"{' '.join(group)}: {zeros} rows are all zeros; zeros may stand for 'no value'"]
            if zeros
            else []
        )
    return worst


def _draft(
    path: Path,
    dress: Dress,
    roles: Roles,
    numbers: Mapping[str, Array],
    values: Sequence[str],
    repeated: float,
    layout: Layout,
) -> str:
    spans = [
        max(np.nanmax(numbers[title]) - np.nanmin(numbers[title]) for title in group)
        for group in roles.positions
    ]
    why = f"mm, cm, m or inch; positions span {max(spans):.3g} of it" if spans else "mm, cm, m or inch"
    asynchronous = repeated > REPEATED_SHARE and roles.time is not None
    lines = [
        heading(path),
        "format: csv",
        comment(f"position_unit: {CHECK}", why),
    ]
    if asynchronous:
        lines.append(
            comment(f"rate_hz: {CHECK}", "the tracker's own rate: the grid that new values are put on")
        )
    elif roles.time is None:
        lines.append(comment(f"rate_hz: {CHECK}", "frames a second; leave the line out where nobody knows"))
    lines += _draft_orientation(roles, numbers)
    lines.append(comment("receivers:", f"by segment of layout {layout.name}: {', '.join(layout.measured)}"))
    lines += _draft_receivers(roles, values, layout) or [f"  {CHECK}: {{}}"]
    return "\n".join([*lines, *_draft_table(dress, roles, numbers, asynchronous)]) + "\n"


def _draft_orientation(roles: Roles, numbers: Mapping[str, Array]) -> list[str]:
    kind, groups = roles.orientations
    lines = ["orientation:", f"  kind: {kind if groups else CHECK}"]
    if kind == "quaternion" and groups:
        lines.append(
            comment(f"  order: {CHECK}", f"wxyz or xyzw: which of {' '.join(groups[0])} is the scalar?")
        )
    if kind == "euler" and groups:
        angle_unit, why = _angle_unit(np.stack([numbers[title] for group in groups for title in group], -1))
        lines.append(
            comment(f"  axes: {CHECK}", f"of {' '.join(groups[0])}; ZYX for azimuth, elevation, roll")
        )
        lines.append(comment(f"  unit: {angle_unit}", why if angle_unit != CHECK else f"deg or rad; {why}"))
    return [*lines, comment(f"  rotates: {CHECK}", "receiver-to-transmitter, or transmitter-to-receiver")]


def _draft_receivers(roles: Roles, values: Sequence[str], layout: Layout) -> list[str]:
    if roles.receiver:
        return [f"  {_segment(value, layout)}: {{value: {json.dumps(value)}}}" for value in values]
    orientations = roles.orientations[1]
    lines = []
    for index, position in enumerate(roles.positions):
        turned = _columns(orientations[index]) if index < len(orientations) else f"[{CHECK}]"
        guessed = position + (orientations[index] if index < len(orientations) else [])
        line = f"  {CHECK}_{index + 1}: {{position: {_columns(position)}, orientation: {turned}}}"
        lines.append(comment(line, _doubt(roles, guessed)))
    return lines


def _doubt(roles: Roles, titles: Sequence[str]) -> str:
    return "" if roles.guessed.isdisjoint(titles) else GUESSED


def _segment(value: str, layout: Layout) -> str:
    """The value itself where it is a segment's name, or else a name that no layout has."""
    if value in layout.measured:
        return value
    return f"{CHECK}_{''.join(c if c.isalnum() else '_' for c in value)}"


def _columns(titles: Sequence[str]) -> str:
    return f"[{', '.join(_column(title) for title in titles)}]"


def _column(title: str) -> str:
    return (
        title.removeprefix("number ")
        if title.startswith("number ")
        else json.dumps(title, ensure_ascii=False)
    )


def _draft_table(dress: Dress, roles: Roles, numbers: Mapping[str, Array], asynchronous: bool) -> list[str]:
    lines = [
        "csv:",
        f"  rows: {'long' if roles.receiver else 'wide'}",
        f"  delimiter: {json.dumps(dress.delimiter)}",
    ]
    lines.append(f"  decimal: {json.dumps(dress.decimal)}")
    lines.append(f"  header: {json.dumps(dress.header)}")
    lines += [f"  comment: {json.dumps(dress.comment)}"] if dress.comment else []
    lines += [f"  skip_lines: {dress.skip_lines}"] if dress.skip_lines else []
    if roles.time:
        lines.append(comment(f"  time: {_column(roles.time)}", _doubt(roles, [roles.time])))
        lines.append(
            comment(f"  time_unit: {CHECK}", rate_line("s, ms or us", numbers[roles.time], TIME_UNITS))
        )
    if roles.frame and not asynchronous:
        lines.append(f"  frame: {_column(roles.frame)}")
    if asynchronous:
        lines.append(comment("  in_step: false", "old values are repeated: each new one is kept once"))
    if roles.receiver:
        turned = roles.orientations[1]
        lines.append(f"  receiver: {_column(roles.receiver)}")
        for key, groups in (("position", roles.positions), ("orientation", turned)):
            line = f"  {key}: {_columns(groups[0]) if groups else f'[{CHECK}]'}"
            lines.append(comment(line, _doubt(roles, groups[0] if groups else [])))
    return lines
