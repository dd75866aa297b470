"""Compare two levels in every number, a subject at a time, and judge together what is said at once.

A family, of which p_holm and the verdicts are: every quantity, joint and angle, digit or pair of
digits in every hand and task, for one pair of levels under one model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from shukotsu.schemas.quantities import Quantity
from shukotsu.stages.compare_movement.level_pairs import WITHIN, LevelPair
from shukotsu.stages.compare_movement.movement_values import subject_means
from shukotsu.statistics.group_statistics import FEWEST_IN_GROUP, group_difference
from shukotsu.statistics.multiple_comparisons import LEVEL, holm
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS, Difference, paired_difference

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]

SHOWN, NOT_SHOWN = "shown", "not-shown"


def difference_rows(quantity: Quantity, numbers: pd.DataFrame, pairs: Sequence[LevelPair]) -> Iterator[Row]:
    """Rows of movement_differences for one quantity, over all pairs of levels, but for what `judge` adds.

    numbers : as `numbers_of` gives them.
    """
    for factor, of_factor in groupby(pairs, key=lambda pair: pair.factor):
        columns = [column for column in ("hand", "task") if column != factor]
        wide = subject_means(numbers, factor, [*columns, "model", "of"]).unstack("level", sort=False)
        families = dict(list(wide.groupby([*columns, "model"], sort=False))) if len(wide) else {}
        for pair in of_factor:
            where = {"hand": "", "task": "", **pair.place, "factor": factor, "quantity": quantity.name}
            where |= {"level": pair.level, "other_level": pair.other, "design": pair.design}
            for key, family in families.items():
                if key[:-1] != tuple(pair.place.values()):
                    continue
                levels = family.reindex(columns=[pair.level, pair.other])
                for of, rows in levels.groupby("of", sort=False):
                    values = rows.droplevel([name for name in rows.index.names if name != "subject"])
                    row = where | {"model": key[-1], "of": of, "unit": quantity.unit}
                    yield row | _row(values, pair)


def judge(rows: Sequence[Row]) -> None:
    """Correct every row's p by Holm over all of its pair of levels and model, and say what is shown."""
    families: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("factor", "level", "other_level", "model"))
        families.setdefault(key, []).append(row)
    for family in families.values():
        for row, p_holm in zip(family, holm([row["p"] for row in family]), strict=True):
            row["p_holm"] = p_holm
            row["verdict"] = "" if p_holm is None else SHOWN if p_holm <= LEVEL else NOT_SHOWN


def _row(values: pd.DataFrame, pair: LevelPair) -> Row:
    """One comparison. values : a row a subject, a column a level, NaN where there is none."""
    first = values.loc[values.index.isin(pair.candidates(pair.level)), pair.level].dropna()
    other = values.loc[values.index.isin(pair.candidates(pair.other)), pair.other].dropna()
    is_within = pair.design == WITHIN
    if is_within:
        both = first.index.intersection(other.index, sort=False)
        first, other = first[both], other[both]
    n, m = len(first), len(other)
    n_left_out, reason = pair.left_out({*first.index, *other.index})
    row: Row = {"n": n, "n_other": m, "left_out": n_left_out, "left_out_reason": reason, "message": ""}
    if n and m:
        row |= {"mean": float(first.mean()), "other_mean": float(other.mean())}
        row["difference"] = row["mean"] - row["other_mean"]
    found: Difference | None = None
    if is_within and n:
        found = paired_difference((first - other).to_numpy())
    elif not is_within and min(n, m) >= 2:
        found = group_difference(first.to_numpy(), other.to_numpy())
    row |= {"p": None, "test": "", "effect_size_name": ""}
    if found is not None and found.effect is not None and found.effect_interval is not None:
        low, high = found.effect_interval
        name = "d_z" if is_within else "hedges_g"
        row |= {"effect_size": found.effect, "effect_size_name": name, "effect_low": low, "effect_high": high}
    if min(n, m) == 0:
        row["message"] = f"no subject has a value at {'both levels' if is_within else 'one of the levels'}"
    elif is_within and n < FEWEST_SUBJECTS:
        row["message"] = f"not tested: {n} with both levels, a test needs {FEWEST_SUBJECTS} subjects"
    elif not is_within and min(n, m) < FEWEST_IN_GROUP:
        row["message"] = f"not tested: groups of {n} and {m} subjects, a test needs {FEWEST_IN_GROUP} in each"
    elif found is not None:
        row |= {"p": found.p, "test": "signs flipped" if is_within else "Welch's t, Cochran's p"}
        row["low"], row["high"] = found.interval or (None, None)
    return row
