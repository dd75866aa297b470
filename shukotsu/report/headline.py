"""What the first screen and the terminal say: three numbers, and which model to take."""

from __future__ import annotations

import textwrap
from collections import Counter
from statistics import median
from typing import NamedTuple

from shukotsu.report.judged_models import TRUTH, judged_models, model_to_take
from shukotsu.report.provenance import all_problems
from shukotsu.report.study_results import StudyResults, hand_of
from shukotsu.report.table_cells import shown
from shukotsu.study import verdict
from shukotsu.study.finding_sentences import in_quotes
from shukotsu.translation import listed, ngettext, tr, word


class BigNumber(NamedTuple):
    """A number with its unit, and what it is of."""

    value: str
    unit: str
    of: str


def used_text(results: StudyResults) -> str:
    """Write in a sentence how many of the recordings were used, and whether they are simulated."""
    statuses = Counter(results.status_of(recording)[0] for recording in results.recordings)
    others = [f"{count} {word(status)}" for status, count in sorted(statuses.items()) if status != "used"]
    total = ngettext("{n} recording", "{n} recordings", len(results.recordings))
    used = tr("{n} of {total} used", n=statuses["used"], total=total)
    used += f" ({listed(others)})" if others else ""
    return used + (
        tr("; simulated, so no person's hand is behind these numbers") if results.simulated else ""
    )


def big_numbers(results: StudyResults) -> tuple[BigNumber, BigNumber, BigNumber]:
    """Return joints believed of all, the typical error of a joint, and hands with a finding."""
    model = results.leading
    rows = [row for row in results.judging.joints if row["model"] == model]
    hands = hands_counted(results, len({hand_of(row) for row in rows}))
    believed = sum(row["verdict"] == verdict.BELIEVE for row in rows)
    sds = [row["sd_mm"] for row in rows if row["sd_mm"] is not None]
    typical = tr("is the error that the model states of a joint: the median, 1 sigma in 3-D")
    for judged in judged_models(results):
        if judged.metric == TRUTH and model in judged.values:
            values = list(judged.values[model].values())
            truth = shown(TRUTH, sum(values) / len(values))
            typical += tr("; the true error, known of simulated hands, is {truth} mm on average", truth=truth)
    suspects = len({hand_of(row) for row in results.findings})
    mistaken = tr("have recordings in which a mistake was found")
    return (
        BigNumber(
            str(believed),
            tr("of {total}", total=ngettext("{n} joint", "{n} joints", len(rows))),
            tr("can be believed under the model {model}, of all joints of {hands}", model=model, hands=hands)
            if rows
            else tr("can be believed: no hand that counts has a joint under {model}", model=model),
        ),
        BigNumber(shown("sd_mm", median(sds) if sds else None), "mm", typical),
        BigNumber(
            str(suspects),
            tr("of {total}", total=hands_counted(results, len(results.hands))),
            mistaken + (tr(", and are in no statistic unless accepted") if suspects else ""),
        ),
    )


def hands_counted(results: StudyResults, n: int) -> str:
    """So many hands, or sides of a body where a layout is of no hand."""
    return ngettext("{n} hand", "{n} hands", n) if results.of_hands else ngettext("{n} side", "{n} sides", n)


def opening(results: StudyResults) -> str:
    """Return the numbers in a line of text."""
    return " ".join(_numbers(results))


def _numbers(results: StudyResults) -> list[str]:
    return [tr("{value} {unit} {of}.", **number._asdict()) for number in big_numbers(results)]


WIDTH, MOST_PROBLEMS = 79, 3
"""Columns of a terminal, and as many problems as it shows."""


def outcome_text(results: StudyResults) -> str:
    """Return the study's numbers and its sentence as plain text, then the gravest problems."""
    problems = all_problems(results)
    lines = [f"Study {results.name}: {used_text(results)}.", *_numbers(results), model_to_take(results)]
    lines += [
        f"- {problem.where}: {in_quotes(problem.text)} {problem.places}".rstrip()
        for problem in problems[:MOST_PROBLEMS]
    ]
    more = len(problems) - MOST_PROBLEMS
    lines += [f"- and {more} more; see the report"] if more > 0 else []
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ", break_on_hyphens=False) for line in lines
    )
