"""Errors of many hands summed up: what a row of the tables says of one estimator in one scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.score import HandScore
from skeleton.rotations import Array

GROSS_MM = 5.0


@dataclass(frozen=True)
class Metric:
    """A number of a summary: its column's head and format, the statistic, and what a hand adds to it.

    values : of one hand; None and NaN are what was not stated or estimated, and do not count.
    """

    head: str
    form: str
    statistic: Callable[[Array], Any]
    values: Callable[[HandScore], Iterable[float | None]]


def _of_joints(name: str) -> Callable[[HandScore], Iterable[float | None]]:
    return lambda hand: (getattr(joint, name) for joint in hand.joints)


def _percent(shares: npt.ArrayLike) -> float:
    return 100.0 * float(np.mean(np.asarray(shares)))


METRICS = {
    "n_hands": Metric("hands", "d", len, lambda _: [1.0]),
    "median_mm": Metric("median mm", ".2f", np.median, _of_joints("child_mm")),
    "p90_mm": Metric("p90 mm", ".2f", lambda mm: np.percentile(mm, 90), _of_joints("child_mm")),
    "along_mm": Metric("along mm", ".2f", np.median, _of_joints("along_mm")),
    "across_mm": Metric("across mm", ".2f", np.median, _of_joints("across_mm")),
    "gross_percent": Metric("> 5 mm %", ".1f", lambda mm: _percent(mm > GROSS_MM), _of_joints("child_mm")),
    "axis_deg": Metric("axis deg", ".1f", np.median, _of_joints("axis_deg")),
    "bone_percent": Metric("bones %", ".1f", np.median, lambda hand: hand.bones_percent),
    "palm_deg": Metric("palm deg", ".1f", np.mean, lambda hand: hand.palm_deg),
    "radius_percent": Metric("in radius %", ".1f", _percent, _of_joints("in_radius")),
    "ellipsoid_percent": Metric("in ellipsoid %", ".1f", _percent, _of_joints("in_ellipsoid")),
    "seconds": Metric("CPU s", ".2f", np.mean, lambda hand: [hand.seconds]),
}
"""Over all counted joints, hinges, phalanges, ulnar metacarpals or hands of one estimator, by name."""

Summary = Mapping[str, Any]
"""By the name of a metric; None where nothing was estimated or stated."""


def summary(hands: Sequence[HandScore]) -> Summary:
    """Sum up the scores of one estimator."""
    numbers: dict[str, int | float | None] = {}
    for name, metric in METRICS.items():
        known = [value for hand in hands for value in metric.values(hand) if value is not None]
        values = np.array(known, float)[np.isfinite(known)] if known else np.empty(0)
        number = metric.statistic(values) if len(values) else None
        numbers[name] = number if number is None or isinstance(number, int) else float(number)
    return numbers
