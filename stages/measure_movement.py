"""Command line: measure movement from poses, skeletons, fits and events."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.study import results, subject_stage

if TYPE_CHECKING:
    from shukotsu.tables.parts import Part

WRITES = {"out": results.MEASURED_TABLES}
POSED = ("joint_angles", "posed_tips", "bone_poses")


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage measure_movement",
        "Measure movement in every recording: ranges, speeds, cycles, paths of the fingertips, and strokes "
        "at events.",
        "shukotsu stage measure_movement --poses opposition/poses.parquet "
        "--joint-centres joint_centres.parquet --bone-lengths bone_lengths.parquet "
        "--metacarpals metacarpals.parquet --layout liberty16 --model paper-fig4 --out measured",
    )
    tables = ("findings", *results.SKELETON_TABLES, *POSED, "moved_receivers", "events", "clocks")
    subject_stage.add_plan_options(parser, *tables, calibration="--calibration", evaluated="--poses")
    command_line.add_outputs(parser, WRITES)
    return parser


def measure(arguments: argparse.Namespace) -> None:
    """Measure every recording under every skeleton that is made from all tasks, and write the tables."""
    from shukotsu.movement.movement_rows import measure_hand

    plan = subject_stage.plan_of(arguments)
    made_of = [plan.table(name) for name in results.SKELETON_TABLES]
    made_of += [plan.table(name, *fit) for name in POSED for fit in plan.fits_of_hands()]
    files = [*subject_stage.poses_files(plan), *arguments.events, *arguments.clocks]
    provenance = subject_stage.provenance_of(plan, made_of, files)
    with subject_stage.writing(arguments, WRITES, provenance) as tables:
        for hand in plan.hands:
            measure_hand(arguments, plan, hand, tables)


def parts(arguments: argparse.Namespace, table: str) -> list[Part]:
    """Return the parts of a table of the stage: hands, or skeletons made from all tasks."""
    if table == "movement_cycles":
        return subject_stage.hands_of(arguments)
    return subject_stage.plan_of(arguments).whole_parts


main = subject_stage.script(build_parser, measure, WRITES, parts)


if __name__ == "__main__":
    raise SystemExit(main())
