"""Command line: compare a study's skeleton models by their scores and joint errors."""

from __future__ import annotations

import argparse
from functools import partial

from shukotsu import command_line

build_parser = partial(
    command_line.study_parser,
    "compare_models",
    "Compare a study's skeleton models over its subjects: every subject's number under each model, and "
    "tests of the differences between models.",
)


def compare(arguments: argparse.Namespace) -> None:
    """Read the study's scores and errors and write the tables of comparisons."""
    from shukotsu.scores.comparisons import compare_study
    from shukotsu.study.results import Results
    from shukotsu.study.study import read_study

    compare_study(read_study(arguments.study), Results(arguments.results))


main = command_line.script(build_parser, compare)


if __name__ == "__main__":
    raise SystemExit(main())
