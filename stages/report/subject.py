"""Command line: a subject's tables -> the report's pages of that subject and of each of its recordings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import InputError
from stages import command_line

if TYPE_CHECKING:
    from schemas.results import Results
    from schemas.study import Recording, Study


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = command_line.parser(
        "stages.report.subject",
        "Write a subject's pages of the report: one of the subject, one of each evaluated recording.",
        "python -m stages.report.subject --study config/demo.yaml --results results/demo --subject 01 "
        "--out results/demo/report/sub-01",
    )
    parser.add_argument("--study", type=Path, required=True, metavar="YAML", help="the study file")
    parser.add_argument(
        "--results", type=Path, required=True, metavar="FOLDER", help="the study's results folder"
    )
    parser.add_argument("--subject", required=True, help="the subject, as the recordings sheet names it")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FOLDER", help="where the pages go: subject.html and more"
    )
    return parser


def pages(arguments: argparse.Namespace) -> None:
    """Read the subject's tables, write its pages."""
    from schemas.files import write_text
    from schemas.results import Results
    from schemas.study import read_study
    from stages.report.study_results import read_subject
    from stages.report.subject_page import render_subject

    paths = Results(arguments.results)
    results = read_subject(read_study(arguments.study), paths.folder, arguments.subject)
    write_text(arguments.out / "subject.html", render_subject(results))
    for recording in results.study.shown:
        page = Path(recording.hand.hand, f"{recording.name}.html")
        write_text(arguments.out / page, _recording_page(results.study, paths, recording))


def _recording_page(study: Study, paths: Results, recording: Recording) -> str:
    """The recording's page, or one that says why there is none: the subject's others must not be lost."""
    from stages.report.recording.page import failure_page, recording_page, recording_title
    from stages.report.recording.reading import read_recording

    try:
        return recording_page(read_recording(study, paths, recording))
    except InputError as error:
        return failure_page(recording_title(recording), str(error))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write a page that says why there is none."""
    from schemas.files import write_text
    from stages.report.study_page import render_failure

    write_text(arguments.out / "subject.html", render_failure(message))


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), pages, record_failure)


if __name__ == "__main__":
    command_line.begin()
    sys.exit(main())
