"""Rows of the tables of movement of one recording under one model, without the keys of both.

The error of an angle has three parts. An error common to all frames shifts the median and does not change the
range. The uncertainty of the fitted hand and its skin grows roughly in proportion to the distance from the
mean posture, so its errors at the two ends have opposite signs and add up in the range. The error of a single
frame is independent at the two ends; like any noise, it also widens the range.

Between sessions, in which the receivers are put on again and the hand moves as before, only a part of the
error differs: the part of the hand's uncertainty that depends on how the receivers sit, and the error of
single frames, which differs with every visit to an end of the range.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.hand import recorded_movement
from shukotsu.hand.known_digits import leading_model
from shukotsu.hand.posed_recording import RecordingReader, recording_reader
from shukotsu.hand.recorded_movement import ANGLES, ERRORS, AngleSeries, FingertipPath
from shukotsu.hand.series import HIGH_PERCENT, LOW_PERCENT
from shukotsu.movement.cycles import Cycle, TimedEvent, averaged_cycles, curve_rows, cycles_of, events_of
from shukotsu.movement.sampling import Grid, bridge_gaps, grid_of, percentiles, speed
from shukotsu.movement.strokes import stroke_rows, struck_events
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
"""Distance between the 2.5th and 97.5th percentiles of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class AngleErrors:
    """1-sigma errors of an angle in every frame, shape (T,), degrees; NaN if the model states none.

    sd_deg : error of the angle. change_sd_deg : error of its change from the mean posture. session_sd_deg,
    session_change_sd_deg : the parts of both due to the hand that differ when receivers are put on again.
    """

    sd_deg: Array
    change_sd_deg: Array
    session_sd_deg: Array
    session_change_sd_deg: Array


RANGE_PERCENT = (LOW_PERCENT, 50.0, HIGH_PERCENT, _ENDS_PERCENT, 100.0 - _ENDS_PERCENT)
"""Percentiles of an angle from which its range is computed."""


def angle_range(angle_deg: Array, errors: AngleErrors | None, percentiles_deg: Array) -> RangesOfMotionRow:
    """Return the range of an angle: columns of ranges_of_motion.

    Parameters
    ----------
    angle_deg : array, shape (T,)
        The angle, without gaps; at least one frame.
    errors : AngleErrors or None
        Its errors; None if the model states none.
    percentiles_deg : array, shape (5,)
        Its percentiles at `RANGE_PERCENT`.

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
    """Return the sum, over both ends, of the root mean square of sd_deg (T,) over the frames at that end."""
    return float(sum(np.sqrt((sd_deg[at_end] ** 2).mean()) for at_end in ends))


def _visits(at_end: Bools, beyond: Bools) -> int:
    """Count how often the angle reaches one end after it was beyond the median.

    at_end, beyond : (T,), whether the angle is at this end, and whether it is on the median's other side.
    """
    either = at_end | beyond
    is_at_end = at_end[either]
    return int(is_at_end[0]) + int((is_at_end[1:] & ~is_at_end[:-1]).sum())


LEAST_VALID_PERCENT, MOST_VALID_PERCENT = 50.0, 95.0
"""Valid frames, % of a recording: with fewer than the first a number is weak; with fewer than the second its
message states the percentage."""

NO_TIMES = "the recording has no times, so speeds cannot be computed"


def range_rows(angles: Sequence[AngleSeries], grid: Grid | None) -> Iterator[RangesOfMotionRow]:
    """Yield the rows of ranges_of_motion of some or all angles of a recording.

    An angle without any value has a row only if it is flexion, so that each joint has one.
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
    """Yield the rows of ranges_of_motion of joints that a model cannot pose; reasons : why, by joint."""
    for joint, reason in reasons.items():
        yield {"joint": joint, "angle": "flexion", "n_frames": 0, "status": "failed", "message": reason}


def path_rows(
    tips: Mapping[str, FingertipPath], grid: Grid | None, pathless: Mapping[str, str] | None = None
) -> Iterator[FingertipPathsRow]:
    """Yield the rows of fingertip_paths; tips : by digit. pathless : reasons why digits have no tip."""
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
            if tip.skin:  # when the tip turns, an error of its position lengthens or shortens its path
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
    """Return the number of finite frames (T,), and their percentage, None if there are no frames."""
    return int(finite.sum()), 100.0 * float(finite.mean()) if len(finite) else None


def _judge(valid_percent: float, status: str, message: str, grid: Grid | None) -> tuple[str, str]:
    """Return the status and message of a row with numbers."""
    reasons = [message] if message else []
    if valid_percent < MOST_VALID_PERCENT:
        reasons = [f"known in {valid_percent:.0f} % of the frames", *reasons]
    if valid_percent < LEAST_VALID_PERCENT:
        status = "weak"
    if grid is None:
        status, reasons = "weak", [NO_TIMES, *reasons]
    return status, "; ".join(reasons)


def _median_and_p95(speeds: Array) -> Array:
    """Return the median and 95th percentile (2, C) of speeds (n, C); NaN for a column of NaN."""
    return percentiles(speeds.T, [50.0, 95.0])


def _speeds(series: Array, grid: Grid) -> Array:
    """Return the speeds (n, C) of series (T, C, D) on the grid of n points, with short gaps bridged."""
    columns = bridge_gaps(grid.spread(series.reshape(len(series), -1)), grid.step_s)
    return speed(columns.reshape(len(columns), *series.shape[1:]), grid.step_s)


_TOGETHER = 1 << 19
"""Number of angle values that are processed at once; an array of them takes 4 MB."""

CYCLES = "movement_cycles"
"""The table whose rows belong to a hand and not to a model."""


def measure_hand(
    arguments: Namespace, plan: SubjectPlan, hand: str, tables: Mapping[str, PartsWriter]
) -> None:
    """Write the rows of one hand to the tables; a part that fails gets the reason instead."""
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
    # for the others the recordings table states the reason
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
    """Write the rows of one recording under one model."""
    recording, part = reader.recording, reader.part

    def write(name: str, rows: Iterable[Mapping[str, Any]]) -> None:
        tables[name].rows(part, [{**recording.key, **row} for row in rows])

    if reasons := recorded_movement.unsolved_joints(reader):
        write("ranges_of_motion", left_out_rows(reasons))
        return
    movement = recorded_movement.read_movement(reader)
    grid = grid_of(movement.time_s)
    if not reader.is_fitted and part.model != leading_model(plan.models, plan.layouts.values()):
        cycles = ()  # the report does not show their curves
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
