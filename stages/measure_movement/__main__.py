"""Command line: poses, skeletons and fits, and events -> the subject's tables of movement."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.study import Recording
    from shukotsu.stages.measure_movement.events import TimedEvent

CYCLES = "movement_cycles"
"""The table whose rows are of a hand, not of a model."""


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage measure_movement",
        "Measure movement in every evaluated recording: ranges, speeds, cycles, ways of the fingertips, and "
        "which of them struck at an event; in those that only calibrate, ranges.",
        "shukotsu stage measure_movement --plan results/demo/sub-01/plan.json --out results/demo/sub-01",
    )
    subject_stage.add_plan(parser, "the subject's plan, whose folder holds its tables", required=True)
    parser.add_argument("--events", type=Path, help="the subject's events table (default: no cycles)")
    parser.add_argument("--clocks", type=Path, help="the subject's clocks table (default: all are trusted)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def measure(arguments: argparse.Namespace) -> None:
    """Measure every recording under every whole skeleton, write the tables."""
    from shukotsu.schemas.catalogue import TABLES
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.poses import usable_poses
    from shukotsu.schemas.results import MEASURED_TABLES
    from shukotsu.stages.measure_movement.events import cycles_of, events_of
    from shukotsu.stages.measure_movement.movement_rows import cycle_rows

    plan = read_plan(arguments.plan, arguments.inputs)
    made_of = [plan.table(name) for name in ("joint_centres", "bone_lengths", "metacarpals")]
    made_of += [path for name in ("joint_angles", "posed_tips", "bone_poses") for path in plan.files_of(name)]
    poses = [*subject_stage.poses_files(plan), *filter(None, (arguments.events, arguments.clocks))]
    provenance = subject_stage.provenance_of(plan, made_of, poses)
    with ExitStack() as stack:
        tables = {
            name: stack.enter_context(
                parts_writer(arguments.out / f"{name}.parquet", TABLES[name], provenance)
            )
            for name in MEASURED_TABLES
        }
        by_model = [table for name, table in tables.items() if name != CYCLES]
        events: Mapping[Recording, Sequence[TimedEvent]] = {}
        for hand in plan.hands:
            with subject_stage.recording_failure(arguments, plan.part(hand), tables[CYCLES]):
                events = events_of(plan, hand, arguments.events, arguments.clocks)
                rows = [
                    recording.key | row
                    for recording, of_recording in events.items()
                    for row in cycle_rows(cycles_of(plan, recording, of_recording))
                ]
                tables[CYCLES].rows(plan.part(hand), rows)
            # what only calibrates can be posed without the tables of its metacarpals
            has_metacarpals = any(digit.metacarpal for digit in plan.layouts[hand].digits.values())
            for part in (own for own in plan.whole_parts if own.hand == hand):
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
    from shukotsu.anatomy.recorded_movement import ANGLES, read_movement, unsolved
    from shukotsu.skeleton.posed_recording import recording_reader
    from shukotsu.stages.measure_movement import movement_rows
    from shukotsu.stages.measure_movement.events import struck_events
    from shukotsu.stages.measure_movement.sampling import grid_of
    from shukotsu.stages.measure_movement.strokes import stroke_rows

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


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why nothing was measured, of every part."""
    from shukotsu.schemas.catalogue import TABLES
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.results import MEASURED_TABLES

    plan = read_plan(arguments.plan, arguments.inputs)
    for name in MEASURED_TABLES:
        parts = map(plan.part, plan.hands) if name == CYCLES else plan.whole_parts
        subject_stage.record_failed_parts(message, {arguments.out / f"{name}.parquet": TABLES[name]}, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, measure, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
