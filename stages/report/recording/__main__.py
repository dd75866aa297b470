"""Command line of the recording's page: one evaluated recording of a study -> one HTML page."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.report.recording",
        "Write the page of one evaluated recording: the moving hand, plots that follow it, its numbers.",
        "python -m stages.report.recording --study config/demo.yaml --results results/demo --subject 01 "
        "--hand right --recording opposition "
        "--out results/demo/report/sub-01/right/opposition.html",
    )
    parser.add_argument("--study", type=Path, required=True, metavar="YAML", help="the study file")
    parser.add_argument(
        "--results", type=Path, required=True, metavar="FOLDER", help="the study's results folder"
    )
    parser.add_argument("--subject", required=True, help="whose hand it is, as in the recordings sheet")
    parser.add_argument("--hand", required=True, choices=("right", "left"))
    parser.add_argument(
        "--recording", required=True, help="the recording's folder below the hand's: its task (and trial)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="HTML", help="the page to write")
    return parser


def write_page(arguments: argparse.Namespace) -> None:
    """Read what belongs to the recording and write its page."""
    from schemas.files import write_text
    from schemas.results import Results
    from schemas.study import Hand, read_study
    from stages.report.recording.page import recording_page
    from stages.report.recording.reading import evaluated_recording, read_recording

    study = read_study(arguments.study)
    recording = evaluated_recording(study, Hand(arguments.subject, arguments.hand), arguments.recording)
    results = read_recording(study, Results(arguments.results), recording)
    write_text(arguments.out, recording_page(results))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write a page that says why there is none of this recording."""
    from schemas.files import write_text
    from stages.report.recording.page import failure_page

    title = f"Subject {arguments.subject}, {arguments.hand} hand, {arguments.recording}"
    write_text(arguments.out, failure_page(title, message))


if __name__ == "__main__":
    sys.exit(command_line.run(build_parser().parse_args(), write_page, record_failure))
