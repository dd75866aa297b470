"""Command line: compare a study's movement between levels of its factors, sessions and trials."""

from __future__ import annotations

import argparse
import sys
from functools import partial

from shukotsu import command_line

build_parser = partial(
    command_line.study_parser,
    "compare_movement",
    "Compare the movement of a study's subjects between factor levels, and state how well it repeats.",
)


def compare(arguments: argparse.Namespace) -> None:
    """Read the study's tables of movement and write the tables of comparisons."""
    from shukotsu.movement.study_comparison import compare_study
    from shukotsu.study.results import Results
    from shukotsu.study.study import factor_levels, not_compared, read_study

    study = read_study(arguments.study)
    left = not_compared(study)
    for factor, message in left.items():
        print(f"note: factor {factor}: {message}", file=sys.stderr)
    factors, results = [name for name in study.factors if name not in left], Results(arguments.results)
    compare_study(factor_levels(study), factors, results, list(study.sheets.values()))


main = command_line.script(build_parser, compare)


if __name__ == "__main__":
    raise SystemExit(main())
