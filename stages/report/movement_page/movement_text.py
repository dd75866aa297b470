"""The movement page's answers in plain sentences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from shukotsu.sentences.messages import translated
from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.belief import BELIEVED
from shukotsu.stages.report.comparison.comparison_text import p_text
from shukotsu.stages.report.movement_page.movement_results import RANGE, Movement
from shukotsu.stages.report.movement_page.wording_of_numbers import (
    amount,
    angle_text,
    place_text,
    quantity_text,
    who_text,
)
from shukotsu.stages.report.table_cells import number

if TYPE_CHECKING:
    import pandas as pd

MOST_NAMED = 3
PAIR = ["factor", "level", "other_level"]


def answers(movement: Movement) -> list[str]:
    """A paragraph for each question."""
    return [moved_most(movement), *groups_differ(movement), repeats(movement)]


def why_nothing(movement: Movement) -> str:
    """Why no joint angle counts: none was measured, or all hands are left out."""
    if movement.measured:
        return tr("every hand that has joint angles has a suspect finding, and counts in nothing")
    return tr("no recording of this study has joint angles")


def moved_most(movement: Movement) -> str:
    """Tell which joint angles moved most over subjects."""
    found = movement.moved_most
    if found.empty:
        why = why_nothing(movement) if movement.ranges.empty else tr("no joint is to be believed")
        return tr("Which joint moved most is not known: {why}.", why=why)
    first = found.iloc[0]
    care = movement.believed.get(first["joint"], BELIEVED) != BELIEVED
    spread = "" if first["count"] < 2 else tr(", standard deviation {std}", std=number(first["std"], 1))
    text = tr(
        "The {angle_text} moved most: {mean} deg on average over {subjects}{spread}, hands and "
        "tasks averaged{part}.",
        angle_text=angle_text(first["joint"], first["angle"]),
        mean=number(first["mean"], 1),
        subjects=ngettext("{n} subject", "{n} subjects", int(first["count"])),
        spread=spread,
        part=tr("; believe it with care") if care else "",
    )
    rest = found.iloc[1 : 1 + MOST_NAMED]
    others = [f"{angle_text(r['joint'], r['angle'])} ({number(r['mean'], 1)})" for _, r in rest.iterrows()]
    return tr("{text} Next: {others} deg.", text=text, others=listed(others)) if others else text


def groups_differ(movement: Movement) -> list[str]:
    """For each two levels of a factor, which numbers differ."""
    rows = movement.believable(movement.differences)
    said = [
        tr("{factor}: {why}.", factor=factor.capitalize(), why=translated(why))
        for factor, why in movement.factors.items()
        if why
    ]
    why = ""
    if rows.empty and not movement.factors:
        why = tr("the study file names no factor (factors: [group])")
    elif rows.empty and not said:
        why = why_nothing(movement) if movement.ranges.empty else tr("no two levels have a number")
    if why:
        said = [tr("No groups, sessions or tasks are compared: {why}.", why=why)]
    for factor, of_factor in rows.groupby("factor", sort=False):
        pairs = [
            (str(level), str(other), own) for (level, other), own in of_factor.groupby(PAIR[1:], sort=False)
        ]
        judged = [pair for pair in pairs if (pair[2]["verdict"] != "").any()]
        said += [_pair_text(str(factor), *pair) for pair in judged]
        if len(judged) < len(pairs):
            rest = [own for own in pairs if not (own[2]["verdict"] != "").any()]
            said.append(_untested_text(str(factor), rest))
    return said


def _untested_text(factor: str, pairs: Sequence[tuple[str, str, pd.DataFrame]]) -> str:
    """Say once of all pairs of levels that have too few subjects that they have, and how few one has."""
    level, other, rows = pairs[0]
    start = tr("{factor}, {level} against {other}:", factor=factor.capitalize(), level=level, other=other)
    if len(pairs) > 1:
        start = tr("{factor}, {n} pairs of levels:", factor=factor.capitalize(), n=len(pairs))
    why = next((translated(message) for message in rows["message"] if message), tr("not tested"))
    return tr("{start} {message}.", start=start, message=why)


def _pair_text(factor: str, level: str, other: str, rows: pd.DataFrame) -> str:
    start = tr("{factor}, {level} against {other}:", factor=factor, level=level, other=other)
    judged = rows[rows["verdict"] != ""]
    values = {"start": start, "who": who_text(judged.loc[judged["n"].idxmax()])}
    of_all = ngettext("{n} number", "{n} numbers", len(judged))
    shown = judged[judged["verdict"] == "shown"].sort_values("p_holm", kind="stable")
    if shown.empty:
        return tr("{start} no difference is shown in {of_all} ({who}).", of_all=of_all, **values)
    parts = [_difference_text(row) for _, row in shown.head(MOST_NAMED).iterrows()]
    n_more = len(shown) - MOST_NAMED
    more = tr("; {n_shown} more in the table", n_shown=n_more) if n_more > 0 else ""
    return tr(
        "{start} a difference is shown in {n_shown} of {of_all} ({who}): {parts}{more}.",
        n_shown=len(shown),
        of_all=of_all,
        parts="; ".join(parts),
        more=more,
        **values,
    )


def _difference_text(row: Any) -> str:
    more, sign = (tr("less"), -1) if row["difference"] < 0 else (tr("more"), 1)
    ends = sorted((sign * row["low"], sign * row["high"]))
    return tr(
        "{quantity}, {difference} {more} with {level} ({interval_text}, {p_text} corrected; {place})",
        quantity=quantity_text(row["quantity"], row["of"]),
        difference=amount(abs(row["difference"]), abs(row["difference"]), row["unit"]),
        more=more,
        level=row["level"],
        interval_text=interval_text(*ends),
        p_text=p_text(row["p_holm"]),
        place=place_text((row["hand"], row["task"])),
    )


def interval_text(low: float, high: float, decimals: int = 1) -> str:
    """A 95 % interval in a sentence."""
    return tr("95 % {low} to {high}", low=number(low, decimals), high=number(high, decimals))


def repeats(movement: Movement) -> str:
    """Say how well a range of motion repeats."""
    rows = movement.believable(movement.reliability)
    rows = rows[(rows["quantity"] == RANGE) & rows["sem"].notna()]
    if rows.empty:
        return tr(
            "How well the numbers repeat is not known: no hand was recorded in two sessions or two "
            "trials of one task by enough subjects."
        )
    return " ".join(
        _repeats_across(str(across), str(contains), own)
        for (across, contains), own in rows.groupby(["across", "contains"], sort=False)
    )


def _repeats_across(across: str, contains: str, rows: pd.DataFrame) -> str:
    """Say it of sessions or of trials; what changed from one to the next on purpose is no error."""
    values = {
        "across": across,
        "sem": number(rows["sem"].median(), 1),
        "joint_angles": ngettext("{n} joint angle", "{n} joint angles", len(rows)),
        "k": int(rows["k"].max()),
        "subjects": ngettext("{n} subject", "{n} subjects", int(rows["n"].max())),
    }
    if contains:
        return tr(
            "From {across} to {across} a range of motion differs by {sem} deg within a person (standard "
            "deviation, median of {joint_angles}; {k} {across}s of {subjects}). That contains what {factors} "
            "changed, so it is no measurement error.",
            factors=listed(contains.split(";")),
            **values,
        )
    held = rows["held_percent"].median()
    stated = tr("; 1.96 of the stated error hold {held} % of differences", held=number(held, 0))
    return tr(
        "From {across} to {across} a range of motion repeats to {sem} deg (standard error of "
        "measurement, median of {joint_angles}; {k} {across}s of {subjects}), so a change of "
        "one person below {mdc} deg in half of the angles, and below {most} deg in the worst, "
        "cannot be told from measurement error{stated}.",
        mdc=number(rows["mdc"].median(), 1),
        most=number(rows["mdc"].max(), 1),
        stated=stated if held == held else "",
        **values,
    )
