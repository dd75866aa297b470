"""Rows of the tables of movement, of one recording under one model: all but the keys of both.

How far an angle moves has an error of three parts. What is common to all frames moves the median, and leaves
the range as it is. What the fit leaves open of the hand and its skin grows with the distance from the mean
posture, mostly in proportion: at the two ends it has opposite signs, and adds up. What is of the frame alone
is independent at both ends; being of either sign in every frame, it also widens a range, as any noise does.

Of a hand that puts the receivers on anew, and moves as before, only a part is another: the hand's that goes
with the receivers, and the frame's, which is another in every visit to an end.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.hand.known_digits import leading_model
from shukotsu.hand.posed_recording import RecordingReader, recording_reader
from shukotsu.hand.recorded_movement import (
    ANGLES,
    ERRORS,
    AngleSeries,
    FingertipPath,
    read_movement,
    unsolved_joints,
)
from shukotsu.hand.series import HIGH_PERCENT, LOW_PERCENT
from shukotsu.movement.cycle_curves import averaged_cycles, curve_rows
from shukotsu.movement.events import Cycle, TimedEvent, cycles_of, events_of, struck_events
from shukotsu.movement.sampling import Grid, bridge_gaps, grid_of, percentiles, speed
from shukotsu.movement.strokes import stroke_rows
from shukotsu.study import subject_stage
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.parts import PartsWriter, opened_once
from shukotsu.tables.poses import usable_poses

if TYPE_CHECKING:
    from shukotsu.tables.rows import CycleCurvesRow, FingertipPathsRow, RangesOfMotionRow

_Ends = tuple[Bools, Bools]

_ENDS_PERCENT = 5.0
"""Share of the frames at either end, %, over which an end's error is averaged."""

_WIDTH_OF_NORMAL = 3.92
"""From the 2.5th to the 97.5th percentile of a normal distribution, in its standard deviations."""


@dataclass(frozen=True)
class AngleErrors:
    """1-sigma errors of an angle in every frame, (T,) degrees each, NaN where the model states none.

    change_sd_deg : of its change from the mean posture. session_sd_deg, session_change_sd_deg : the hand's
    part of both that differs when the receivers are put on anew.
    """

    sd_deg: Array
    change_sd_deg: Array
    session_sd_deg: Array
    session_change_sd_deg: Array


RANGE_PERCENT = (LOW_PERCENT, 50.0, HIGH_PERCENT, _ENDS_PERCENT, 100.0 - _ENDS_PERCENT)
"""Percentiles of an angle that its range is told by."""


def angle_range(angle_deg: Array, errors: AngleErrors | None, percentiles_deg: Array) -> RangesOfMotionRow:
    """Return the range of an angle: columns of ranges_of_motion.

    Parameters
    ----------
    angle_deg : array, shape (T,)
        Without gaps, one frame at least.
    errors : AngleErrors or None
        None where the model states none.
    percentiles_deg : array, shape (5,)
        Of the angle, at `RANGE_PERCENT`.

    """
    low, middle, high, below, above = percentiles_deg
    row: RangesOfMotionRow = {
        "range_deg": float(high - low),
        "low_deg": float(low),
        "high_deg": float(high),
        "full_range_deg": float(np.ptp(angle_deg)),
        "median_deg": float(middle),
    }
    if errors is None or np.isnan(errors.sd_deg).all():
        return row
    ends = (angle_deg <= below, angle_deg >= above)
    frame = float(errors.change_sd_deg.min())
    by_hand = _at_ends(np.sqrt(np.maximum(errors.change_sd_deg**2 - frame**2, 0.0)), ends)
    range_deg = row["range_deg"]
    widened = range_deg - np.sqrt(max(range_deg**2 - (_WIDTH_OF_NORMAL * frame) ** 2, 0.0))
    visits = _visits(ends[0], angle_deg > middle), _visits(ends[1], angle_deg < middle)
    anew = _at_ends(errors.session_change_sd_deg, ends)
    return row | {
        "range_sd_deg": float(np.sqrt(by_hand**2 + 2 * frame**2 + widened**2)),
        "median_sd_deg": float(np.median(errors.sd_deg)),
        "range_session_sd_deg": float(np.sqrt(anew**2 + frame**2 * sum(1 / n for n in visits))),
        "median_session_sd_deg": float(
            np.sqrt(np.median(errors.session_sd_deg) ** 2 + frame**2 / sum(visits))
        ),
    }


def _at_ends(sd_deg: Array, ends: _Ends) -> float:
    """Root mean square over the frames (T,) at either end, added up."""
    return float(sum(np.sqrt((sd_deg[at_end] ** 2).mean()) for at_end in ends))


def _visits(at_end: Bools, beyond: Bools) -> int:
    """Count how often the angle comes to one end from beyond its median; both (T,)."""
    either = at_end | beyond
    there = at_end[either]
    return int(there[0]) + int((there[1:] & ~there[:-1]).sum())


LEAST_VALID_PERCENT, MOST_VALID_PERCENT = 50.0, 95.0
"""Share of a recording's frames, below which a number is weak, and from which it is as of the whole."""

NO_TIMES = "the recording has no times, so there are no speeds"


def range_rows(angles: Sequence[AngleSeries], grid: Grid | None) -> Iterator[RangesOfMotionRow]:
    """Rows of ranges_of_motion of the angles of a recording, or of some of its joints.

    An angle that a joint lacks beside another that it has is none.
    """
    angles_deg = np.stack([series.angle_deg for series in angles])
    percentiles_deg = percentiles(angles_deg, RANGE_PERCENT)
    speeds_deg_s = np.full((2, len(angles)), np.nan)
    if grid is not None:
        speeds_deg_s = _median_and_p95(_speeds(angles_deg.T[..., None], grid))
    for index, series in enumerate(angles):
        finite = ~np.isnan(series.angle_deg)
        row: RangesOfMotionRow = {"joint": series.joint, "angle": series.angle}
        row["n_frames"], row["valid_percent"] = _coverage(finite)
        if not finite.any():
            if series.angle == "flexion":
                yield row | {"status": "failed", "message": series.message or "no frame has this angle"}
            continue
        errors = None
        if series.errors_deg is not None:
            errors = AngleErrors(*(series.errors_deg[:, which, 0][finite] for which in range(len(ERRORS))))
        row |= angle_range(series.angle_deg[finite], errors, percentiles_deg[:, index])
        row["speed_median_deg_s"], row["speed_p95_deg_s"] = speeds_deg_s[:, index].tolist()
        status = "weak" if series.status == "weak" or series.errors_deg is None else "ok"
        row["status"], row["message"] = _judge(row["valid_percent"], status, series.message, grid)
        yield row


def left_out_rows(reasons: Mapping[str, str]) -> Iterator[RangesOfMotionRow]:
    """Rows of ranges_of_motion of joints that a model cannot pose. reasons : why, by joint."""
    for joint, reason in reasons.items():
        yield {"joint": joint, "angle": "flexion", "n_frames": 0, "status": "failed", "message": reason}


def path_rows(
    tips: Mapping[str, FingertipPath], grid: Grid | None, pathless: Mapping[str, str] | None = None
) -> Iterator[FingertipPathsRow]:
    """Rows of fingertip_paths; pathless : digits without a tip, and why."""
    for digit, reason in (pathless or {}).items():
        message = reason or "no frame has this fingertip"
        yield {"digit": digit, "n_frames": 0, "status": "failed", "message": message}
    for digit, tip in tips.items():
        finite = np.asarray(np.isfinite(tip.place_mm[..., 0]).all(1))
        row: FingertipPathsRow = {"digit": digit}
        row["n_frames"], row["valid_percent"] = _coverage(finite)
        if not finite.any():
            yield row | {"status": "failed", "message": tip.message or "no frame has this fingertip"}
            continue
        if grid is not None:
            way, turn = _speeds(np.stack([tip.place_mm[..., 0], tip.pointing[..., 0]], 1), grid).T
            path_sd_mm = float("nan")
            if tip.skin:  # a tip that is off goes so much farther, or less far, as it turns
                turned_rad = float(np.nansum(turn) * grid.step_s)
                path_sd_mm = float(np.nanmedian(tip.sd_mm[:, 0, 0]) / np.sqrt(3.0) * turned_rad)
            moving = ~np.isnan(way)
            row |= {
                "path_length_mm": float(np.nansum(way) * grid.step_s) if moving.any() else None,
                "duration_s": float(moving.sum() * grid.step_s),
                "path_sd_mm": path_sd_mm,
            }
            row["speed_median_mm_s"], row["speed_p95_mm_s"] = _median_and_p95(way[:, None])[:, 0].tolist()
        status = "weak" if tip.message else "ok"
        row["status"], row["message"] = _judge(row["valid_percent"], status, tip.message, grid)
        yield row


def _coverage(finite: Bools) -> tuple[int, float | None]:
    """Count the known frames (T,), and their percentage of the recording, None without frames."""
    return int(finite.sum()), 100.0 * float(finite.mean()) if len(finite) else None


def _judge(valid_percent: float, status: str, message: str, grid: Grid | None) -> tuple[str, str]:
    """Status and message of a row that has numbers."""
    reasons = [message] if message else []
    if valid_percent < MOST_VALID_PERCENT:
        reasons = [f"known in {valid_percent:.0f} % of the frames", *reasons]
    if valid_percent < LEAST_VALID_PERCENT:
        status = "weak"
    if grid is None:
        status, reasons = "weak", [NO_TIMES, *reasons]
    return status, "; ".join(reasons)


def _median_and_p95(speeds: Array) -> Array:
    """Median and 95th percentile (2, C) of speeds (n, C); NaN where all are."""
    return percentiles(speeds.T, [50.0, 95.0])


def _speeds(series: Array, grid: Grid) -> Array:
    """Speeds (n, C) of series (T, C, D)."""
    columns = bridge_gaps(grid.spread(series.reshape(len(series), -1)), grid.step_s)
    return speed(columns.reshape(len(columns), *series.shape[1:]), grid.step_s)


_TOGETHER = 1 << 19
"""Frames of angles that are measured in one pass: 4 MB an array."""

CYCLES = "movement_cycles"
"""The table whose rows are of a hand, not of a model."""


def measure_hand(
    arguments: Namespace, plan: SubjectPlan, hand: str, tables: Mapping[str, PartsWriter]
) -> None:
    """Write the rows of one hand, of each part those that can be had."""
    by_model = [table for name, table in tables.items() if name != CYCLES]
    events: Mapping[Recording, Sequence[TimedEvent]] = {}
    cycles: Mapping[Recording, Sequence[Sequence[Cycle]]] = {}
    with subject_stage.recording_failure(arguments, plan.part(hand), tables[CYCLES]):
        events = events_of(plan, hand, next(iter(arguments.events), None), next(iter(arguments.clocks), None))
        cycles = {recording: cycles_of(plan, recording, named) for recording, named in events.items()}
        rows = [
            recording.key
            | {"event": cycle.event, "cycle": cycle.number, "used": not cycle.refusal}
            | {"onset_s": cycle.onset_s, "duration_s": cycle.duration_s, "message": cycle.refusal}
            for recording, of_recording in cycles.items()
            for of_event in of_recording
            for cycle in of_event
        ]
        tables[CYCLES].rows(plan.part(hand), rows)
    # else the recordings table says why
    usable = [recording for recording in plan.posed(hand) if usable_poses([plan.poses(recording)])[0]]
    with opened_once() as opened:
        for part in (part for part in plan.whole_parts if part.hand == hand):
            with subject_stage.recording_failure(arguments, part, *by_model):
                for table in by_model:
                    table.rows(part, [])
                for recording in usable:
                    reader = recording_reader(plan, recording, part.model, opened)
                    cut = averaged_cycles(cycles.get(recording, ()))
                    _measure_recording(plan, reader, events.get(recording, ()), cut, tables)


def _measure_recording(
    plan: SubjectPlan,
    reader: RecordingReader,
    events: Sequence[TimedEvent],
    cycles: Sequence[Sequence[Cycle]],
    tables: Mapping[str, PartsWriter],
) -> None:
    """Write the rows of one recording."""
    recording, part = reader.recording, reader.part

    def write(name: str, rows: Iterable[Mapping[str, Any]]) -> None:
        tables[name].rows(part, [{**recording.key, **row} for row in rows])

    if reasons := unsolved_joints(reader):
        write("ranges_of_motion", left_out_rows(reasons))
        return
    movement = read_movement(reader)
    grid = grid_of(movement.time_s)
    if not reader.is_fitted and part.model != leading_model(plan.models, plan.layouts.values()):
        cycles = ()  # no page shows their curves
    ranges: list[RangesOfMotionRow] = []
    curves: list[CycleCurvesRow] = []
    angles, at_once = movement.joints(), max(1, _TOGETHER // max(1, len(movement.frame)))
    while some := list(islice(angles, at_once)):
        ranges += range_rows(some, grid)
        if grid is not None:
            curves += (row for series in some for row in curve_rows(series, movement.time_s, cycles, grid))
    ranges.sort(key=lambda row: ANGLES.index(row["angle"]))
    write("ranges_of_motion", [*left_out_rows(movement.left_out), *ranges])
    write("cycle_curves", curves)
    write("fingertip_paths", path_rows(movement.fingertips, grid, movement.pathless))
    if strokes := struck_events(recording, events, [*reader.layout.digits]):
        write("event_strokes", stroke_rows(movement, strokes))
