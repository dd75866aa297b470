"""Command line: poses of the calibration recordings -> joint_solutions table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu.stages import command_line, subject_stage


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage solve_joints",
        "Find the centre and axis of every joint between two receivers (Eq. 1-7 of the paper).",
        "shukotsu stage solve_joints --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16 --model paper-fig4 --out joint_solutions.parquet",
    )
    subject_stage.add_plan_options(parser, calibration="--poses")
    parser.add_argument("--out", type=Path, required=True, help="the joint_solutions table to write")
    return parser


def solve(arguments: argparse.Namespace) -> None:
    """Solve the joints of every hand under every model, also without each task that is left out in turn."""
    from shukotsu.anatomy.known_digits import refusal
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import JOINT_SOLUTIONS
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.tables import Provenance
    from shukotsu.stages.solve_joints.part_solutions import PartRequest, solve_parts

    plan = subject_stage.plan_of(arguments)
    if not plan.models:
        raise InputError("--model: none is given; expected a skeleton model that ships, or a path")
    provenance = Provenance.of(subject_stage.poses_files(plan), plan.folder)
    requests = [
        PartRequest(
            part,
            tuple(plan.poses(r) for r in plan.calibrating(part.hand, part.model, part.made_without)),
            plan.layouts[part.hand],
            plan.models[part.model].solving,
        )
        for part in plan.parts()
    ]
    outcomes = solve_parts(requests)
    with parts_writer(arguments.out, JOINT_SOLUTIONS, provenance) as write:
        for part, outcome in outcomes.items():
            with subject_stage.recording_failure(arguments, part, write):
                plan.check_calibration_left(part.hand)
                if reason := refusal(plan.layouts[part.hand], part.model, plan.models[part.model]):
                    raise InputError(reason)
                if isinstance(outcome, Exception):
                    raise outcome
                write.rows(part, [{**plan.who._asdict(), **row} for row in outcome])


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no joint was solved, of every part."""
    from shukotsu.schemas.catalogue import JOINT_SOLUTIONS

    parts = subject_stage.plan_of(arguments).parts()
    subject_stage.record_failed_parts(message, {arguments.out: JOINT_SOLUTIONS}, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; return its exit code."""
    return command_line.run(build_parser, argv, solve, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
