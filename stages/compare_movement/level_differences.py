"""Compare two levels in every number, a subject at a time, and judge together what is said at once.

A family, of which p_holm and the verdicts are: every quantity, joint and angle, digit or pair of
digits in every hand and task, for one pair of levels under one model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.schemas.quantities import Quantity
from shukotsu.stages.compare_movement.level_pairs import WITHIN, LevelPair, level_pairs, places
from shukotsu.stages.compare_movement.movement_values import Recorded, subject_means
from shukotsu.statistics.difference_tests import (
    FEWEST_IN_GROUP,
    FEWEST_WITHIN,
    NOT_SHOWN,
    SHOWN,
    group_test,
    paired_test,
)
from shukotsu.statistics.effect_sizes import paired_effect, two_group_effect
from shukotsu.statistics.multiple_comparisons import LEVEL, holm
from shukotsu.statistics.paired_statistics import Array

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
        wide = subject_means(numbers, factor, cell).unstack("level", sort=False)
        families = dict(list(wide.groupby([*columns, "model"], sort=False))) if len(wide) else {}
        for place in places(everything, factor):
            for pair in level_pairs(everything, factor, place):
                for key, family in families.items():
                    if key[:-1] == tuple(place.values()):
                        where = {**place, "model": key[-1], "quantity": quantity.name}
                        yield from _family(family, pair, where | {"unit": quantity.unit})


def judge(rows: Sequence[Row]) -> None:
    """Test every row, corrected by Holm over all of its pair of levels and model."""
    families: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("factor", "level", "other_level", "model"))
        families.setdefault(key, []).append(row)
    for family in families.values():
        for row in family:
            first, other = (np.asarray(numbers, float) for numbers in row.pop(VALUES))
            row |= {"p": None, "test": "", "verdict": ""}
            if not row["message"]:
                is_within = row["design"] == WITHIN
                p, low, high = paired_test(first - other) if is_within else group_test(first, other)
                test = "signs flipped" if is_within else "Welch's t, Cochran's p"
                row |= {"p": p, "low": low, "high": high, "test": test}
        for row, p_holm in zip(family, holm([row["p"] for row in family]), strict=True):
            row["p_holm"] = p_holm
            if p_holm is not None:
                row["verdict"] = SHOWN if p_holm <= LEVEL else NOT_SHOWN


def _family(family: pd.DataFrame, pair: LevelPair, where: Row) -> Iterator[Row]:
    shared = {
        "hand": "", "task": "", **where,
        "factor": pair.factor, "level": pair.level, "other_level": pair.other, "design": pair.design,
    }  # fmt: skip
    for of, own in family.reindex(columns=[pair.level, pair.other]).groupby("of", sort=False):
        by_subject = own.droplevel([name for name in own.index.names if name != "subject"])
        yield shared | _row(by_subject, pair) | {"of": of}


def _row(values: pd.DataFrame, pair: LevelPair) -> Row:
    """One comparison, not judged yet. values : a row a subject, a column a level, NaN where there is none."""
    first = values.loc[values.index.isin(pair.candidates(pair.level)), pair.level].dropna()
    other = values.loc[values.index.isin(pair.candidates(pair.other)), pair.other].dropna()
    if pair.design == WITHIN:
        both = first.index.intersection(other.index, sort=False)
        first, other = first[both], other[both]
    n_left_out, reason = pair.left_out({*first.index, *other.index})
    row: Row = {"n": len(first), "n_other": len(other), "left_out": n_left_out, "left_out_reason": reason}
    if len(first) and len(other):
        row |= {"mean": float(first.mean()), "other_mean": float(other.mean())}
        row["difference"] = row["mean"] - row["other_mean"]
    row |= _effect_columns(pair.design, first.to_numpy(), other.to_numpy())
    return row | {"message": _untested_reason(pair.design, len(first), len(other)), VALUES: (first, other)}


def _untested_reason(design: str, n: int, n_other: int) -> str:
    """Say why there is no test; empty where there is one."""
    if min(n, n_other) == 0:
        return f"no subject has a value at {'both levels' if design == WITHIN else 'one of the levels'}"
    if design == WITHIN:
        why = f"not tested: {n} with both levels, a test needs {FEWEST_WITHIN} subjects"
        return "" if n >= FEWEST_WITHIN else why
    why = f"not tested: groups of {n} and {n_other} subjects, a test needs {FEWEST_IN_GROUP} in each"
    return why if min(n, n_other) < FEWEST_IN_GROUP else ""


def _effect_columns(design: str, first: Array, other: Array) -> Row:
    """Standardised difference of numbers at two levels, of the same subjects or of groups."""
    name, effect = ("d_z", paired_effect) if design == WITHIN else ("hedges_g", two_group_effect)
    found = effect(first, other)
    if found is None:
        return {"effect_size_name": ""}
    size, (low, high) = found
    return {"effect_size": size, "effect_size_name": name, "effect_low": low, "effect_high": high}
