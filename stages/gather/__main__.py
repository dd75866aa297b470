"""Command line: the tables of every hand and model -> the study's tables, what failed named."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.gather",
        "Put the tables of every hand and model of a study together, and list what went wrong.",
        "python -m stages.gather --study config/demo.yaml --results results/demo",
    )
    parser.add_argument("--study", type=Path, required=True, help="the study file")
    parser.add_argument("--results", type=Path, required=True, help="the study's results folder")
    return parser


def gather(arguments: argparse.Namespace) -> None:
    """Read what the hands wrote, write the study's tables."""
    from schemas.results import Results
    from schemas.study import read_study
    from stages.gather.study_tables import gather_study

    gather_study(read_study(arguments.study), Results(arguments.results))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the study's tables without rows and the reason."""
    from schemas.catalogue import TABLES
    from schemas.results import STUDY_TABLES, Results
    from schemas.tables import Provenance, write_failure

    for name in STUDY_TABLES:
        write_failure(Results(arguments.results).study_table(name), TABLES[name], message, Provenance())


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), gather, record_failure)


if __name__ == "__main__":
    command_line.begin()
    sys.exit(main())
