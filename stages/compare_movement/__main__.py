"""Command line: a study's tables of movement -> how its subjects, sessions and tasks differ."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu.stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage compare_movement",
        "Compare the movement of a study's subjects over its factors, say how well it repeats, and whether "
        "the skeleton model changes the answer.",
        "shukotsu stage compare_movement --study config/demo.yaml --results results/demo",
        records_failure=False,
    )
    parser.add_argument("--study", type=Path, required=True, help="the study file")
    parser.add_argument("--results", type=Path, required=True, help="the study's results folder")
    parser.add_argument("--asked", type=Path, help="the record of when each question was first run")
    return parser


def compare(arguments: argparse.Namespace) -> None:
    """Read the study's tables of movement, write those of comparisons."""
    from shukotsu.anatomy.known_digits import leading_model
    from shukotsu.schemas.factors import factor_levels, not_compared
    from shukotsu.schemas.model import read_model
    from shukotsu.schemas.questions import read_asked
    from shukotsu.schemas.results import Results
    from shukotsu.schemas.study import read_study
    from shukotsu.stages.compare_movement.study_comparison import Questions, compare_study

    study = read_study(arguments.study)
    left = not_compared(study)
    for factor, message in left.items():
        print(f"note: factor {factor}: {message}", file=sys.stderr)
    models = {name: read_model(path.absolute()) for name, path in study.models.items()}
    layouts = [study.judged_layout(hand) for hand in study.hands]
    asked = {own.digest: (own.first_asked, own.after_results) for own in read_asked(arguments.asked)}
    compare_study(
        factor_levels(study),
        [name for name in study.factors if name not in left],
        Results(arguments.results),
        list(study.sheets.values()),
        Questions(study.questions, leading_model(models, layouts), asked),
    )


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser, argv, compare)


if __name__ == "__main__":
    sys.exit(main())
