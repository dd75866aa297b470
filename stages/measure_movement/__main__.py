"""Command line: poses, skeletons and fits, and events -> the subject's tables of movement."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part, PartsWriter
    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.schemas.study import Recording
    from shukotsu.stages.measure_movement.cycles import Cycle

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
    subject_stage.add_plan(parser, "the subject's plan, whose folder holds its tables", required=True)
    parser.add_argument("--events", type=Path, help="the subject's events table (default: no cycles)")
    parser.add_argument("--clocks", type=Path, help="the subject's clocks table (default: all are trusted)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def measure(arguments: argparse.Namespace) -> None:
    """Measure every recording under every whole skeleton, write the tables."""
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.results import MEASURED_TABLES
    from shukotsu.stages.measure_movement.events import cycles_of

    plan = read_plan(arguments.plan, arguments.inputs)
    with subject_stage.measured_tables(arguments, plan, MEASURED_TABLES) as tables:
        for hand in plan.hands:
            cycles: Cycles = {}
            with subject_stage.recording_failure(arguments, plan.part(hand), tables["movement_cycles"]):
                cycles = cycles_of(plan, hand, arguments.events, arguments.clocks)
            used: set[tuple[Recording, str, int]] = set()
            for part in plan.whole_parts:
                if part.hand == hand:
                    with subject_stage.recording_failure(arguments, part, *_by_model(tables)):
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
    from shukotsu.schemas.poses import usable_poses

    curves: list[dict[str, Any]] = []
    for table in _by_model(tables):
        table.rows(part, [])
    for recording in plan.evaluated(part.hand):
        if not usable_poses([plan.poses(recording)])[0]:
            continue  # its import failed: the recordings table says why
        whole, own_curves = _measure_recording(plan, part, recording, cycles.get(recording, ()), tables)
        used |= whole
        curves += own_curves
    for recording in _calibrations(plan, part):
        _measure_recording(plan, part, recording, (), tables)
    for columns in curves:  # only now, as what `columns` has written stays there where the part fails
        tables["movement_curves"].columns(part, columns)


def _measure_recording(
    plan: SubjectPlan,
    part: Part,
    recording: Recording,
    cycles: Sequence[Sequence[Cycle]],
    tables: Mapping[str, PartsWriter],
) -> tuple[set[tuple[Recording, str, int]], list[dict[str, Any]]]:
    """Write the rows of one recording, ranges alone where it only calibrates; give its curves."""
    from itertools import groupby

    from shukotsu.anatomy.recorded_movement import ANGLES, read_movement, unsolved
    from shukotsu.skeleton.posed_recording import posed_recording
    from shukotsu.stages.measure_movement.movement_rows import (
        Curve,
        curve_columns,
        distance_rows,
        joint_curves,
        left_out_rows,
        path_rows,
        range_rows,
    )
    from shukotsu.stages.measure_movement.sampling import grid_of

    posed, evaluated = posed_recording(plan, recording, part.model), recording.role != "calibration"

    def write(name: str, rows: Iterable[dict[str, Any]]) -> None:
        tables[name].rows(part, [{**recording.key, **row} for row in rows])

    if reasons := unsolved(posed):
        write("ranges_of_motion", left_out_rows(reasons) if evaluated else ())
        return set(), []
    movement = read_movement(posed, with_tips=evaluated)
    grid = grid_of(movement.time_s)
    used: set[tuple[Recording, str, int]] = set()
    ranges: list[dict[str, Any]] = []
    curves: list[Curve] = []
    for series in movement.joints():
        ranges += range_rows(series, grid)
        if cycles:
            assert grid is not None  # without times there are no cycles
            own, whole = joint_curves(series, grid, movement.time_s, cycles)
            curves += own
            used |= {(recording, *cycle) for cycle in whole}
    ranges.sort(key=lambda row: ANGLES.index(row["angle"]))
    if not evaluated:
        write("ranges_of_motion", ranges)
        return set(), []
    write("ranges_of_motion", [*left_out_rows(movement.left_out), *ranges])
    write("fingertip_paths", path_rows(movement.fingertips, grid))
    write("fingertip_distances", distance_rows(movement.fingertips, grid))
    events = [own[0].event for own in cycles]
    curves.sort(key=lambda one: (ANGLES.index(one.angle), events.index(one.event)))
    together = groupby(curves, key=lambda one: (one.angle, one.event))
    return used, [{**recording.key, **curve_columns(list(own))} for _, own in together]


def _calibrations(plan: SubjectPlan, part: Part) -> list[Recording]:
    """Recordings that only calibrate a hand and can be posed: without the tables of its metacarpals."""
    from shukotsu.schemas.poses import usable_poses

    has_metacarpals = any(digit.metacarpal for digit in plan.layouts[part.hand].digits.values())
    if has_metacarpals and plan.models[part.model].fitting is None:
        return []
    recordings = plan.recordings_of(part.hand, "calibration")
    return [own for own in recordings if usable_poses([plan.poses(own)])[0]]


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
    from shukotsu.schemas.catalogue import TABLES as CATALOGUE
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.results import MEASURED_TABLES

    plan = read_plan(arguments.plan, arguments.inputs)
    for name in MEASURED_TABLES:
        parts = map(plan.part, plan.hands) if name == "movement_cycles" else plan.whole_parts
        tables = {arguments.out / f"{name}.parquet": CATALOGUE[name]}
        subject_stage.record_failed_parts(message, tables, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser, argv, measure, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
