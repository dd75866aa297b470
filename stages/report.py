"""Command line: write the study's page of the report."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line
from shukotsu.errors import InputError


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage report",
        "Write the page of a study's results, which opens offline. "
        "The pages that it links to are written by the stage subject_pages.",
        "shukotsu stage report --study config/demo.yaml --results results/demo "
        "--out results/demo/report.html",
    )
    command_line.add_study_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="HTML", help="the page to write")
    return parser


def report(arguments: argparse.Namespace) -> None:
    """Read the study's results and write the page, or a page that states why it cannot be made."""
    from shukotsu.report.study_page import render_failure, render_study
    from shukotsu.report.study_results import read_results
    from shukotsu.report.templates import speaking
    from shukotsu.study.study import read_study
    from shukotsu.tables.whole_files import write_text

    study = read_study(arguments.study)
    results = read_results(study, arguments.results)
    with speaking(study.language):
        with command_line.keep_failure(arguments, record=True) as messages:
            write_text(arguments.out, render_study(results, study))
        for message in messages:
            write_text(arguments.out, render_failure(message))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write a page that states why there is no report."""
    from shukotsu.report.study_page import render_failure
    from shukotsu.report.templates import speaking
    from shukotsu.tables.whole_files import write_text

    with speaking(_language(arguments.study)):
        write_text(arguments.out, render_failure(message))


def _language(study: Path) -> str:
    """Return the study's language, or English if its file cannot be read."""
    from shukotsu.report.templates import check_language
    from shukotsu.study.config_files import read_config

    try:
        language = str(read_config(study, "study")["language"])
        check_language(language)
    except InputError:
        return "en"
    return language


main = command_line.script(build_parser, report, record_failure)


if __name__ == "__main__":
    raise SystemExit(main())
