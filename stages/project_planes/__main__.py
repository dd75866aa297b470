"""Command line: joint_solutions -> joint_centres table (without the wrist point)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from shukotsu.schemas.parts import Part
    from shukotsu.schemas.plan import SubjectPlan


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage project_planes",
        "Cut every joint's axis with its plane (end of the paper's section 4); apply manual corrections.",
        "shukotsu stage project_planes --joints joint_solutions.parquet --layout liberty16 "
        "--model paper-fig4 --out projected_joints.parquet",
    )
    subject_stage.add_plan_options(parser, sheets=("corrections",))
    parser.add_argument("--joints", type=Path, required=True, help="joint_solutions of the same hands")
    parser.add_argument("--out", type=Path, required=True, help="the joint_centres table to write")
    return parser


def project_planes(arguments: argparse.Namespace) -> None:
    """Place every joint of every skeleton of the plan, write the table."""
    from shukotsu.schemas.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS
    from shukotsu.schemas.parts import parts_writer

    plan = subject_stage.plan_of(arguments, (arguments.joints, JOINT_SOLUTIONS))
    files = subject_stage.config_files(arguments)
    files += [] if plan.is_study else plan.sheets.values()  # a study's hold other subjects' rows as well
    provenance = subject_stage.provenance_of(plan, [arguments.joints], files)
    with parts_writer(arguments.out, JOINT_CENTRES, provenance) as joints:
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, joints):
                joints.rows(part, _placed_rows(arguments.joints, plan, part))


def _placed_rows(joints_file: Path, plan: SubjectPlan, part: Part) -> list[dict[str, Any]]:
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import JOINT_SOLUTIONS
    from shukotsu.schemas.parts import read_part
    from shukotsu.schemas.tables import rows_of, vector_of
    from shukotsu.stages.project_planes.place import place_joint

    layout, model = plan.layouts[part.hand], plan.models[part.model]
    rows_of_hand = [row for row in plan.corrections if row["hand"] == part.hand and model.planes.corrections]
    corrections_mm = {row["joint"]: vector_of(row.values, "d", "_mm") for row in rows_of_hand}
    rows = []
    for solution in rows_of(read_part(joints_file, JOINT_SOLUTIONS, part)):
        joint = layout.joints.get(solution["joint"])
        if joint is None:
            raise InputError(
                f"{joints_file}: joint {solution['joint']} is not in layout {layout.name}; "
                "give the layout that the joints were solved with"
            )
        row = place_joint(joint, layout, solution, model, corrections_mm.get(joint.name))
        rows.append({**plan.who._asdict(), **row})
    return rows


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no joint was placed, of every part."""
    from shukotsu.schemas.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS

    parts = subject_stage.plan_of(arguments, (arguments.joints, JOINT_SOLUTIONS)).parts()
    subject_stage.record_failed_parts(message, {arguments.out: JOINT_CENTRES}, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, project_planes, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
