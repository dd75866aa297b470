"""Command line: a study file -> the record of when each of its questions was first run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu.stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = command_line.parser(
        "python -m shukotsu.workflow.record_questions",
        "Add the study's new questions to the record of when each was first run. What stands there stays.",
        "python -m shukotsu.workflow.record_questions --study study.yaml --results results/study "
        "--out results/study/questions_asked.json",
        records_failure=False,
    )
    parser.add_argument("--study", type=Path, required=True, help="the study file")
    parser.add_argument("--results", type=Path, required=True, help="the study's results folder")
    parser.add_argument("--out", type=Path, required=True, help="the record to write, or to add to")
    return parser


def record_questions(arguments: argparse.Namespace) -> None:
    """Add what is new, with the time and whether results were there to be looked at."""
    import json
    from dataclasses import asdict
    from datetime import UTC, datetime

    from shukotsu.files.whole_files import write_text
    from shukotsu.schemas.movement_tables import MOVEMENT_DIFFERENCES
    from shukotsu.schemas.questions import FirstAsked, read_asked
    from shukotsu.schemas.results import Results
    from shukotsu.schemas.study import read_study

    known = read_asked(arguments.out if arguments.out.exists() else None)
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S")
    after = Results(arguments.results).study_table(MOVEMENT_DIFFERENCES.name).exists()
    recorded = {own.digest for own in known}
    questions = [own for own in read_study(arguments.study).questions if own.digest not in recorded]
    known += [FirstAsked(own.digest, own.name, now, after) for own in questions]
    entries = ",\n".join(json.dumps(asdict(own), ensure_ascii=False) for own in known)
    write_text(arguments.out, f"[\n{entries}\n]\n")


def main(argv: list[str] | None = None) -> int:
    """Write the record; give the exit code."""
    return command_line.run(build_parser, argv, record_questions)


if __name__ == "__main__":
    sys.exit(main())
