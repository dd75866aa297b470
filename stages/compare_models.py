"""Command line: a study's scores and joint errors -> how its skeleton models compare."""

from __future__ import annotations

import argparse
import sys

from shukotsu import command_line, job


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage compare_models",
        "Compare a study's skeleton models over its subjects: every subject's number under each model, and "
        "what the differences say of two models.",
        "shukotsu stage compare_models --study config/demo.yaml --results results/demo",
        records_failure=False,
    )
    command_line.add_study_options(parser)
    return parser


def compare(arguments: argparse.Namespace) -> None:
    """Read the study's scores and errors, write the tables of comparisons."""
    from shukotsu.scores.comparisons import compare_study
    from shukotsu.study.results import Results
    from shukotsu.study.study import read_study

    compare_study(read_study(arguments.study), Results(arguments.results))


main = command_line.script(build_parser, compare)


if __name__ == "__main__":
    sys.exit(job.run(main))
