"""The movement page's answers in plain sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from shukotsu.sentences.messages import translated
from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.belief import BELIEVED
from shukotsu.stages.report.comparison.comparison_text import p_text
from shukotsu.stages.report.movement_page.movement_results import RANGE, Movement
from shukotsu.stages.report.table_cells import number

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
    return tr("{joint} {angle}", joint=f"{digit} {kind.upper()}" if digit else joint, angle=angle)


def of_text(of: str) -> str:
    """The same of a column `of`; digits as they are."""
    joint, _, angle = of.partition(" ")
    return angle_text(joint, angle) if angle else of


def moved_most(movement: Movement) -> str:
    """Tell which joint angles moved most over subjects."""
    found = movement.moved_most
    if found.empty:
        return tr("Which joint moved most is not known: no recording of this study has joint angles.")
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
    """For each two levels of a factor, which ranges of motion differ."""
    rows = movement.believable(movement.differences)
    rows = rows[rows["quantity"] == RANGE]
    if rows.empty:
        return [
            tr(
                "No groups, sessions or tasks are compared: the study file names no factor with two "
                "levels (factors: [group])."
            )
        ]
    return [
        _pair_text(str(factor), str(level), str(other), own)
        for (factor, level, other), own in rows.groupby(PAIR, sort=False)
    ]


def _pair_text(factor: str, level: str, other: str, rows: pd.DataFrame) -> str:
    start = tr("{factor}, {level} against {other}:", factor=factor.capitalize(), level=level, other=other)
    tested = rows[rows["p_max_t"].notna()]
    if tested.empty:
        messages = [message for message in rows["message"].unique() if message]
        if messages:
            return tr("{start} {message}.", start=start, message=translated(messages[0]))
        return tr("{start} not tested, there are too few subjects.", start=start)
    shown = tested[tested["p_max_t"] <= LEVEL].sort_values("p_max_t", kind="stable")
    n, n_other = int(tested["n"].max()), int(tested["n_other"].max())
    paired = (tested["design"] == "within").all()
    who = (
        ngettext("{n} subject", "{n} subjects", n)
        if paired
        else tr("{n} and {n_other} subjects", n=n, n_other=n_other)
    )
    if shown.empty:
        return tr(
            "{start} no difference is shown in {ranges} of motion ({who}).",
            start=start,
            ranges=ngettext("{n} range", "{n} ranges", len(tested)),
            who=who,
        )
    parts = [_difference_text(row) for _, row in shown.head(MOST_NAMED).iterrows()]
    more = (
        tr("; {n_shown} more in the table", n_shown=len(shown) - MOST_NAMED)
        if len(shown) > MOST_NAMED
        else ""
    )
    return tr(
        "{start} a difference is shown in {n_shown} of {ranges} of motion ({who}): {parts}{more}.",
        start=start,
        n_shown=len(shown),
        ranges=ngettext("{n} range", "{n} ranges", len(tested)),
        who=who,
        parts="; ".join(parts),
        more=more,
    )


def _difference_text(row: Any) -> str:
    more, sign = (tr("less"), -1) if row["difference"] < 0 else (tr("more"), 1)
    ends = sorted((sign * row["low"], sign * row["high"]))
    return tr(
        "{of_text} {difference} deg {more} with {level} ({interval_text}, {p_text} corrected; "
        "{hand} hand, {task})",
        of_text=of_text(row["of"]),
        difference=number(abs(row["difference"]), 1),
        more=more,
        level=row["level"],
        interval_text=interval_text(*ends),
        p_text=p_text(row["p_max_t"]),
        hand=row["hand"],
        task=row["task"],
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
    texts = []
    for across, own in rows.groupby("across", sort=False):
        sem, mdc, most = own["sem"].median(), own["mdc"].median(), own["mdc"].max()
        n, k = int(own["n"].max()), int(own["k"].max())
        held = own["held_percent"].median()
        stated = (
            ""
            if held != held
            else tr("; 1.96 of the stated error hold {held} % of differences", held=number(held, 0))
        )
        texts.append(
            tr(
                "From {across} to {across} a range of motion repeats to {sem} deg (standard error of "
                "measurement, median of {joint_angles}; {k} {across}s of {subjects}), so a change of "
                "one person below {mdc} deg in half of the angles, and below {most} deg in the worst, "
                "cannot be told from measurement error{stated}.",
                across=across,
                sem=number(sem, 1),
                joint_angles=ngettext("{n} joint angle", "{n} joint angles", len(own)),
                k=k,
                subjects=ngettext("{n} subject", "{n} subjects", n),
                mdc=number(mdc, 1),
                most=number(most, 1),
                stated=stated,
            )
        )
    return " ".join(texts)


def model_matters(movement: Movement) -> str:
    """Tell whether another skeleton model would give another answer."""
    rows = movement.believable(movement.dependence)
    rows = rows[rows["agree"].notna()]
    if rows.empty:
        return tr(
            "Whether another skeleton model would change an answer is not known: no question was "
            "answered under two models."
        )
    models = listed(sorted({model for each in rows["models"] for model in each.split(";")}))
    ranges, others = rows[rows["quantity"] == RANGE], rows[rows["quantity"] != RANGE]
    sentences = [_ranges_matter(ranges, models)] if len(ranges) else []
    if len(others):
        text = tr(
            "Of other numbers (postures, speeds, paths, distances) another model ({models}) changes "
            "{n_apart} of {n_rows} answers.",
            models=models,
            n_apart=int((~others["agree"].astype(bool)).sum()),
            n_rows=len(others),
        )
        sentences.append(text)
    return " ".join(sentences)


def _ranges_matter(rows: pd.DataFrame, models: str) -> str:
    """Tell which answers about ranges of motion another model changes."""
    apart = rows[~rows["agree"].astype(bool)]
    if apart.empty:
        return tr(
            "Another skeleton model ({models}) changes none of {n_rows} answers about ranges of motion.",
            n_rows=len(rows),
            models=models,
        )
    named = [_question_text(row) for _, row in apart.iterrows()]
    rest = tr(" and {n_named} more", n_named=len(named) - MOST_NAMED) if len(named) > MOST_NAMED else ""
    return tr(
        "Another skeleton model ({models}) changes {n_apart} of {n_rows} answers about ranges of motion: "
        "{first}{rest}; see below which models part.",
        n_apart=len(apart),
        n_rows=len(rows),
        models=models,
        first=", ".join(named[:MOST_NAMED]),
        rest=rest,
    )


def _question_text(row: Any) -> str:
    """Write what was asked of whom: index PIP flexion (group: A less B)."""
    question = (
        tr(
            "{factor}: {level} less {other_level}",
            factor=row["factor"],
            level=row["level"],
            other_level=row["other_level"],
        )
        if row["level"]
        else tr("repeatability")
    )
    return f"{of_text(row['of'])} ({question})"
