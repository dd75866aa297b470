"""Command line: the tables of every hand and model -> the study's tables and a table of failures."""

from __future__ import annotations

import argparse
import sys
from functools import partial

from shukotsu import command_line

build_parser = partial(
    command_line.study_parser,
    "gather",
    "Put the tables of every hand and model of a study together, and list what went wrong.",
)


def gather(arguments: argparse.Namespace) -> None:
    """Read the tables of every hand and write the study's."""
    from shukotsu.study.results import Results
    from shukotsu.study.study import read_study
    from shukotsu.workflow.study_tables import gather_study

    gather_study(read_study(arguments.study), Results(arguments.results))


main = command_line.script(build_parser, gather)


if __name__ == "__main__":
    sys.exit(main())
