"""Command line: poses, skeletons and fits, and events -> the subject's tables of movement."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line

if TYPE_CHECKING:
    from schemas.parts import Part, PartsWriter
    from schemas.plan import SubjectPlan
    from schemas.study import Recording
    from stages.measure_movement.cycles import Cycle

    Cycles = Mapping[Recording, Sequence[Sequence[Cycle]]]
    """Of each recording the cycles of each event."""


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage measure_movement",
        "Measure movement in every evaluated recording: ranges, speeds, cycles, ways of the fingertips; in "
        "those that only calibrate, ranges.",
        "shukotsu stage measure_movement --plan results/demo/sub-01/plan.json --out results/demo/sub-01",
    )
    parser.add_argument(
        "--plan", type=Path, required=True, help="the subject's plan, whose folder holds its tables"
    )
    parser.add_argument("--events", type=Path, help="the subject's events table (default: no cycles)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def measure(arguments: argparse.Namespace) -> None:
    """Measure every recording under every whole skeleton, write the tables."""
    from contextlib import ExitStack

    from schemas.catalogue import TABLES as CATALOGUE
    from schemas.parts import parts_writer
    from schemas.plan import read_plan
    from schemas.results import MEASURED_TABLES
    from stages.measure_movement.events import cycles_of

    plan = read_plan(arguments.plan)
    events = [] if arguments.events is None else [arguments.events]
    own = [plan.table(name) for name in ("joint_centres", "bone_lengths", "metacarpals")]
    fits = [file for name in ("joint_angles", "posed_tips", "bone_poses") for file in plan.files_of(name)]
    provenance = command_line.provenance_of(plan, [*own, *fits], [*command_line.poses_files(plan), *events])
    with ExitStack() as stack:
        tables = {
            name: stack.enter_context(
                parts_writer(arguments.out / f"{name}.parquet", CATALOGUE[name], provenance)
            )
            for name in MEASURED_TABLES
        }
        for hand in plan.hands:
            cycles: Cycles = {}
            with command_line.recording_failure(arguments, plan.part(hand), tables["movement_cycles"]):
                cycles = cycles_of(plan, hand, arguments.events)
            used: set[tuple[Recording, str, int]] = set()
            for part in plan.parts():
                if part.hand == hand and not part.made_without:
                    with command_line.recording_failure(arguments, part, *_by_model(tables)):
                        _measure_part(plan, part, cycles, tables, used)
            _write_cycles(plan, hand, cycles, used, tables["movement_cycles"])


def _by_model(tables: Mapping[str, PartsWriter]) -> list[PartsWriter]:
    """The tables whose rows are of a model."""
    return [table for name, table in tables.items() if name != "movement_cycles"]


def _measure_part(
    plan: SubjectPlan,
    part: Part,
    cycles: Cycles,
    tables: Mapping[str, PartsWriter],
    used: set[tuple[Recording, str, int]],
) -> None:
    """Write the rows of one model; used : takes the cycles that its curves are made of."""
    from schemas.errors import InputError, TableError
    from schemas.poses import frame_count

    curves: list[dict[str, Any]] = []
    for table in _by_model(tables):
        table.rows(part, [])
    for recording in plan.evaluated(part.hand):
        try:
            frame_count(plan.poses(recording))
        except TableError:
            raise
        except InputError:
            continue  # its import failed: the recordings table says why
        whole, own_curves = _measure_recording(plan, part, recording, cycles.get(recording, ()), tables)
        used |= whole
        curves += own_curves
    for recording in _calibrations(plan, part):
        tables["ranges_of_motion"].rows(part, _calibration_ranges(plan, part, recording))
    for columns in curves:  # only now, as what `columns` has written stays there where the part fails
        tables["movement_curves"].columns(part, columns)


def _measure_recording(
    plan: SubjectPlan,
    part: Part,
    recording: Recording,
    cycles: Sequence[Sequence[Cycle]],
    tables: Mapping[str, PartsWriter],
) -> tuple[set[tuple[Recording, str, int]], list[dict[str, Any]]]:
    """Write the rows of one recording; give its curves' cycles and columns."""
    from stages.measure_movement.movement_rows import (
        curve_columns,
        distance_rows,
        left_out_rows,
        path_rows,
        range_rows,
    )
    from stages.measure_movement.recorded_movement import RecordedMovement
    from stages.measure_movement.sampling import grid_of

    keys: dict[str, Any] = {**recording.key}
    curves: list[dict[str, Any]] = []
    movement = RecordedMovement(plan, recording, part.model)
    if unsolved := movement.unsolved():
        tables["ranges_of_motion"].rows(part, [keys | row for row in left_out_rows(unsolved)])
        return set(), []
    grid, ranges, used = grid_of(movement.poses.time_s), list(left_out_rows(movement.left_out())), set()
    for series in movement.angles():
        ranges += range_rows(series, grid, {joint: movement.reliability(joint) for joint in series.joints})
        for own in cycles:
            assert grid is not None  # without times there are no cycles
            columns, whole = curve_columns(series, grid, movement.poses.time_s, own)
            used |= {(recording, own[0].event, number) for number in whole}
            curves += [keys | columns] if whole else []
    tips = movement.fingertips()
    for name, rows in (
        ("ranges_of_motion", ranges),
        ("fingertip_paths", path_rows(tips, grid)),
        ("fingertip_distances", distance_rows(tips, grid)),
    ):
        tables[name].rows(part, [keys | row for row in rows])
    return used, curves


def _calibrations(plan: SubjectPlan, part: Part) -> list[Recording]:
    """Recordings that only calibrate a hand and can be posed: without the tables of its metacarpals."""
    from schemas.poses import usable_poses

    rides = any(digit.metacarpal for digit in plan.layouts[part.hand].digits.values())
    if rides and plan.models[part.model].fitting is None:
        return []
    recordings = plan.recordings_of(part.hand, "calibration")
    return [own for own in recordings if usable_poses([plan.poses(own)])[0]]


def _calibration_ranges(plan: SubjectPlan, part: Part, recording: Recording) -> list[dict[str, Any]]:
    """Rows of ranges_of_motion of a recording that nothing else is measured in."""
    from stages.measure_movement.movement_rows import range_rows
    from stages.measure_movement.recorded_movement import RecordedMovement
    from stages.measure_movement.sampling import grid_of

    movement = RecordedMovement(plan, recording, part.model)
    if movement.unsolved():
        return []
    grid = grid_of(movement.poses.time_s)
    return [
        {**recording.key, **row}
        for series in movement.angles()
        for row in range_rows(series, grid, {joint: movement.reliability(joint) for joint in series.joints})
    ]


def _write_cycles(
    plan: SubjectPlan,
    hand: str,
    cycles: Cycles,
    used: set[tuple[Recording, str, int]],
    table: PartsWriter,
) -> None:
    rows = []
    for recording, by_event in cycles.items():
        for cycle in (cycle for own in by_event for cycle in own):
            is_used = (recording, cycle.event, cycle.number) in used
            row = recording.key | {"event": cycle.event, "cycle": cycle.number, "used": is_used}
            row |= {"onset_s": cycle.onset_s, "duration_s": cycle.duration_s}
            message = "" if is_used else cycle.refusal or "every angle has a gap in it"
            rows.append(row | {"message": message})
    table.rows(plan.part(hand), rows)


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why nothing was measured, of every part."""
    from schemas.catalogue import TABLES as CATALOGUE
    from schemas.plan import read_plan
    from schemas.results import MEASURED_TABLES

    plan = read_plan(arguments.plan)
    whole = [part for part in plan.parts() if not part.made_without]
    for name in MEASURED_TABLES:
        parts = map(plan.part, plan.hands) if name == "movement_cycles" else whole
        tables = {arguments.out / f"{name}.parquet": CATALOGUE[name]}
        command_line.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser().parse_args(argv), measure, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
