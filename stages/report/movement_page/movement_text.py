"""The movement page's answers in plain sentences, and what it calls joints, quantities and places."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from shukotsu.sentences.translation import N_, listed, ngettext, tr, translated, word
from shukotsu.stages.report.belief import BELIEVED
from shukotsu.stages.report.comparison.comparison_text import p_text
from shukotsu.stages.report.movement_page.movement_results import RANGE, Movement
from shukotsu.stages.report.table_cells import number

if TYPE_CHECKING:
    import pandas as pd

MOST_NAMED = 3
PAIR = ["factor", "level", "other_level"]
QUANTITIES = {
    "range_deg": N_("range of motion"),
    "full_range_deg": N_("full range"),
    "median_deg": N_("posture (median angle)"),
    "speed_median_deg_s": N_("median speed"),
    "speed_p95_deg_s": N_("speed (95th percentile)"),
    "path_length_mm": N_("path length"),
    "speed_median_mm_s": N_("median speed"),
    "speed_p95_mm_s": N_("speed (95th percentile)"),
}
"""What quantities are called in a sentence."""


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
    return tr(
        "The {angle_text} moved most: {mean} deg on average over {subjects}{spread}, hands and "
        "tasks averaged{part}.",
        angle_text=angle_text(first["joint"], first["angle"]),
        mean=number(first["mean"], 1),
        subjects=ngettext("{n} subject", "{n} subjects", int(first["count"])),
        spread=spread,
        part=tr("; believe it with care") if care else "",
    )


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
    values = {"start": start, "who": _who_text(judged.loc[judged["n"].idxmax()])}
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
    name = QUANTITIES[row["quantity"]]
    more, sign = (tr("less"), -1) if row["difference"] < 0 else (tr("more"), 1)
    ends = sorted((sign * row["low"], sign * row["high"]))
    return tr(
        "{quantity}, {difference} {more} with {level} ({interval_text}, {p_text} corrected; {place})",
        quantity=tr("{quantity}, {of}", quantity=tr(name), of=_of_text(row["of"])),
        difference=_amount(abs(row["difference"]), row["unit"]),
        more=more,
        level=row["level"],
        interval_text=tr("95 % {low} to {high}", low=number(ends[0], 1), high=number(ends[1], 1)),
        p_text=p_text(row["p_holm"]),
        place=place_text((row["hand"], row["task"])),
    )


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
    return tr(
        "From {across} to {across} a range of motion repeats to {sem} deg (standard error of "
        "measurement, median of {joint_angles}; {k} {across}s of {subjects}), so a change of one person "
        "below {mdc} deg in half of the angles cannot be told from measurement error.",
        mdc=number(rows["mdc"].median(), 1),
        **values,
    )


def angle_text(joint: str, angle: str) -> str:
    """A joint's angle in words: index MCP flexion."""
    digit, _, kind = joint.rpartition("_")
    return tr("{joint} {angle}", joint=f"{digit} {kind.upper()}" if digit else joint, angle=angle)


def _of_text(of: str) -> str:
    """The same of a column `of`; a digit as it is."""
    joint, _, angle = of.partition(" ")
    return angle_text(joint, angle) if angle else word(of)


def place_text(place: tuple[str, str]) -> str:
    """Hand and task in words."""
    hand, task = place
    if not hand or not task:  # what is compared is no place
        return tr("{hand} hand", hand=hand) if hand else task
    return tr("{hand} hand, {task}", hand=hand, task=task)


def _amount(value: float, unit: str) -> str:
    """A number with its unit, to about a hundredth of it."""
    decimals = 1 - math.floor(math.log10(value / 3)) if math.isfinite(value) and value > 1e-6 else 1
    return f"{number(value, min(max(decimals, 0), 6))} {unit}"


def _who_text(row: Any) -> str:
    """How many subjects a number is of."""
    n, n_other = int(row["n"]), int(row["n_other"])
    if row["design"] == "between" and n_other:
        return tr("{n} and {n_other} subjects", n=n, n_other=n_other)
    return ngettext("{n} subject", "{n} subjects", n)
