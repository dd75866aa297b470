"""Command line: a subject's tables -> the report's pages of that subject and of each of its recordings."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu import command_line, job
from shukotsu.errors import InputError

if TYPE_CHECKING:
    from shukotsu.report.study_results import StudyResults
    from shukotsu.study.study import Recording

    Page = tuple[Callable[[], str], Callable[[str], str]]
    """What makes a page, and the one that says why there is none."""


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage report.subject",
        "Write a subject's pages of the report: one of the subject, one of each evaluated recording.",
        "shukotsu stage report.subject --plan results/demo/sub-01/plan.json --out results/demo/report/sub-01",
    )
    parser.add_argument("--plan", type=Path, required=True, metavar="JSON", help="the subject's plan")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FOLDER", help="where the pages go: subject.html and more"
    )
    parser.add_argument(
        "--language",
        default="en",
        metavar="CODE",
        help="the pages' language, as in the study file (default: en)",
    )
    parser.add_argument(
        "--recording",
        nargs=2,
        metavar=("HAND", "NAME"),
        help="write the page of this recording alone, e.g. right opposition (with a trial: opposition_2)",
    )
    return parser


def write_pages(arguments: argparse.Namespace) -> None:
    """Read the subject's tables, write its pages; one that cannot be made says why, and costs no other."""
    from functools import partial

    from shukotsu.report.plots.panels import taken_failures
    from shukotsu.report.recording_page import failure_page, recording_title
    from shukotsu.report.study_page import render_failure
    from shukotsu.report.study_results import read_subject
    from shukotsu.report.subject_page import render_subject
    from shukotsu.report.wording import check_language, speaking
    from shukotsu.study.plan import plan_of_results
    from shukotsu.tables.whole_files import write_text

    check_language(arguments.language, "--language")
    results = read_subject(plan_of_results(arguments.plan))
    with speaking(arguments.language):
        pages: dict[Path, Page] = {}
        if not arguments.recording:
            pages[Path("subject.html")] = partial(render_subject, results), render_failure
        for own in [_named(results, *arguments.recording)] if arguments.recording else results.shown:
            pages[_page(own)] = (
                partial(_recording_page, results, own),
                partial(failure_page, recording_title(own)),
            )
        failures = []
        for page, (make, say_why) in pages.items():
            with command_line.recorded(arguments, arguments.record_failure) as messages:
                write_text(arguments.out / page, make())
            failures += [f"{page.as_posix()}: {message}" for message in taken_failures()]
            for message in messages:
                write_text(arguments.out / page, say_why(message))
                failures.append(f"{page.as_posix()}: {message}")
    if not arguments.recording:
        _write_failures(arguments.out, failures)


def _page(recording: Recording) -> Path:
    """The recording's page in the subject's folder of pages."""
    return Path(recording.hand.hand, f"{recording.name}.html")


def _write_failures(folder: Path, failures: Sequence[str]) -> None:
    """Write which pages could not be made into a file that the study's report reads; none without any."""
    from shukotsu.study.results import FAILED_PAGES
    from shukotsu.tables.whole_files import write_text

    if failures:
        write_text(folder / FAILED_PAGES, "".join(f"{line}\n" for line in failures))
    else:
        (folder / FAILED_PAGES).unlink(missing_ok=True)


def _named(results: StudyResults, hand: str, name: str) -> Recording:
    for recording in results.shown:
        if (recording.hand.hand, recording.name) == (hand, name):
            return recording
    known = ", ".join(f"{recording.hand.hand} {recording.name}" for recording in results.shown)
    raise InputError(f"--recording {hand} {name}: is not evaluated; expected one of: {known or 'none'}")


def _recording_page(results: StudyResults, recording: Recording) -> str:
    """The recording's page, or one that says why there is none: the subject's others must not be lost."""
    from shukotsu.report.recording_page import failure_page, recording_page, recording_title
    from shukotsu.report.recording_results import read_recording

    try:
        return recording_page(read_recording(results, recording))
    except InputError as error:
        return failure_page(recording_title(recording), error.message)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write pages that say why there is none; where the plan cannot be read, that of the subject alone."""
    from shukotsu.report.study_page import render_failure
    from shukotsu.report.wording import languages, speaking
    from shukotsu.study.plan import plan_of_results
    from shukotsu.tables.whole_files import write_text

    shown: list[Recording] = []
    with suppress(InputError):
        plan = plan_of_results(arguments.plan)
        shown = [own for hand in plan.hands for own in plan.evaluated(hand)]
    with speaking(arguments.language if arguments.language in languages() else "en"):
        for page in (Path("subject.html"), *map(_page, shown)):
            write_text(arguments.out / page, render_failure(message))
    _write_failures(arguments.out, [f"subject.html: {message}"])


def main(argv: list[str] | None = None) -> int:
    """Run the stage on the arguments of a command line; give its exit code."""
    return command_line.run(build_parser, argv, write_pages, record_failure)


if __name__ == "__main__":
    sys.exit(job.run(main))
