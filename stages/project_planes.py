"""Command line: cut the axes of joint_solutions with their planes to get joint centres."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.study import subject_stage

WRITES = {"out": "projected_joints"}


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage project_planes",
        "Cut every joint's axis with its plane (end of the paper's section 4); apply manual corrections.",
        "shukotsu stage project_planes --joint-solutions joint_solutions.parquet --layout liberty16 "
        "--model paper-fig4 --out projected_joints.parquet",
    )
    subject_stage.add_plan_options(parser, "findings", "joint_solutions", sheets=("corrections",))
    command_line.add_outputs(parser, WRITES)
    return parser


def project_planes(arguments: argparse.Namespace) -> None:
    """Place every joint of every skeleton of the plan and write the table."""
    from shukotsu.paper.plane import place_joints

    plan = subject_stage.plan_of(arguments)
    solutions = plan.table("joint_solutions")
    files = subject_stage.config_files(arguments)
    files += [] if plan.is_study else plan.sheets.values()  # a study's also have rows of other subjects
    provenance = subject_stage.provenance_of(plan, [solutions], files)
    with subject_stage.writing(arguments, WRITES, provenance) as tables:
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, *tables.values()):
                tables["projected_joints"].rows(part, place_joints(solutions, plan, part))


main = subject_stage.script(build_parser, project_planes, WRITES)


if __name__ == "__main__":
    raise SystemExit(main())
