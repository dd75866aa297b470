"""Command line: poses, skeletons and fits, and events -> the subject's tables of strokes."""

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
    from shukotsu.stages.measure_events.struck_events import StruckEvent


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage measure_events",
        "Measure what fingers do at a keystroke: which struck, when, how fast, at which angles, and how far "
        "the others went along.",
        "shukotsu stage measure_events --plan results/demo/sub-01/plan.json --events "
        "results/demo/sub-01/events.parquet --out results/demo/sub-01",
    )
    subject_stage.add_plan(parser, "the subject's plan, whose folder holds its tables", required=True)
    parser.add_argument("--events", type=Path, required=True, help="the subject's events table")
    parser.add_argument("--clocks", type=Path, help="its clocks table (default: every clock is trusted)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def measure(arguments: argparse.Namespace) -> None:
    """Measure every stroke of every evaluated recording under every whole skeleton, write the tables."""
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.results import EVENT_TABLES
    from shukotsu.stages.measure_events.struck_events import struck_events

    plan = read_plan(arguments.plan, arguments.inputs)
    with subject_stage.measured_tables(arguments, plan, EVENT_TABLES) as tables:
        for hand in plan.hands:
            events: Mapping[Recording, Sequence[StruckEvent]] = {}
            for part in (part for part in plan.whole_parts if part.hand == hand):
                with subject_stage.recording_failure(arguments, part, *tables.values()):
                    events = events or struck_events(plan, hand, arguments.events, arguments.clocks)
                    _measure_part(plan, part, events, tables)


def _measure_part(
    plan: SubjectPlan,
    part: Part,
    events: Mapping[Recording, Sequence[StruckEvent]],
    tables: Mapping[str, PartsWriter],
) -> None:
    """Write the rows of one model."""
    from shukotsu.anatomy.recorded_movement import read_movement, unsolved
    from shukotsu.schemas.poses import usable_poses
    from shukotsu.skeleton.posed_recording import posed_recording
    from shukotsu.stages.measure_events import event_rows
    from shukotsu.stages.measure_events.strokes import measure_strokes

    for table in tables.values():
        table.rows(part, [])
    for recording, own in events.items():
        if not usable_poses([plan.poses(recording)])[0]:
            continue  # its import failed: the recordings table says why
        posed = posed_recording(plan, recording, part.model)
        if unsolved(posed):
            continue
        movement = read_movement(posed)
        digits = list(movement.fingertips)
        strokes, found = measure_strokes(movement, own)
        angles = list(event_rows.angle_rows(movement, strokes))
        independence = event_rows.independence_rows(strokes, digits)
        rows: dict[str, Iterable[dict[str, Any]]] = {
            "event_strokes": event_rows.stroke_rows(strokes),
            "event_angles": angles,
            "event_independence": independence,
            "event_measures": event_rows.measure_rows(strokes, angles, independence, found, digits),
        }
        for name, new in rows.items():
            tables[name].rows(part, [{**recording.key, **row} for row in new])


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why nothing was measured, of every part."""
    from shukotsu.schemas.catalogue import TABLES as CATALOGUE
    from shukotsu.schemas.plan import read_plan
    from shukotsu.schemas.results import EVENT_TABLES

    plan = read_plan(arguments.plan, arguments.inputs)
    tables = {arguments.out / f"{name}.parquet": CATALOGUE[name] for name in EVENT_TABLES}
    subject_stage.record_failed_parts(message, tables, plan.whole_parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser, argv, measure, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
