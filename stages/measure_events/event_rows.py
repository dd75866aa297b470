"""Rows of the tables of strokes, of one recording under one model: all but the keys of both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from shukotsu.anatomy.recorded_movement import ERRORS, AngleSeries, RecordedMovement
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_events.strokes import Stroke
from shukotsu.stages.measure_events.struck_fingers import StruckFingers

Row = dict[str, Any]

FEWEST_STROKES = 3
"""Below this a digit has no variability and no independence."""

MEASURES = {
    "contact_speed": ("contact_speed_mm_s", "contact_speed_sd_mm_s", "mm/s"),
    "contact_speed_in_hand": ("contact_speed_in_hand_mm_s", "contact_speed_sd_mm_s", "mm/s"),
    "peak_speed_before": ("peak_speed_before_mm_s", "peak_speed_sd_mm_s", "mm/s"),
    "peak_speed_after": ("peak_speed_after_mm_s", "peak_speed_sd_mm_s", "mm/s"),
    "touch_height": ("touch_height_mm", "touch_height_sd_mm", "mm"),
    "key_down_lag": ("key_down_lag_ms", "", "ms"),
    "held": ("held_s", "", "s"),
    "interval": ("since_digit_s", "", "s"),
    "hand_displacement": ("hand_displacement_mm", "", "mm"),
    "hand_turn": ("hand_turn_deg", "", "deg"),
}
"""Measures of event_measures, and the columns of strokes and of their errors that they are means of."""


def stroke_rows(strokes: Sequence[Stroke]) -> Iterator[Row]:
    """Give rows of event_strokes."""
    for stroke in strokes:
        row = stroke.event.row
        known = {name: value for name, value in stroke.values.items() if name != "held_s"}
        yield {name: row[name] for name in ("event", "name", "onset_s", "onset_sd_ms")} | known


def angle_rows(movement: RecordedMovement, strokes: Sequence[Stroke]) -> Iterator[Row]:
    """Give rows of event_angles: the joints of each stroke's own digit."""
    of_joint = {
        joint: digit.name for digit in movement.posed.layout.digits.values() for joint in digit.joints
    }
    for series in movement.joints():
        middle_deg = float(np.nanmedian(series.angle_deg)) if np.isfinite(series.angle_deg).any() else np.nan
        least_sd = np.nan
        if series.errors_deg is not None:
            changes = series.errors_deg[:, ERRORS.index("change_sd_deg"), 0]
            least_sd = float(np.nanmin(changes)) if np.isfinite(changes).any() else np.nan
        for stroke in strokes:
            if stroke.digit == of_joint[series.joint] and np.isfinite(stroke.way[0]):
                columns = _angle_in(movement, series, stroke, middle_deg, least_sd)
                if columns:
                    yield {
                        "event": stroke.event.number,
                        "joint": series.joint,
                        "angle": series.angle,
                    } | columns


def _angle_in(
    movement: RecordedMovement, series: AngleSeries, stroke: Stroke, middle_deg: float, frame_sd: float
) -> Row:
    """An angle at contact and its range on the way down; nothing where it is not known there.

    The range's error: what the hand leaves open grows with the distance from the mean posture, so that of two
    postures on one side of it most is in common.
    """
    time_s, angle = movement.time_s[stroke.window], series.angle_deg[stroke.window]
    first_s, at_s = stroke.way
    known = np.isfinite(angle) & np.isfinite(time_s)
    own = known & (time_s >= first_s) & (time_s <= at_s)
    if own.sum() < 3 or not (known & (time_s > at_s)).any():
        return {}
    at_contact = float(np.interp(at_s, time_s[known], angle[known]))
    on_way = np.append(_smoothed(angle[own]), at_contact)
    columns: Row = {"at_contact_deg": at_contact, "range_deg": float(np.ptp(on_way))}
    if series.errors_deg is None:
        return columns
    errors = series.errors_deg[stroke.window][..., 0]
    sd, change = errors[:, ERRORS.index("sd_deg")], errors[:, ERRORS.index("change_sd_deg")]
    assert stroke.contact is not None
    rate = (at_contact - angle[own][-3]) / max(at_s - time_s[own][-3], 1e-3)
    of_time = abs(rate) * stroke.contact.sd_s
    of_hand = np.sqrt(np.maximum(change**2 - frame_sd**2, 0.0)) * np.sign(angle - middle_deg)
    rows = np.flatnonzero(own)
    ends = [rows[np.argmin(angle[own])], rows[np.argmax(angle[own])]]
    apart = float(of_hand[ends[1]] - of_hand[ends[0]])
    return columns | {
        "at_contact_sd_deg": float(np.hypot(np.interp(at_s, time_s[known], sd[known]), of_time)),
        "range_sd_deg": float(np.sqrt(apart**2 + 2 * frame_sd**2 + of_time**2)),
    }


def _smoothed(values: Array) -> Array:
    """Means of three neighbours, so that noise does not make the range."""
    return np.convolve(values, np.full(3, 1 / 3), mode="valid")


def independence_rows(strokes: Sequence[Stroke], digits: Sequence[str]) -> list[Row]:
    """Give rows of event_independence."""
    rows = []
    for digit in digits:
        own = [stroke for stroke in strokes if stroke.used and stroke.digit == digit]
        for other in digits:
            ratios = np.array([one.ratios[other] for one in own if other in one.ratios])
            if len(ratios):
                spread = float(ratios.std(ddof=1)) if len(ratios) > 1 else None
                sd = None if spread is None else spread / float(np.sqrt(len(ratios)))
                row = {"digit": digit, "other_digit": other, "mean_ratio": float(ratios.mean())}
                rows.append(row | {"spread": spread, "sd": sd, "n": len(ratios)})
    return rows


def measure_rows(
    strokes: Sequence[Stroke],
    angles: Sequence[Row],
    independence: Sequence[Row],
    found: StruckFingers | None,
    digits: Sequence[str],
) -> Iterator[Row]:
    """Give rows of event_measures."""
    used = [stroke for stroke in strokes if stroke.used]
    for stroke in used:
        stroke.values["held_s"] = stroke.values["key_up_s"] - stroke.values["key_down_s"]
    for digit in digits:
        own = [stroke for stroke in used if stroke.digit == digit]
        for name, (column, sd, unit) in MEASURES.items():
            numbers = [(one.values[column], one.values[sd] if sd else np.nan) for one in own]
            yield from _summaries(digit, name, numbers, unit)
        events = {one.event.number for one in own}
        by_joint: dict[str, list[Row]] = {}
        for row in (row for row in angles if row["event"] in events and row["angle"] == "flexion"):
            by_joint.setdefault(row["joint"], []).append(row)
        for joint, rows in by_joint.items():
            short = joint.removeprefix(f"{digit}_")
            for what in ("at_contact", "range"):
                numbers = [(row[f"{what}_deg"], row.get(f"{what}_sd_deg", np.nan)) for row in rows]
                yield from _summaries(digit, f"{short}_flexion_{what}", numbers, "deg")
        yield from _independence(digit, independence)
    yield from _of_all(used, found)


def _of_all(used: Sequence[Stroke], found: StruckFingers | None) -> Iterator[Row]:
    """Measures of all digits in turn: the rhythm, and the keyboard that they touched."""
    rhythm = [(stroke.values["since_any_s"], np.nan) for stroke in used]
    yield from _summaries("", "interval", rhythm, "s")
    for name, value in (
        {}
        if found is None
        else {"key_pitch": found.key_pitch_mm, "key_plane_scatter": found.plane_sd_mm}.items()
    ):
        if np.isfinite(value):
            yield {"digit": "", "measure": name, "value": value, "unit": "mm", "n": len(used)}


def _summaries(digit: str, name: str, numbers: Sequence[tuple[float, float]], unit: str) -> Iterator[Row]:
    """Mean and variability; the mean's error is what strokes have in common, so it does not average out."""
    values, sd = np.array(numbers, float).reshape(-1, 2).T
    sd, values = sd[np.isfinite(values)], values[np.isfinite(values)]
    if not len(values):
        return
    row = {"digit": digit, "unit": unit, "n": len(values)}
    error = float(np.sqrt(np.mean(sd**2)))
    yield row | {"measure": name, "value": float(values.mean()), "sd": error}
    if len(values) >= FEWEST_STROKES:
        yield row | {"measure": f"{name}_variability", "value": float(values.std(ddof=1))}


def _independence(digit: str, rows: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Individuation index of Haeger-Ross & Schieber: 1 where no other digit goes along, 0 where all do."""
    own = [row for row in rows if row["digit"] == digit and row["n"] >= FEWEST_STROKES]
    if own:
        value = 1.0 - float(np.mean([abs(row["mean_ratio"]) for row in own]))
        sd = float(np.sqrt(np.sum([row["sd"] ** 2 for row in own]))) / len(own)
        row = {"digit": digit, "measure": "independence", "value": value, "unit": ""}
        yield row | {"sd": sd, "n": min(row["n"] for row in own)}
