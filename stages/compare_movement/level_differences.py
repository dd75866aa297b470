"""Pairs of a factor's levels, and every number compared over them, a subject at a time.

A family, of which p_holm and the verdicts are: every quantity, joint and angle, digit or pair of
digits in every hand and task, for one pair of levels under one model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import TYPE_CHECKING, Any

from shukotsu.errors import listed
from shukotsu.schemas.quantities import Quantity
from shukotsu.stages.compare_movement.movement_values import (
    SUSPECT,
    Recorded,
    in_order,
    level_column,
    subject_means,
)
from shukotsu.statistics.paired_statistics import (
    FEWEST_IN_GROUP,
    FEWEST_SUBJECTS,
    LEVEL,
    Difference,
    group_difference,
    holm,
    paired_difference,
)

if TYPE_CHECKING:
    import pandas as pd

WITHIN, BETWEEN = "within", "between"


@dataclass(frozen=True)
class LevelPair:
    """Two levels of a factor in one place: a hand and a task, less the factor itself.

    design : within where at least as many of the study's subjects have both levels as have one, else between.
    levels_of : each subject's levels among the two, recordings that count or not; between groups those that
    they have in any place. suspect : subjects of whom some recordings do not count, or none does, in these
    words. without : subjects who were recorded there and have no level.
    """

    factor: str
    place: Mapping[str, str]
    level: str
    other: str
    design: str
    levels_of: Mapping[str, frozenset[str]]
    suspect: Mapping[str, str]
    without: Sequence[str]

    def candidates(self, level: str) -> frozenset[str]:
        """Subjects that may stand for the level: within those with both, between those with it alone."""
        wanted = {self.level, self.other} if self.design == WITHIN else {level}
        return frozenset(subject for subject, levels in self.levels_of.items() if levels == wanted)

    def left_out(self, used: Collection[str]) -> tuple[int, str]:
        """Count the subjects not in `used`, and say why they, or some recordings of others, are not."""
        reasons: dict[str, list[str]] = {}
        for subject in sorted(self.levels_of, key=lambda name: name in used):
            levels, reason = self.levels_of[subject], self.suspect.get(subject, "")
            if subject not in used and reason != SUSPECT:
                if self.design == WITHIN and len(levels) == 1:
                    reason = f"only at {next(iter(levels))}"
                elif self.design == BETWEEN and len(levels) == 2:
                    reason = "at both levels"
                reason = reason or "no value"
            if reason:
                reasons.setdefault(reason, []).append(subject)
        if self.without:
            reasons[f"no level of {self.factor}"] = list(self.without)
        text = "; ".join(f"{reason}: {listed(subjects)}" for reason, subjects in reasons.items())
        return sum(name not in used for name in self.levels_of) + len(self.without), text


def level_pairs(everything: Recorded) -> Iterator[LevelPair]:
    """Pairs of every factor's levels, in every hand and task of the study, less the one that is the factor.

    Levels stand in the sheet's order, which is one for all places.
    """
    for factor in everything.factors:
        column = level_column(factor)
        study = everything.rows[everything.rows[column] != ""]
        order = in_order(study, column)
        names = [name for name in ("hand", "task") if name != factor]
        for key, in_place in everything.rows.groupby(names, sort=False):
            here = in_place[in_place[column] != ""]
            without = in_place.loc[~in_place["subject"].isin(here["subject"]), "subject"].unique().tolist()
            for levels in combinations([level for level in order if level in {*here[column]}], 2):
                rows = here[here[column].isin(levels)]
                anywhere = _levels_of(study[study[column].isin(levels)], column)
                both = sum(len(levels_there) == 2 for levels_there in anywhere.values())
                design = WITHIN if 2 * both >= len(anywhere) else BETWEEN
                levels_of = _levels_of(rows, column)
                if design == BETWEEN:
                    levels_of = {subject: anywhere[subject] for subject in levels_of}
                share = (rows["left_out"] != "").groupby(rows["subject"], sort=False).mean()
                suspect = {str(name): SUSPECT + " in part" * (of < 1) for name, of in share.items() if of > 0}
                where = {str(name): str(value) for name, value in zip(names, key, strict=True)}
                yield LevelPair(factor, where, *levels, design, levels_of, suspect, without)


def _levels_of(rows: pd.DataFrame, column: str) -> dict[str, frozenset[str]]:
    return {
        str(subject): frozenset(levels) for subject, levels in rows.groupby("subject", sort=False)[column]
    }


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
    """Return one comparison. values : a row a subject, a column a level, NaN where there is none."""
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
    result: Difference | None = None
    if is_within and n:
        result = paired_difference((first - other).to_numpy())
    elif not is_within and min(n, m) >= 2:
        result = group_difference(first.to_numpy(), other.to_numpy())
    row |= {"p": None, "test": "", "effect_size_name": ""}
    if result is not None and result.effect is not None and result.effect_interval is not None:
        low, high = result.effect_interval
        name = "d_z" if is_within else "hedges_g"
        row |= {
            "effect_size": result.effect,
            "effect_size_name": name,
            "effect_low": low,
            "effect_high": high,
        }
    if min(n, m) == 0:
        row["message"] = f"no subject has a value at {'both levels' if is_within else 'one of the levels'}"
    elif is_within and n < FEWEST_SUBJECTS:
        row["message"] = f"not tested: {n} with both levels, a test needs {FEWEST_SUBJECTS} subjects"
    elif not is_within and min(n, m) < FEWEST_IN_GROUP:
        row["message"] = f"not tested: groups of {n} and {m} subjects, a test needs {FEWEST_IN_GROUP} in each"
    elif result is not None:
        row |= {"p": result.p, "test": "signs flipped" if is_within else "Welch's t, Cochran's p"}
        row["low"], row["high"] = result.interval or (None, None)
    return row
