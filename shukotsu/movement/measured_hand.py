"""A hand's tables of movement: its cycles, and what every skeleton measures in every recording."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shukotsu.hand.posed_recording import recording_reader
from shukotsu.hand.recorded_movement import ANGLES, read_movement, unsolved
from shukotsu.movement import movement_rows
from shukotsu.movement.events import TimedEvent, cycles_of, events_of, struck_events
from shukotsu.movement.sampling import grid_of
from shukotsu.movement.strokes import stroke_rows
from shukotsu.study import subject_stage
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.parts import Part, PartsWriter
from shukotsu.tables.poses import usable_poses

CYCLES = "movement_cycles"
"""The table whose rows are of a hand, not of a model."""


def measure_hand(
    arguments: Namespace, plan: SubjectPlan, hand: str, tables: Mapping[str, PartsWriter]
) -> None:
    """Write the rows of one hand, of each part those that can be had."""
    by_model = [table for name, table in tables.items() if name != CYCLES]
    events: Mapping[Recording, Sequence[TimedEvent]] = {}
    with subject_stage.recording_failure(arguments, plan.part(hand), tables[CYCLES]):
        events = events_of(plan, hand, next(iter(arguments.events), None), next(iter(arguments.clocks), None))
        rows = [
            recording.key | row
            for recording, of_recording in events.items()
            for row in movement_rows.cycle_rows(cycles_of(plan, recording, of_recording))
        ]
        tables[CYCLES].rows(plan.part(hand), rows)
    # what only calibrates can be posed without the tables of its metacarpals
    has_metacarpals = any(digit.metacarpal for digit in plan.layouts[hand].digits.values())
    for part in (part for part in plan.whole_parts if part.hand == hand):
        recordings = [*plan.evaluated(hand)]
        if not has_metacarpals or plan.models[part.model].fitting is not None:
            recordings += plan.recordings_of(hand, "calibration")
        with subject_stage.recording_failure(arguments, part, *by_model):
            for table in by_model:
                table.rows(part, [])
            for recording in recordings:
                if usable_poses([plan.poses(recording)])[0]:  # else the recordings table says why
                    _measure_recording(plan, part, recording, events.get(recording, ()), tables)


def _measure_recording(
    plan: SubjectPlan,
    part: Part,
    recording: Recording,
    events: Sequence[TimedEvent],
    tables: Mapping[str, PartsWriter],
) -> None:
    """Write the rows of one recording, ranges alone where it only calibrates."""
    reader, evaluated = recording_reader(plan, recording, part.model), recording.role != "calibration"

    def write(name: str, rows: Iterable[dict[str, Any]]) -> None:
        tables[name].rows(part, [{**recording.key, **row} for row in rows])

    if reasons := unsolved(reader):
        write("ranges_of_motion", movement_rows.left_out_rows(reasons) if evaluated else ())
        return
    movement = read_movement(reader, with_tips=evaluated)
    grid = grid_of(movement.time_s)
    ranges = [row for series in movement.joints() for row in movement_rows.range_rows(series, grid)]
    ranges.sort(key=lambda row: ANGLES.index(row["angle"]))
    if not evaluated:
        write("ranges_of_motion", ranges)
        return
    write("ranges_of_motion", [*movement_rows.left_out_rows(movement.left_out), *ranges])
    write("fingertip_paths", movement_rows.path_rows(movement.fingertips, grid))
    if strokes := struck_events(recording, events, [*reader.layout.digits]):
        write("event_strokes", stroke_rows(movement, strokes))
