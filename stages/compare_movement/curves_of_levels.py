"""Find where in the cycle two levels differ: a subject's mean curve at each, tested over the whole curve at
once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.sentences.messages import message_of
from shukotsu.stages.compare_movement.level_differences import verdict_at_once
from shukotsu.stages.compare_movement.level_pairs import WITHIN, LevelPair, level_pairs, places
from shukotsu.stages.compare_movement.movement_values import RECORDING, Recorded, subject_means
from shukotsu.statistics.curve_statistics import CurveTest, curves_between, curves_within
from shukotsu.statistics.group_statistics import FEWEST_IN_GROUP
from shukotsu.statistics.multiple_comparisons import LEVEL, holm
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS, Array
from shukotsu.statistics.verdicts import NOT_SHOWN, SHOWN, FamilyVerdicts, between_family, within_family

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]
Columns = dict[str, Any]

CURVE = ["joint", "angle", "event"]
COLUMNS = [*RECORDING, "model", *CURVE, "percent", "mean_deg"]
"""Of movement_curves, what is read."""


def curve_parts(curves: pd.DataFrame, everything: Recorded) -> Iterator[Columns]:
    """Parts of the columns of curve_differences, a part for all curves of a pair of levels, place and model.

    curves : COLUMNS of movement_curves.
    """
    numbers = curves.astype(dict.fromkeys([*RECORDING, "model"], str)).merge(everything.counted, on=RECORDING)
    for factor in everything.factors:
        compared: dict[tuple[str, ...], list[tuple[Columns, FamilyVerdicts]]] = {}
        for place in places(everything, factor):
            own = numbers
            for column, value in place.items():
                own = own[own[column] == value]
            for model, of_model in own.groupby("model", sort=False):
                means = subject_means(of_model, factor, [*CURVE, "percent"], ("mean_deg",))["mean_deg"]
                for pair in level_pairs(everything, factor, place):
                    where = {"hand": "", "task": "", **place, "model": model}
                    together = compared.setdefault((pair.level, pair.other, str(model)), [])
                    together += _family(means, pair, where)
        for together in compared.values():
            yield from _judged(together)


def _judged(compared: Sequence[tuple[Columns, FamilyVerdicts]]) -> Iterator[Columns]:
    """Say of every curve of a pair of levels under a model whether it differs, Holm over all of them."""
    found = [verdict_at_once(verdicts) for _, verdicts in compared]
    for (columns, _), (verdict, _), p in zip(compared, found, holm([p for _, p in found]), strict=True):
        size = len(columns["percent"])
        shown = NOT_SHOWN if verdict == SHOWN and p is not None and p > LEVEL else verdict
        yield columns | {"p_family": [p] * size, "verdict": [shown] * size}


def _family(means: pd.Series[float], pair: LevelPair, where: Row) -> Iterator[tuple[Columns, FamilyVerdicts]]:
    """All curves of a pair of levels in one place under one model, Holm over joints and angles."""
    wide = means.unstack("percent")
    percents = wide.columns.to_numpy()
    shared = where | {"factor": pair.factor, "level": pair.level, "other_level": pair.other}
    for event, of_event in wide.groupby("event", sort=False, observed=True):
        tests = [
            (joint, angle, *_tested(own, pair))
            for (joint, angle), own in of_event.groupby(["joint", "angle"], sort=False, observed=True)
        ]
        smallest = [_smallest(test.p) for _, _, test, _, _ in tests]
        for (joint, angle, test, verdicts, why), p in zip(tests, holm(smallest), strict=True):
            named = shared | {"joint": joint, "angle": angle, "event": event, "message": why, "p_holm": p}
            every = {name: [value] * len(percents) for name, value in named.items()}
            yield _columns(test, percents) | every, verdicts


def _tested(own: pd.DataFrame, pair: LevelPair) -> tuple[CurveTest, FamilyVerdicts, str]:
    """Test one curve, (subject, level) by percent; without a test the difference of the means, and why."""
    curves = own.droplevel(CURVE)
    first, other = (_of_level(curves, pair, level) for level in (pair.level, pair.other))
    if pair.design == WITHIN:
        both = first.index.intersection(other.index, sort=False)
        differences = (first.loc[both] - other.loc[both]).to_numpy()
        n = int(np.isfinite(differences).any(axis=1).sum())
        why = message_of("few-at-both", n=n, least=FEWEST_SUBJECTS)
        test, verdicts = curves_within(differences), within_family(differences)
        return (test, verdicts, "") if test else (_untested(_means(differences), n, n), verdicts, why)
    counts = len(first), len(other)
    why = message_of("few-in-group", count=counts[0], count_2=counts[1], least=FEWEST_IN_GROUP)
    test = curves_between(first.to_numpy(), other.to_numpy())
    verdicts = between_family(first.to_numpy(), other.to_numpy())
    difference = _means(first.to_numpy()) - _means(other.to_numpy())
    return (test, verdicts, "") if test else (_untested(difference, *counts), verdicts, why)


def _of_level(curves: pd.DataFrame, pair: LevelPair, level: str) -> pd.DataFrame:
    own = curves[curves.index.get_level_values("level") == level].droplevel("level")
    return own[own.index.isin(pair.candidates(level))].dropna(how="all")


def _means(curves: Array) -> Array:
    counts = np.isfinite(curves).sum(axis=0)
    return np.asarray(np.where(counts, np.nan_to_num(curves).sum(axis=0) / np.maximum(counts, 1), np.nan))


def _untested(difference: Array, n: int, n_other: int) -> CurveTest:
    none = np.full(len(difference), np.nan)
    return CurveTest(difference, none, none, none, none, None, none, n, n_other)


def _smallest(p: Array) -> float | None:
    return None if np.isnan(p).all() else float(np.nanmin(p))


def _columns(test: CurveTest, percents: Array) -> Columns:
    size = len(percents)
    return {
        "percent": percents,
        "difference": test.difference,
        "low": test.low,
        "high": test.high,
        "t": test.t,
        "t_threshold": [test.threshold] * size,
        "significant": test.significant,
        "p": test.p,
        "n": [test.n] * size,
        "n_other": [test.n_other] * size,
    }
