"""Command line: solve joints from the poses of calibration recordings."""

from __future__ import annotations

import argparse

from shukotsu import command_line
from shukotsu.study import subject_stage

WRITES = {"out": "joint_solutions"}


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage solve_joints",
        "Find the centre and axis of every joint between two receivers (Eq. 1-7 of the paper).",
        "shukotsu stage solve_joints --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16 --model paper-fig4 --out joint_solutions.parquet",
    )
    subject_stage.add_plan_options(parser, "findings", calibration="--poses")
    command_line.add_outputs(parser, WRITES)
    return parser


def solve(arguments: argparse.Namespace) -> None:
    """Solve the joints of every hand under every model, with all tasks and without each task left out."""
    from shukotsu.errors import InputError
    from shukotsu.hand.known_digits import refusal
    from shukotsu.paper.part_solutions import solve_parts
    from shukotsu.tables.typed_table import Provenance

    plan = subject_stage.plan_of(arguments)
    if not plan.models:
        raise InputError("--model: is missing; expected a skeleton model that ships, or a path")
    provenance = Provenance.of(subject_stage.poses_files(plan), plan.folder)
    outcomes = solve_parts(plan)
    with subject_stage.writing(arguments, WRITES, provenance) as tables:
        solutions = tables["joint_solutions"]
        for part in plan.parts():
            with subject_stage.recording_failure(arguments, part, solutions):
                plan.check_calibration_left(part.hand)
                if reason := refusal(plan.layouts[part.hand], part.model, plan.models[part.model]):
                    raise InputError(reason)
                outcome = outcomes[part]
                if isinstance(outcome, Exception):
                    raise outcome
                solutions.rows(part, [{**plan.who._asdict(), **row} for row in outcome])


main = subject_stage.script(build_parser, solve, WRITES)


if __name__ == "__main__":
    raise SystemExit(main())
