"""Command line: poses of the calibration recordings -> joint_solutions table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line

if TYPE_CHECKING:
    from schemas.plan import SubjectPlan
    from stages.solve_joints.part_solutions import PartRequest


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage solve_joints",
        "Find the centre and axis of every joint between two receivers (Eq. 1-7 of the paper).",
        "shukotsu stage solve_joints --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16 --model paper-fig4 --out joint_solutions.parquet",
    )
    command_line.add_plan_options(parser, calibration="--poses", sizes=("hand_length_mm",))
    parser.add_argument("--out", type=Path, required=True, help="the joint_solutions table to write")
    return parser


def solve(arguments: argparse.Namespace) -> None:
    """Solve the joints of every hand under every model, also without each task that is left out in turn."""
    from schemas.catalogue import JOINT_SOLUTIONS
    from schemas.errors import InputError
    from schemas.parts import parts_writer
    from schemas.tables import Provenance
    from stages.solve_joints.part_solutions import solve_parts

    plan = command_line.plan_of(arguments)
    if not plan.models:
        raise InputError("--model: none is given; expected a skeleton model that ships, or a path")
    provenance = Provenance.of(command_line.poses_files(plan), plan.folder)
    outcomes = solve_parts(part_requests(plan))
    with parts_writer(arguments.out, JOINT_SOLUTIONS, provenance) as write:
        for part, outcome in outcomes.items():
            with command_line.recording_failure(arguments, part, write):
                plan.check_calibration_left(part.hand)
                if isinstance(outcome, Exception):
                    raise outcome
                write.rows(part, [{**plan.who._asdict(), **row} for row in outcome])


def part_requests(plan: SubjectPlan) -> list[PartRequest]:
    """Give what every part of the plan is to be solved from."""
    from stages.solve_joints.part_solutions import PartRequest
    from stages.solve_joints.solve import HandDescription, SolverSettings

    return [
        PartRequest(
            part,
            tuple(plan.poses(r) for r in plan.calibrating(part.hand, part.model, part.made_without)),
            plan.layouts[part.hand],
            SolverSettings.of(plan.models[part.model]),
            HandDescription(part.hand, plan.hand_length_mm),
        )
        for part in plan.parts()
    ]


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no joint was solved, of every part."""
    from schemas.catalogue import JOINT_SOLUTIONS

    parts = command_line.plan_of(arguments).parts()
    command_line.record_failed_parts(message, {arguments.out: JOINT_SOLUTIONS}, parts)


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser().parse_args(argv), solve, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
