"""Compare two levels in every number, a subject at a time, corrected over what is compared together.

p_holm and p_max_t are of all joints and angles, digits or pairs of digits of one quantity, for one pair of
levels, hand, task and model. A verdict is of all that is said of a pair of levels under a model at once:
every quantity in every hand and task.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.schemas.quantities import Quantity
from shukotsu.sentences.messages import message_of
from shukotsu.stages.compare_movement.level_pairs import WITHIN, LevelPair, level_pairs, places
from shukotsu.stages.compare_movement.movement_values import Recorded, subject_means
from shukotsu.statistics.curve_statistics import curves_between, curves_within
from shukotsu.statistics.group_statistics import FEWEST_IN_GROUP, two_groups
from shukotsu.statistics.multiple_comparisons import holm
from shukotsu.statistics.paired_statistics import (
    FEWEST_SUBJECTS,
    MOST_ENUMERATED,
    Array,
    effect_interval,
    paired,
)
from shukotsu.statistics.verdicts import (
    NOT_SHOWN,
    SHOWN,
    UNDECIDED,
    FamilyVerdicts,
    between_family,
    within_family,
)

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]

VALUES = "values"
"""Of a row that is not judged yet: its subjects' numbers at the level, and at the other."""


def difference_rows(quantity: Quantity, numbers: pd.DataFrame, everything: Recorded) -> Iterator[Row]:
    """Rows of movement_differences for one quantity, over every factor; and VALUES, which `judge` takes off.

    numbers : as `numbers_of` gives them.
    """
    for factor in everything.factors:
        columns = [column for column in ("hand", "task") if column != factor]
        cell = [*columns, "model", "of"]
        wide = subject_means(numbers, factor, cell)["value"].unstack("level", sort=False)
        families = dict(list(wide.groupby([*columns, "model"], sort=False))) if len(wide) else {}
        for place in places(everything, factor):
            for pair in level_pairs(everything, factor, place):
                for key, family in families.items():
                    if key[:-1] == tuple(place.values()):
                        yield from _family(quantity, family, pair, {**place, "model": key[-1]})


def judge(rows: Sequence[Row]) -> None:
    """Say of every row whether a difference is shown, corrected over all of its pair of levels and model."""
    families: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("factor", "level", "other_level", "model"))
        families.setdefault(key, []).append(row)
    for family in families.values():
        first, other = (_stacked([row[VALUES][side] for row in family]) for side in (0, 1))
        is_within = family[0]["design"] == WITHIN
        found = within_family(first - other) if is_within else between_family(first, other)
        for place, row in enumerate(family):
            del row[VALUES]
            row |= verdict_columns(found, place)


def verdict_columns(found: FamilyVerdicts, place: int) -> Row:
    """The verdict on one number of a family."""
    numbers = {"p_family": float(found.p[place]), "detectable": float(found.detectable[place])}
    return {"verdict": found.verdict[place], **numbers}


def verdict_at_once(found: FamilyVerdicts) -> tuple[str, float | None]:
    """The verdict on a whole family, whether it differs anywhere, and its p; None where it has no test."""
    given = set(found.verdict)
    verdict = next((one for one in (SHOWN, NOT_SHOWN, UNDECIDED) if one in given), "")
    return verdict, None if np.isnan(found.p).all() else float(np.nanmin(found.p))


def _stacked(numbers: Sequence[pd.Series[float]]) -> Array:
    """Subjects by numbers, NaN where one lacks one."""
    import pandas as pd

    return np.asarray(pd.concat(numbers, axis=1, sort=False), float)


def _family(quantity: Quantity, family: pd.DataFrame, pair: LevelPair, where: Row) -> list[Row]:
    rows, wanted = [], family.reindex(columns=[pair.level, pair.other])
    for of, own in wanted.groupby("of", sort=False):
        by_subject = own.droplevel([name for name in own.index.names if name != "subject"])
        rows.append(_row(by_subject, pair) | {"of": of})
    shared = {
        "hand": "", "task": "", **where, "quantity": quantity.name, "unit": quantity.unit,
        "factor": pair.factor, "level": pair.level, "other_level": pair.other, "design": pair.design,
    }  # fmt: skip
    together = _tested_together(wanted, pair)
    corrected = holm([row["p"] for row in rows])
    return [
        shared | row | {"p_holm": p, "p_max_t": None if row["p"] is None else together[row["of"]]}
        for row, p in zip(rows, corrected, strict=True)
    ]


def _tested_together(family: pd.DataFrame, pair: LevelPair) -> dict[str, float]:
    """Each number's p against the largest |t| of the family, subjects flipping or changing groups whole.

    Unlike Holm's correction it stays within reach of few subjects: with 6 and 6 the smallest p is 2 / 924,
    which no difference among 51 angles survives 51 times. It has no p for what has too few subjects.
    """
    wide = family.unstack("of", sort=False)
    first, other = (
        wide.loc[wide.index.get_level_values("subject").isin(pair.candidates(level)), level]
        for level in (pair.level, pair.other)
    )
    if pair.design == WITHIN:
        tested = curves_within((first - other).to_numpy())
    else:
        tested = curves_between(first.to_numpy(), other.to_numpy())
    p = np.full(len(first.columns), np.nan) if tested is None else tested.p
    return dict(zip(first.columns, p.tolist(), strict=True))


def _row(values: pd.DataFrame, pair: LevelPair) -> Row:
    """One comparison. values : a row a subject, a column a level, NaN where there is none."""
    first = values.loc[values.index.isin(pair.candidates(pair.level)), pair.level].dropna()
    other = values.loc[values.index.isin(pair.candidates(pair.other)), pair.other].dropna()
    if pair.design == WITHIN:
        both = first.index.intersection(other.index, sort=False)
        first, other = first[both], other[both]
    n_left_out, reason = pair.left_out({*first.index, *other.index})
    compare: Callable[[Array, Array], Row] = within_row if pair.design == WITHIN else between_row
    counts = {"n": len(first), "n_other": len(other), "left_out": n_left_out, "left_out_reason": reason}
    return counts | compare(first.to_numpy(), other.to_numpy()) | {VALUES: (first, other)}


_NOTHING: Row = {"p": None, "test": "", "effect_size_name": ""}


def within_row(first: Array, other: Array) -> Row:
    """Means, difference, effect size and test of numbers at both levels of the same subjects."""
    n = len(first)
    if n == 0:
        return _NOTHING | {"message": message_of("none-at-both")}
    found = paired(first - other)
    row: Row = {"mean": float(first.mean()), "other_mean": float(other.mean()), "difference": found.mean}
    row |= _NOTHING | {"message": ""}
    if found.effect is not None:
        d = first - other
        low, high = effect_interval(float(d.mean() / d.std(ddof=1)) * np.sqrt(n), n - 1, n)
        row |= _effect("d_z", found.effect, (low, high))
    if found.interval is None:
        return row | {"message": message_of("few-at-both", n=n, least=FEWEST_SUBJECTS)}
    row |= {"p": found.p, "test": "exact sign-flip" if n <= MOST_ENUMERATED else "sign-flip"}
    return row | {"low": found.interval[0], "high": found.interval[1]}


def between_row(first: Array, other: Array) -> Row:
    """The same of two groups."""
    if min(len(first), len(other)) == 0:
        return _NOTHING | {"message": message_of("none-at-one")}
    found = two_groups(first, other)
    row: Row = {"mean": found.mean, "other_mean": found.other_mean, "difference": found.difference}
    row |= _NOTHING | {"message": ""}
    if found.effect is not None and found.effect_interval is not None:
        row |= _effect("hedges_g", found.effect, found.effect_interval)
    if found.p is None or found.interval is None:
        counts = {"count": len(first), "count_2": len(other)}
        return row | {"message": message_of("few-in-group", least=FEWEST_IN_GROUP, **counts)}
    row |= {"p": found.p, "test": "exact permutation" if found.exact else "permutation"}
    return row | {"low": found.interval[0], "high": found.interval[1]}


def _effect(name: str, size: float, interval: Sequence[float]) -> Row:
    low, high = interval
    return {"effect_size": size, "effect_size_name": name, "effect_low": low, "effect_high": high}
