"""The movement page's answers in plain sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stages.report.belief import BELIEVED
from stages.report.comparison.comparison_text import p_text
from stages.report.movement_page.movement_results import RANGE, Movement
from stages.report.table_cells import counted, listed, number

if TYPE_CHECKING:
    import pandas as pd

LEVEL = 0.05
MOST_NAMED = 3
PAIR = ["factor", "level", "other_level"]


def answers(movement: Movement) -> list[str]:
    """A paragraph for each question."""
    return [moved_most(movement), *groups_differ(movement), repeats(movement), model_matters(movement)]


def angle_text(joint: str, angle: str) -> str:
    """A joint's angle in words: index MCP flexion."""
    digit, _, kind = joint.rpartition("_")
    return f"{digit} {kind.upper()} {angle}" if digit else f"{joint} {angle}"


def of_text(of: str) -> str:
    """The same of a column `of`; digits as they are."""
    joint, _, angle = of.partition(" ")
    return angle_text(joint, angle) if angle else of


def moved_most(movement: Movement) -> str:
    """Which joint angles moved most over subjects."""
    found = movement.moved_most
    if found.empty:
        return "Which joint moved most is not known: no recording of this study has joint angles."
    first = found.iloc[0]
    care = movement.believed.get(first["joint"], BELIEVED) != BELIEVED
    spread = "" if first["count"] < 2 else f", standard deviation {number(first['std'], 1)}"
    text = (
        f"The {angle_text(first['joint'], first['angle'])} moved most: {number(first['mean'], 1)} deg on "
        f"average over {counted(int(first['count']), 'subject')}{spread}, hands and tasks averaged"
        f"{'; believe it with care' if care else ''}."
    )
    rest = found.iloc[1 : 1 + MOST_NAMED]
    others = [f"{angle_text(r['joint'], r['angle'])} ({number(r['mean'], 1)})" for _, r in rest.iterrows()]
    return f"{text} Next: {listed(others)} deg." if others else text


def groups_differ(movement: Movement) -> list[str]:
    """For each two levels of a factor, which ranges of motion differ."""
    rows = movement.differences
    rows = rows[rows["quantity"] == RANGE]
    if rows.empty:
        return [
            "No groups, sessions or tasks are compared: the study file names no factor with two levels "
            "(factors: [group])."
        ]
    return [
        _pair_text(str(factor), str(level), str(other), own)
        for (factor, level, other), own in rows.groupby(PAIR, sort=False)
    ]


def _pair_text(factor: str, level: str, other: str, rows: pd.DataFrame) -> str:
    start = f"{factor.capitalize()}, {level} against {other}:"
    tested = rows[rows["p_holm"].notna()]
    if tested.empty:
        messages = [message for message in rows["message"].unique() if message]
        why = messages[0].rstrip(".") if messages else "there are too few subjects"
        return f"{start} not tested, {why}."
    shown = tested[tested["p_holm"] <= LEVEL].sort_values("p_holm", kind="stable")
    n, n_other = int(tested["n"].max()), int(tested["n_other"].max())
    paired = (tested["design"] == "within").all()
    who = counted(n, "subject") if paired else f"{n} and {n_other} subjects"
    if shown.empty:
        return f"{start} no difference is shown in {counted(len(tested), 'range')} of motion ({who})."
    parts = [_difference_text(row) for _, row in shown.head(MOST_NAMED).iterrows()]
    more = f"; {len(shown) - MOST_NAMED} more in the table" if len(shown) > MOST_NAMED else ""
    return (
        f"{start} a difference is shown in {len(shown)} of {counted(len(tested), 'range')} of motion "
        f"({who}): {'; '.join(parts)}{more}."
    )


def _difference_text(row: Any) -> str:
    more, sign = ("less", -1) if row["difference"] < 0 else ("more", 1)
    ends = sorted((sign * row["low"], sign * row["high"]))
    return (
        f"{of_text(row['of'])} {number(abs(row['difference']), 1)} deg {more} with {row['level']} "
        f"({interval_text(*ends)}, {p_text(row['p_holm'])} after Holm; {row['hand']} hand, "
        f"{row['task']})"
    )


def interval_text(low: float, high: float, decimals: int = 1) -> str:
    """A 95 % interval in a sentence."""
    return f"95 % {number(low, decimals)} to {number(high, decimals)}"


def repeats(movement: Movement) -> str:
    """How well a range of motion repeats."""
    rows = movement.reliability
    rows = rows[(rows["quantity"] == RANGE) & rows["sem"].notna()]
    if rows.empty:
        return (
            "How well the numbers repeat is not known: no hand was recorded in two sessions or two trials of "
            "one task by enough subjects."
        )
    texts = []
    for across, own in rows.groupby("across", sort=False):
        sem, mdc = own["sem"].median(), own["mdc"].median()
        n, k = int(own["n"].max()), int(own["k"].max())
        held = own["held_percent"].median()
        stated = (
            "" if held != held else f"; the stated 1-sigma error holds {number(held, 0)} % of differences"
        )
        texts.append(
            f"From {across} to {across} a range of motion repeats to {number(sem, 1)} deg (standard error of "
            f"measurement, median of {counted(len(own), 'joint angle')}; {k} {across}s of "
            f"{counted(n, 'subject')}), so a change of one person below {number(mdc, 1)} deg cannot be "
            f"told from measurement error{stated}."
        )
    return " ".join(texts)


def model_matters(movement: Movement) -> str:
    """Whether another skeleton model would give another answer."""
    rows = movement.dependence
    rows = rows[rows["agree"].notna()]
    if rows.empty:
        return (
            "Whether another skeleton model would change an answer is not known: no question was answered "
            "under two models."
        )
    agree = rows["agree"].astype(bool)
    models = sorted({model for each in rows["models"] for model in each.split(";")})
    if agree.all():
        return f"Another skeleton model changes none of {len(rows)} answers ({listed(models)})."
    apart = rows[~agree]
    ranges = apart[apart["quantity"] == RANGE]
    named = dict.fromkeys(of_text(of) for of in (apart if ranges.empty else ranges)["of"])
    first = list(named)[:MOST_NAMED]
    rest = f" and {len(named) - MOST_NAMED} more" if len(named) > MOST_NAMED else ""
    return (
        f"Another skeleton model changes {len(apart)} of {len(rows)} answers ({listed(models)}), among them "
        f"of {', '.join(first)}{rest}: see below which models part."
    )
