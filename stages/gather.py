"""Command line: combine the subjects' tables into the study's tables, and list all problems."""

from __future__ import annotations

import argparse
from functools import partial

from shukotsu import command_line

build_parser = partial(
    command_line.study_parser,
    "gather",
    "Combine the tables of all hands and models of a study, and list what went wrong.",
)


def gather(arguments: argparse.Namespace) -> None:
    """Read the subjects' tables and write the study's."""
    from shukotsu.study.results import Results
    from shukotsu.study.study import read_study
    from shukotsu.workflow.study_tables import gather_study

    gather_study(read_study(arguments.study), Results(arguments.results))


main = command_line.script(build_parser, gather)


if __name__ == "__main__":
    raise SystemExit(main())
