"""Command line: write the report's pages of a subject and of each of its recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from shukotsu import command_line


def build_parser() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = command_line.parser(
        "shukotsu stage subject_pages",
        "Write a subject's pages of the report: one for the subject, and one for each recording.",
        "shukotsu stage subject_pages --plan results/demo/sub-01/plan.json --out results/demo/report/sub-01",
    )
    add = parser.add_argument
    add("--plan", type=Path, required=True, metavar="JSON", help="the subject's plan")
    pages = "where the pages go: subject.html and more"
    add("--out", type=Path, required=True, metavar="FOLDER", help=pages)
    language = "the pages' language, as in the study file (default: en)"
    add("--language", default="en", metavar="CODE", help=language)
    return parser


def write_pages(arguments: argparse.Namespace) -> None:
    """Write the pages of the subject in the plan."""
    from shukotsu.report import subject_page  # not at start-up: --help needs no NumPy

    subject_page.write_pages(arguments)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write pages that state why no page could be made."""
    from shukotsu.report import subject_page

    subject_page.record_failure(arguments, message)


main = command_line.script(build_parser, write_pages, record_failure)


if __name__ == "__main__":
    raise SystemExit(main())
