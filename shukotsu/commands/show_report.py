"""Command line: print the path of a study's report, print its outcome, or open it."""

from __future__ import annotations

import argparse
import sys
from shlex import quote

from shukotsu import command_line
from shukotsu.commands import add_study, read_files
from shukotsu.errors import InputError


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu report",
        "Print the path of the report of a study that was run in this folder, or its outcome, or open it.",
        "shukotsu report study.yaml --print",
    )
    add_study(parser)
    outcome = "print the three numbers and the sentence that it begins with, and the most severe problems"
    parser.add_argument("--print", action="store_true", dest="to_terminal", help=outcome)
    parser.add_argument("--open", action="store_true", help="open it in the browser")
    return parser


def show_report(arguments: argparse.Namespace) -> None:
    """Print or open what the options request. Raises InputError if the study was not run in this folder."""
    files = read_files(arguments.study)
    report = files.results.report
    if not report.is_file():
        what = f"run `shukotsu run {quote(str(arguments.study))}` in this folder first"
        raise InputError(f"{report}: does not exist yet; {what}")
    if arguments.to_terminal:
        from shukotsu.report.judged_models import outcome_text
        from shukotsu.report.study_results import read_results

        print(outcome_text(read_results(files.study, files.results.folder)))
    print(report)
    if arguments.open:
        import webbrowser

        if not webbrowser.open(report.resolve().as_uri()):
            print("note: found no browser here; open that file in one", file=sys.stderr)


main = command_line.script(build_parser, show_report)
