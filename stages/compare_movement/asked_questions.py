"""Answer the questions of a study file: one number a subject, or one curve, and one test each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.schemas.questions import Question
from shukotsu.sentences.messages import message_of
from shukotsu.stages.compare_movement.level_differences import effect_columns, verdict_at_once
from shukotsu.stages.compare_movement.level_pairs import BETWEEN, WITHIN, LevelPair, level_pair
from shukotsu.stages.compare_movement.movement_values import RECORDING, Recorded, level_column
from shukotsu.statistics.least_favourable import SIGNS
from shukotsu.statistics.multiple_comparisons import LEVEL, holm
from shukotsu.statistics.paired_statistics import Array
from shukotsu.statistics.verdicts import (
    FEWEST_IN_GROUP,
    FEWEST_WITHIN,
    NOT_SHOWN,
    SHOWN,
    UNDECIDED,
    FamilyVerdicts,
    between_family,
    interaction_family,
    slope_family,
    within_family,
)

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]


@dataclass(frozen=True)
class Asked:
    """What a question's test is of: subjects' numbers by group (one within, two or four between).

    covariate : of the subjects of the only group, where each has one value. pair : the factor's levels; None
    of a covariate.
    """

    groups: tuple[pd.DataFrame, ...]
    design: str
    covariate: Array | None = None
    pair: LevelPair | None = None


def question_rows(
    questions: Sequence[Question],
    outcomes: Mapping[str, pd.DataFrame],
    everything: Recorded,
    model: str,
    first_asked: Mapping[str, tuple[str, bool]],
) -> list[Row]:
    """Rows of the table of questions, corrected over all of them.

    outcomes : by a question's name RECORDING and its numbers, a column each, of its model and of whom it is
    about. model : that of questions which name none. first_asked : by a question's digest when it was first
    run, and whether there were results.
    """
    rows = [_row(own, outcomes[own.name], everything, len(questions)) for own in questions]
    for own, row, p in zip(questions, rows, holm([row["p"] for row in rows]), strict=True):
        when, after = first_asked.get(own.digest, ("", None))
        row |= {"model": own.model or model, "first_asked": when, "asked_after_results": after}
        row["p_corrected"] = p
        if p is not None and p <= LEVEL:
            row |= {"verdict": SHOWN, "message": ""}
    return rows


def _row(question: Question, outcome: pd.DataFrame, everything: Recorded, among: int) -> Row:
    columns = [name for name in outcome if name not in (*RECORDING, "unit")]
    place = {name: value for name in ("hand", "task") if (value := getattr(question, name))}
    levels = everything.counted
    for name, value in place.items():
        levels = levels[levels[name] == value]
    numbers = outcome.merge(levels, on=RECORDING)
    if question.levels:
        own = _contrast(question, numbers, columns, everything, place)
    else:
        own = _slopes(numbers, columns, level_column(question.factor))
    found = _tested(own, among)
    verdict, p = verdict_at_once(found)
    at = int(np.nanargmin(found.p)) if p is not None else _largest(np.abs(found.difference))
    counts = [int(group[columns[at]].notna().sum()) if columns else 0 for group in own.groups]
    row = _named(question) | {
        "unit": "deg" if question.curve else next(iter(outcome["unit"]), ""),
        "percent": int(columns[at]) if question.curve and columns else None,
        "design": own.design,
        **_counts(own, counts),
        **({"difference": _difference(own, columns[at])} if columns else {}),
        **{name: float(getattr(found, name)[at]) for name in ("difference", "low", "high") if verdict},
        "detectable": float(np.fmax.reduce(found.detectable, initial=-np.inf)),
        "verdict": verdict,
        "p": p,
        "effect_size_name": "",
        "message": _why(verdict, own, counts),
    }
    return row | (_effect(own, columns[at]) | _spread(question, numbers, own, columns[at]) if columns else {})


def _spread(question: Question, numbers: pd.DataFrame, own: Asked, column: Any) -> Row:
    """Say how the tested numbers scatter over subjects, and what one session is of it, which `shukotsu plan`
    reads; nothing of a slope.
    """
    if own.pair is None:
        return {}
    variances = [group[column].var(ddof=1) for group in own.groups]
    cell = ["subject", *dict.fromkeys(map(level_column, question.factors))]
    if "session" in cell:
        return {"subject_sd": float(np.sqrt(np.mean(variances)))}
    by_session = numbers.groupby([*cell, "session"], sort=False)[column].mean().dropna()
    sessions = by_session.groupby(cell, sort=False)
    counts, within = sessions.count() - 1, sessions.var(ddof=1)
    row = {"subject_sd": float(np.sqrt(np.mean(variances))), "n_sessions": float((counts + 1).mean())}
    if not counts.sum():
        return row
    n_cells = 2 ** own.design.split(";").count(WITHIN)
    return row | {"session_sd": float(np.sqrt(n_cells * (within * counts).sum() / counts.sum()))}


def _largest(numbers: Array) -> int:
    return int(np.argmax(np.nan_to_num(numbers, nan=-1.0))) if len(numbers) else 0


def _named(question: Question) -> Row:
    level, other = question.levels or ("", "")
    crossed, crossed_other = question.crossed_levels or ("", "")
    return {
        "question": question.name,
        "hand": question.hand,
        "task": question.task,
        "quantity": question.quantity,
        "of": question.whose,
        "event": question.curve,
        "factor": question.factor,
        "level": level,
        "other_level": other,
        "crossed_with": question.crossed_with,
        "crossed_level": crossed,
        "crossed_other_level": crossed_other,
    }


def _means(numbers: pd.DataFrame, columns: list[Any], factors: Sequence[str]) -> dict[Any, pd.DataFrame]:
    """Subjects' means over trials, then over sessions, by their levels of the factors."""
    cell = [level_column(factor) for factor in factors]
    by_session = numbers.groupby(list(dict.fromkeys(["subject", "session", *cell])), sort=False)[
        columns
    ].mean()
    means = by_session.groupby(["subject", *cell], sort=False).mean()
    return {key: own.droplevel(cell) for key, own in means.groupby(cell, sort=False)}


def _less(one: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Differences within the subjects who have both."""
    both = one.index.intersection(other.index, sort=False)
    return (one.loc[both] - other.loc[both]).dropna(how="all")


def _contrast(
    question: Question, numbers: pd.DataFrame, columns: list[Any], everything: Recorded, place: Row
) -> Asked:
    """The numbers of two levels, or of two by two."""
    factors = question.factors
    cells = _means(numbers, columns, factors)
    none = numbers.set_index("subject")[columns].iloc[:0]
    pairs = [
        level_pair(everything, factor, (levels[0], levels[1]), place, design if not at else "")
        for at, (factor, levels, design) in enumerate(
            zip(factors, (question.levels, question.crossed_levels), (question.design, ""), strict=False)
        )
        if levels
    ]

    def cell(*levels: str) -> pd.DataFrame:
        own = cells.get(levels, none)
        for pair, level in zip(pairs, levels, strict=True):
            if pair.design == BETWEEN:
                own = own[own.index.isin(pair.candidates(level))]
        return own.dropna(how="all")

    design = ";".join(pair.design for pair in pairs)
    return Asked(_grouped(pairs, cell), design, pair=pairs[0])


def _grouped(pairs: Sequence[LevelPair], cell: Callable[..., pd.DataFrame]) -> tuple[pd.DataFrame, ...]:
    """Differences within subjects where they can be had, the numbers by group where not."""
    first, *second = pairs
    sides = (first.level, first.other)
    if not second:
        parts = tuple(cell(side) for side in sides)
    else:
        (cross,) = second
        ends = (cross.level, cross.other)
        if cross.design != WITHIN and first.design != WITHIN:
            return tuple(cell(side, end) for side in sides for end in ends)
        if cross.design != WITHIN:
            return tuple(_less(cell(sides[0], end), cell(sides[1], end)) for end in ends)
        parts = tuple(_less(cell(side, ends[0]), cell(side, ends[1])) for side in sides)
    return (_less(*parts),) if first.design == WITHIN else parts


def _slopes(numbers: pd.DataFrame, columns: list[Any], column: str) -> Asked:
    """Numbers against a covariate: of subjects who have several values of it each one's own slope."""
    numbers = numbers[numbers[column] != ""]
    numbers = numbers.assign(**{column: numbers[column].astype(float)})
    several = numbers.groupby("subject", sort=False)[column].nunique() > 1
    if len(several) and 2 * several.sum() >= len(several):
        own = numbers[numbers["subject"].isin(several.index[several])]
        slopes = own.groupby("subject", sort=False).apply(
            lambda rows: _slope(rows[column], rows[columns]), include_groups=False
        )
        return Asked((slopes,), WITHIN)
    by_session = numbers.groupby(["subject", "session"], sort=False)[[column, *columns]].mean()
    means = by_session.groupby("subject", sort=False).mean()
    return Asked((means[columns],), BETWEEN, covariate=means[column].to_numpy(float))


def _slope(x: pd.Series[float], values: pd.DataFrame) -> pd.Series[float]:
    """One subject's slope of each column by least squares; NaN where it has no two values of x."""
    known = values.notna()
    centred = known.mul(x, axis=0).where(known)
    centred = centred - centred.mean()
    squares = (centred**2).sum()
    return (centred * values).sum() / squares.where(squares > 0)


def _tested(own: Asked, among: int) -> FamilyVerdicts:
    groups = [group.to_numpy(float) for group in own.groups]
    if own.covariate is not None:
        return slope_family(own.covariate, groups[0], among)
    if len(groups) == 1:
        return within_family(groups[0], among)
    if len(groups) == 2:
        return between_family(groups[0], groups[1], among)
    return interaction_family(groups, among)


def _difference(own: Asked, column: Any) -> float:
    """The difference where too few subjects have it for a test; NaN of a slope."""
    if own.covariate is not None:
        return np.nan
    means = [float(group[column].mean()) for group in own.groups]
    return sum(sign * mean for sign, mean in zip(SIGNS, means, strict=False))


def _counts(own: Asked, counts: Sequence[int]) -> Row:
    """How many subjects are in the number, how many are not and why."""
    half = max(1, len(counts) // 2)
    n, n_other = sum(counts[:half]), sum(counts[half:])
    if own.pair is None:
        return {"n": n, "n_other": 0, "left_out": 0, "left_out_reason": ""}
    used = {subject for group in own.groups for subject in group.index}
    n_left_out, reason = own.pair.left_out(used)
    others = n if len(counts) == 1 else n_other
    return {"n": n, "n_other": others, "left_out": n_left_out, "left_out_reason": reason}


def _effect(own: Asked, column: Any) -> Row:
    """Standardised difference of one group from zero, or of two; nothing of a slope and of four."""
    if own.covariate is not None or own.pair is None or len(own.groups) > 2:
        return {}
    numbers = [group[column].dropna().to_numpy(float) for group in own.groups]
    first = numbers[0]
    if len(numbers) == 1:
        return effect_columns(WITHIN, first, np.zeros_like(first))
    return effect_columns(BETWEEN, first, numbers[1])


def _why(verdict: str, own: Asked, counts: Sequence[int]) -> str:
    """Why there is no answer; empty where there is one."""
    if verdict in (SHOWN, NOT_SHOWN):
        return ""
    if len(counts) == 1:
        kind = "undecided-within" if verdict == UNDECIDED else "few-at-both" if own.pair else "few-for-slope"
        return message_of(kind, n=counts[0], least=FEWEST_WITHIN)
    kind = "undecided-between" if verdict == UNDECIDED else "few-in-cells"
    return message_of(kind, counts=", ".join(map(str, counts)), least=FEWEST_IN_GROUP)
