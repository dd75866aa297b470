"""Find where in the cycle two levels differ: a subject's mean curve at each, all curves tested together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.stages.compare_movement.level_differences import untested_reason, verdict_at_once
from shukotsu.stages.compare_movement.level_pairs import WITHIN, LevelPair, level_pairs, places
from shukotsu.stages.compare_movement.movement_values import RECORDING, Recorded, subject_means
from shukotsu.statistics.verdicts import SHOWN, FamilyVerdicts, between_family, within_family

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]
Columns = dict[str, Any]

CURVE = ["joint", "angle", "event"]
COLUMNS = [*RECORDING, "model", *CURVE, "percent", "mean_deg"]
"""Of movement_curves, what is read."""


def curve_parts(curves: pd.DataFrame, everything: Recorded) -> Iterator[Columns]:
    """Parts of the columns of curve_differences, a part for every curve of a pair of levels, place and model.

    curves : COLUMNS of movement_curves.
    """
    numbers = curves.astype(dict.fromkeys([*RECORDING, "model"], str)).merge(everything.counted, on=RECORDING)
    for factor in everything.factors:
        compared: dict[tuple[str, ...], list[_Curve]] = {}
        for place in places(everything, factor):
            own = numbers
            for column, value in place.items():
                own = own[own[column] == value]
            for model, of_model in own.groupby("model", sort=False):
                means = subject_means(of_model, factor, [*CURVE, "percent"], ("mean_deg",))["mean_deg"]
                for pair in level_pairs(everything, factor, place):
                    where = {"hand": "", "task": "", **place, "model": model}
                    family = compared.setdefault((pair.level, pair.other, str(model)), [])
                    family += _curves(means.unstack("percent"), pair, where)
        for family in compared.values():
            yield from _judged(family)


@dataclass(frozen=True)
class _Curve:
    """Subjects' curves at two levels, a column a percent, of the joint, angle, event and place named."""

    first: pd.DataFrame
    other: pd.DataFrame
    design: str
    named: Row


def _curves(wide: pd.DataFrame, pair: LevelPair, where: Row) -> Iterator[_Curve]:
    named = where | {"factor": pair.factor, "level": pair.level, "other_level": pair.other}
    for (event, joint, angle), own in wide.groupby(["event", "joint", "angle"], sort=False, observed=True):
        curves = own.droplevel(CURVE)
        first, other = (_of_level(curves, pair, level) for level in (pair.level, pair.other))
        if pair.design == WITHIN:
            both = first.index.intersection(other.index, sort=False)
            first, other = first.loc[both], other.loc[both]
        yield _Curve(first, other, pair.design, named | {"joint": joint, "angle": angle, "event": event})


def _of_level(curves: pd.DataFrame, pair: LevelPair, level: str) -> pd.DataFrame:
    own = curves[curves.index.get_level_values("level") == level].droplevel("level")
    return own[own.index.isin(pair.candidates(level))].dropna(how="all")


def _judged(family: Sequence[_Curve]) -> Iterator[Columns]:
    """Test every point of every curve of a pair of levels under a model together."""
    import pandas as pd

    first, other = (
        np.asarray(pd.concat([getattr(one, side) for one in family], axis=1, sort=False), float)
        for side in ("first", "other")
    )
    found = within_family(first - other) if family[0].design == WITHIN else between_family(first, other)
    start = 0
    for one in family:
        points = slice(start, start + one.first.shape[1])
        start = points.stop
        yield _columns(one, found.part(points))


def _columns(one: _Curve, found: FamilyVerdicts) -> Columns:
    percents = one.first.columns.to_numpy()
    n, n_other = len(one.first), len(one.other)
    verdict, p = verdict_at_once(found)
    message = untested_reason(one.design, n, n_other) if p is None else ""
    of_means = (one.first.mean() - one.other.mean()).to_numpy(float)  # known also where nothing is tested
    whole = one.named | {"n": n, "n_other": n_other, "verdict": verdict, "p_holm": p, "message": message}
    return {
        "percent": percents,
        "difference": of_means if p is None else found.difference,
        "low": found.low,
        "high": found.high,
        "t": found.t,
        "t_threshold": found.t_threshold,
        "significant": [verdict == SHOWN for verdict in found.verdict],
        "p": found.p,
        "detectable": found.detectable,
    } | {name: [value] * len(percents) for name, value in whole.items()}
