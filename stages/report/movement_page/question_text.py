"""A study's questions and their answers, in a sentence each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from shukotsu.sentences.messages import translated
from shukotsu.sentences.translation import N_, ngettext, tr, word
from shukotsu.stages.report.comparison.comparison_text import p_text
from shukotsu.stages.report.movement_page.movement_results import Movement
from shukotsu.stages.report.table_cells import capital, number

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "range_deg": N_("range of motion"),
    "full_range_deg": N_("full range"),
    "median_deg": N_("posture (median angle)"),
    "speed_median_deg_s": N_("median speed"),
    "speed_p95_deg_s": N_("speed (95th percentile)"),
    "path_length_mm": N_("path length"),
    "speed_median_mm_s": N_("median speed"),
    "speed_p95_mm_s": N_("speed (95th percentile)"),
    "sparc": N_("smoothness (SPARC)"),
    "min_mm": N_("least distance"),
    "median_mm": N_("median distance"),
    "contact_percent": N_("time in contact"),
    "n_contacts": N_("number of contacts"),
    "event_measure": N_("strokes"),
}
"""What quantities are called in a sentence; others by their names."""


def angle_text(joint: str, angle: str) -> str:
    """A joint's angle in words: index MCP flexion."""
    digit, _, kind = joint.rpartition("_")
    return tr("{joint} {angle}", joint=f"{digit} {kind.upper()}" if digit else joint, angle=angle)


def of_text(of: str) -> str:
    """The same of a column `of`; digits as they are."""
    joint, _, angle = of.partition(" ")
    if angle and "_" not in joint:  # a digit and what is measured of its strokes
        return f"{word(joint)} {angle.replace('_', ' ')}"
    return angle_text(joint, angle) if angle else "-".join(map(word, of.split("-")))


def place_text(place: tuple[str, str]) -> str:
    """Hand and task in words."""
    hand, task = place
    if not hand or not task:  # what is compared is no place
        return tr("{hand} hand", hand=hand) if hand else task
    return tr("{hand} hand, {task}", hand=hand, task=task)


def quantity_text(quantity: str, of: str) -> str:
    """What is compared, of whom: range of motion, index PIP flexion."""
    name = tr(QUANTITIES[quantity]) if quantity in QUANTITIES else quantity
    return tr("{quantity}, {of}", quantity=name, of=of_text(of))


def asked_and_answered(movement: Movement) -> list[tuple[str, str]]:
    """Each question as it was asked, and its answer."""
    return [(_asked(row), _answer(row, len(movement.questions))) for _, row in movement.questions.iterrows()]


def answered(movement: Movement) -> list[str]:
    """The same in a line each."""
    return [tr("{name}: {what}", name=own[0], what=own[1]) for own in asked_and_answered(movement)]


def _asked(row: Any) -> str:
    outcome = (
        tr("course of {of} over {event}", of=of_text(row["of"]), event=row["event"])
        if row["event"]
        else quantity_text(row["quantity"], row["of"])
    )
    where = tuple(filter(None, (word(row["hand"]) and tr("{hand} hand", hand=row["hand"]), row["task"])))
    parts = [outcome, _contrast(row), *where]
    return tr("{name}: {what}", name=row["question"], what="; ".join(parts))


def _contrast(row: Any) -> str:
    """What is held against what."""
    factor, level, other = row["factor"], row["level"], row["other_level"]
    if not level:
        return tr("change with {factor}", factor=factor)
    contrast = tr("{factor}: {level} less {other}", factor=factor, level=level, other=other)
    if not row["crossed_with"]:
        return contrast
    return tr(
        "{contrast}, at {level} less at {other} ({factor})",
        contrast=contrast,
        level=row["crossed_level"],
        other=row["crossed_other_level"],
        factor=row["crossed_with"],
    )


def _answer(row: Any, n_questions: int) -> str:
    values = {"estimate": _estimate(row), "who": who_text(row)}
    if row["verdict"] == "shown":
        family = ngettext("the only question", "corrected for {n} questions", n_questions)
        p = tr("{p_text}, {family}", p_text=p_text(row["p_corrected"]), family=family)
        text = tr("Shown: {estimate}; {p}; {who}.", p=p, **values)
    elif row["verdict"] == "not-shown":
        seen = amount(row["detectable"], row["detectable"], row["unit"])
        text = tr(
            "Not shown: {estimate}; {who}; {seen} would have been shown in 80 % of such studies.",
            seen=seen,
            **values,
        )
    elif row["verdict"] == "undecided":
        why = translated(row["message"])
        text = tr("Not to be decided: {estimate}; {why}.", why=why, **values)
    else:
        text = tr("{message}.", message=capital(translated(row["message"])))
    return f"{text} {_dated(row)}".strip()


def _estimate(row: Any) -> str:
    """The difference and its interval; where in the cycle, of a curve; a dash where there is none."""
    low, high, difference = row["low"], row["high"], row["difference"]
    scale = max(filter(math.isfinite, map(abs, (low, high, difference))), default=math.nan)
    text = amount(difference, scale, row["unit"])
    if not row["level"]:
        text = tr("{amount} for one more of {factor}", amount=text, factor=row["factor"])
    if row["event"] and row["percent"] == row["percent"]:
        text = tr("{amount} at {percent} % of the cycle", amount=text, percent=int(row["percent"]))
    if low != low:
        return text
    ends = tr("95 % {low} to {high}", low=_digits(low, scale), high=_digits(high, scale))
    return f"{text} ({ends})"


def amount(value: float, scale: float, unit: str) -> str:
    """A number with its unit, to a hundredth of what is about as large as `scale`."""
    return f"{_digits(value, scale)} {unit}".strip()


def _digits(value: float, scale: float) -> str:
    decimals = 1 - math.floor(math.log10(scale / 3)) if math.isfinite(scale) and scale > 0 else 1
    return number(value, min(max(decimals, 0), 6))


def who_text(row: Any) -> str:
    """How many subjects a number is of."""
    n, n_other = int(row["n"]), int(row["n_other"])
    if row["design"] in ("between", "between;within", "within;between", "between;between") and n_other:
        return tr("{n} and {n_other} subjects", n=n, n_other=n_other)
    return ngettext("{n} subject", "{n} subjects", n)


def _dated(row: pd.Series[Any]) -> str:
    """When it was asked, and whether somebody could have looked first."""
    if not row["first_asked"]:
        return ""
    if row["asked_after_results"]:
        return tr(
            "First asked on {date}, after results were there: take it as exploratory.",
            date=row["first_asked"],
        )
    return tr("First asked on {date}, before there were results.", date=row["first_asked"])
