"""Command line: a study file and its sheets -> one subject's plan."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = command_line.parser(
        "python -m workflow.write_plan",
        "Write what the stages need to know of the study about one subject, everything resolved.",
        "python -m workflow.write_plan --study config/demo.yaml --subject 01 --results results/demo "
        "--out results/demo/sub-01/plan.json",
        records_failure=False,
    )
    parser.add_argument("--study", type=Path, required=True, help="the study file")
    parser.add_argument("--results", type=Path, required=True, help="the study's results folder")
    parser.add_argument("--subject", required=True, help="the subject, as in the recordings sheet")
    parser.add_argument("--session", default="", help="the session, where the sheet names any")
    parser.add_argument("--hand", choices=("right", "left"), help="for a fit of the whole hand: which")
    parser.add_argument("--model", help="for a fit of the whole hand: under which model")
    parser.add_argument("--recordings", action="store_true", help="for their check: of the recordings alone")
    parser.add_argument("--out", type=Path, required=True, help="the plan to write")
    return parser


def write_plan(arguments: argparse.Namespace) -> None:
    """Read the study, write the subject's plan, or that of its recordings or of a fit alone."""
    from schemas.files import write_text
    from schemas.plan import StudyPlans, plan_text
    from schemas.study import read_study

    plans = StudyPlans(read_study(arguments.study), arguments.results)
    subject, session = arguments.subject, arguments.session
    content = plans.content(subject, session)
    if arguments.recordings:
        content = plans.recordings_content(subject, session)
    if arguments.model is not None:
        content = plans.fit_content(subject, arguments.hand, arguments.model, session)
    write_text(arguments.out, plan_text(content))


def main(argv: list[str] | None = None) -> int:
    """Write the plan; give the exit code."""
    return command_line.run(build_parser().parse_args(argv), write_plan)


if __name__ == "__main__":
    sys.exit(main())
