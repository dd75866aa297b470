"""Command line: the questions of a study that was run -> how many subjects and sessions would answer them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.commands.study_file import add_study, read_files
from shukotsu.errors import InputError, listed
from shukotsu.stages import command_line

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Planned = tuple[Mapping[str, Any], Mapping[int, Sequence[float]]]
    """A row of questions, and its shares by number of sessions, 0 for as many as there are."""

SUBJECTS = (5, 6, 8, 10, 12, 16, 20, 30)
SESSIONS = (1, 2, 3)
FEWEST_SUBJECTS, MOST = 4, 1000
POWER = 0.8
"""That studies are usually planned for: the line in the figure."""


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu plan",
        "Say how many subjects would answer a question of a study, or a pilot, that was run: in what share "
        "of studies the difference would be shown, by the spread that its own subjects and sessions have.",
        "shukotsu plan study.yaml --question 'trained bend further' --difference 8 --figure power.svg",
        records_failure=False,
    )
    add = parser.add_argument
    add_study(parser)
    add("--question", metavar="NAME", help="this question alone (default: each)")
    add("--difference", type=float, help="the true difference, in the question's unit (default: as was seen)")
    add("--subjects", type=_subjects, nargs="+", default=SUBJECTS, metavar="N", help="subjects in each group")
    add(
        "--sessions",
        type=_sessions,
        nargs="+",
        default=SESSIONS,
        metavar="N",
        help="sessions of each subject",
    )
    add("--figure", type=_figure, metavar="FILE", help="draw it as well: .svg or .png")
    return parser


def _subjects(text: str) -> int:
    return _count(text, FEWEST_SUBJECTS)


def _sessions(text: str) -> int:
    return _count(text, 1)


def _count(text: str, least: int) -> int:
    if not text.isdecimal() or not least <= int(text) <= MOST:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} to {MOST}")
    return int(text)


def _figure(text: str) -> Path:
    if not text.endswith((".svg", ".png")):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a file that ends in .svg or .png")
    return Path(text)


def plan_study(arguments: argparse.Namespace) -> None:
    """Print the shares, a table a question. Raises InputError where there is nothing to tell them by."""
    from shukotsu.schemas.movement_tables import QUESTIONS
    from shukotsu.schemas.tables import read_table, rows_of

    files = read_files(arguments.study)
    path = files.results.study_table(QUESTIONS.name)
    if not path.is_file():
        raise InputError(
            f"{path}: is not there yet; run `shukotsu run {arguments.study}` in this folder first"
        )
    rows = list(rows_of(read_table(path, QUESTIONS)))
    asked = [row for row in rows if arguments.question in (None, row["question"])]
    if not asked:
        known = listed([row["question"] for row in rows]) if rows else "none (docs/studies.md#questions)"
        wanted = "question" if arguments.question is None else f"question {arguments.question!r}"
        raise InputError(f"{arguments.study}: questions: has no {wanted}; it has {known}")
    planned = [(row, _shares(row, arguments, len(rows))) for row in asked if _is_planned(row, arguments)]
    for row, shares in planned:
        print(_table(row, shares, arguments))
    if arguments.figure and planned:
        _draw(planned, arguments)


def _is_planned(row: Mapping[str, Any], arguments: argparse.Namespace) -> bool:
    """Say whether a question can be planned; if not, print why."""
    reason = ""
    if not row["level"]:
        reason = "a covariate's slope depends on whom you find; not planned"
    elif row["subject_sd"] is None or not row["subject_sd"] > 0:
        reason = "too few subjects have a number to tell how they scatter"
    elif arguments.difference is None and not row["difference"]:
        reason = "no difference was seen; give one by --difference"
    if reason:
        print(f"note: {row['question']}: {reason}", file=sys.stderr)
    return not reason


def _shares(row: Mapping[str, Any], arguments: argparse.Namespace, among: int) -> dict[int, list[float]]:
    """Shares by number of sessions, one for each number of subjects."""
    from shukotsu.statistics.power import power, spread_of_means

    difference = row["difference"] if arguments.difference is None else arguments.difference
    n_groups = 2 ** row["design"].split(";").count("between")
    spreads = {None: row["subject_sd"]}
    if row["session_sd"] is not None:
        seen = row["n_sessions"]
        spreads = {
            n: spread_of_means(row["subject_sd"], row["session_sd"], seen, n) for n in arguments.sessions
        }
    return {
        sessions or 0: [power(n_groups, spread, difference, n, among) for n in arguments.subjects]
        for sessions, spread in spreads.items()
    }


def _heads(shares: Mapping[int, Sequence[float]]) -> list[str]:
    return [f"{n} session{'s' * (n > 1)}" if n else "sessions as now" for n in shares]


def _each(row: Mapping[str, Any]) -> str:
    return "subjects in each group" if "between" in row["design"] else "subjects"


def _table(
    row: Mapping[str, Any], shares: Mapping[int, Sequence[float]], arguments: argparse.Namespace
) -> str:
    difference = row["difference"] if arguments.difference is None else arguments.difference
    session = "" if row["session_sd"] is None else f", of one session {row['session_sd']:.3g}"
    lines = [
        f"{row['question']}: a difference of {difference:.3g} {row['unit']}, spread of subjects "
        f"{row['subject_sd']:.3g}{session}; percent of studies that show it",
        "  ".join([_each(row), *_heads(shares)]),
    ]
    for place, n in enumerate(arguments.subjects):
        cells = [
            f"{100 * own[place]:{len(head)}.0f}"
            for own, head in zip(shares.values(), _heads(shares), strict=True)
        ]
        lines.append("  ".join([f"{n:>{len(_each(row))}}", *cells]))
    return "\n".join([*lines, ""])


def _draw(planned: Sequence[Planned], arguments: argparse.Namespace) -> None:
    """Draw the shares over the number of subjects, a panel a question."""
    from matplotlib.figure import Figure

    from shukotsu.stages.report.plots.style import applied
    from shukotsu.stages.report.print_figures.drawing import write_figure

    with applied():
        figure = Figure(figsize=(4.5, 2.6 * len(planned)), layout="constrained")
        axes = figure.subplots(len(planned), squeeze=False)[:, 0]
        for own, (row, shares) in zip(axes, planned, strict=True):
            for head, values in zip(_heads(shares), shares.values(), strict=True):
                own.plot(arguments.subjects, [100 * value for value in values], marker="o", label=head)
            own.axhline(100 * POWER, linestyle=":", color="0.5")
            own.set(title=row["question"], ylim=(0, 102), ylabel="studies that show it [%]")
            own.set_xlabel(_each(row))
            own.legend()
        write_figure(arguments.figure, figure, {"Date": None} if arguments.figure.suffix == ".svg" else {})


def main(argv: list[str]) -> int:
    """Print how many subjects; give the exit code."""
    return command_line.run(build_parser, argv, plan_study)
