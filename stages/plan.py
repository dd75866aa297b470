"""Command line: write one subject's plan from a study file and its sheets."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage plan",
        "Write all that the stages need to know of the study about one subject, with all settings resolved.",
        "shukotsu stage plan --study config/demo.yaml --subject 01 --results results/demo "
        "--out results/demo/sub-01/plan.json",
    )
    command_line.add_study_options(parser)
    parser.add_argument("--subject", required=True, help="the subject, as in the recordings sheet")
    parser.add_argument("--session", default="", help="the session, if the sheet names any")
    parser.add_argument("--out", type=Path, required=True, help="the plan to write")
    return parser


def write_plan(arguments: argparse.Namespace) -> None:
    """Read the study and write the subject's plan."""
    from shukotsu.study.plan_file import StudyPlans, plan_text
    from shukotsu.study.study import read_study
    from shukotsu.tables.whole_files import write_text

    plans = StudyPlans(read_study(arguments.study), arguments.results)
    write_text(arguments.out, plan_text(plans.content(arguments.subject, arguments.session)))


main = command_line.script(build_parser, write_plan)


if __name__ == "__main__":
    raise SystemExit(main())
