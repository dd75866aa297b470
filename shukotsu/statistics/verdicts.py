"""Say of a family of numbers which of them differ, so that a wrong "shown" is rare in the whole family.

Each number has a t of its own (of a mean of differences, Welch's, of a difference of differences, of a slope)
and a p under the least favourable distributions (`least_favourable`). As how many independent comparisons the
family counts is told by its own correlation: by the smallest p of all columns when the data are turned in
random directions (rotation test: O. Langsrud, Stat. Comput. 15, 2005), which is exact for normal numbers,
however few subjects and however many columns there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.statistics.least_favourable import (
    SIGNS,
    Singles,
    critical_t,
    largest_t_of_groups,
    largest_t_of_slope,
    p_of_t,
    slopes,
)
from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import EQUAL, Array

SHOWN, NOT_SHOWN, UNDECIDED = "shown", "not-shown", "undecided"

N_TURNS = 10_000
BLOCK = 1_000
"""Turned families that are held at once."""

POWER = 0.8
HUGE, LEAST_POWER = 3.0, 0.5
"""Groups that would miss a difference of HUGE standard deviations more often than not decide nothing."""

FEWEST_WITHIN, FEWEST_IN_GROUP, FEWEST_ON_SLOPE = 6, 4, 6
"""Subjects: fewer say too little of how they spread."""


@dataclass(frozen=True)
class FamilyVerdicts:
    """What is said of K columns together; NaN, and an empty verdict, where too few subjects have a number.

    low, high, p_alone : 95 % interval and two-sided p of one difference alone, Student's or Welch's. p :
    corrected over the family, under the worst null; t_threshold : |t| from which it is at most LEVEL.
    detectable : the true difference that is shown in 80 % of such studies. n_comparisons : as how many
    independent comparisons the family counts. Of a family that is one among several, all of this but p is
    at their share of LEVEL.
    """

    difference: Array
    low: Array
    high: Array
    t: Array
    p_alone: Array
    t_threshold: Array
    p: Array
    detectable: Array
    verdict: list[str]
    n_comparisons: float

    def part(self, columns: slice) -> FamilyVerdicts:
        """Give the verdicts on some columns, as the whole family has them."""
        parts = {name: value[columns] for name, value in vars(self).items() if name != "n_comparisons"}
        return replace(self, **parts)


@dataclass(frozen=True)
class _Columns:
    """Estimates of K columns, their errors and degrees of freedom (K,), NaN where not tested.

    largest : by column the |t| of the worst null; None where not tested. turned : numbers (n, K) without what
    is not asked about, 0 where missing; they vary in so many dimensions. huge : (K,) the t to be expected of
    a difference of HUGE, and its degrees of freedom.
    """

    difference: Array
    error: Array
    freedom: Array
    largest: list[Singles | None]
    turned: Array
    dimensions: int
    huge: Array
    huge_freedom: Array


def within_family(differences: Array, among: int = 1) -> FamilyVerdicts:
    """Give verdicts on the means of columns (n, K) of differences; NaN is a number that is missing."""
    return _verdicts(_groups([differences], FEWEST_WITHIN), among)


def between_family(values: Array, others: Array, among: int = 1) -> FamilyVerdicts:
    """Give verdicts on the difference of the means of groups (n, K) and (m, K)."""
    return _verdicts(_groups([values, others], FEWEST_IN_GROUP), among)


def interaction_family(cells: Sequence[Array], among: int = 1) -> FamilyVerdicts:
    """Give verdicts on (a - b) - (c - d), the means of four groups (n_i, K)."""
    return _verdicts(_groups(cells, FEWEST_IN_GROUP), among)


def slope_family(covariate: Array, values: Array, among: int = 1) -> FamilyVerdicts:
    """Give verdicts on the change of columns (n, K) per unit of a covariate (n,), both of n subjects."""
    return _verdicts(_slope(covariate, values), among)


def _groups(groups: Sequence[Array], fewest: int) -> _Columns:
    counts = np.array([np.isfinite(group).sum(axis=0) for group in groups])
    counted = np.where(counts.min(axis=0) >= fewest, counts, np.nan)
    width = (1.0 / counted).sum(axis=0)
    difference, square, inverse_freedom = np.zeros((3, counts.shape[1]))
    residuals = []
    with np.errstate(invalid="ignore"):
        for sign, group, n in zip(SIGNS, groups, counted, strict=False):
            mean = np.nan_to_num(group).sum(axis=0) / n
            residuals.append(np.where(np.isfinite(group), group - mean, 0.0))
            own = np.maximum((residuals[-1] ** 2).sum(axis=0) / (n - 1), EQUAL**2) / n
            difference, square = difference + sign * mean, square + own
            inverse_freedom = inverse_freedom + own**2 / (n - 1)
    asked = [
        np.where(np.isfinite(group), sign * difference / (width * n), 0.0)
        for sign, group, n in zip(SIGNS, groups, counted, strict=False)
    ]
    return _Columns(
        difference,
        np.sqrt(square),
        square**2 / inverse_freedom,
        [largest_t_of_groups(tuple(own)) if min(own) >= fewest else None for own in counts.T.tolist()],
        np.concatenate(residuals) + np.concatenate(asked),
        sum(map(len, groups)) - len(groups) + 1,
        HUGE / np.sqrt(width),
        counted.sum(axis=0) - len(groups),
    )


def _slope(covariate: Array, values: Array) -> _Columns:
    known = np.isfinite(values) & np.isfinite(covariate)[:, None]
    difference, error, freedom, huge = np.full((4, values.shape[1]), np.nan)
    largest: list[Singles | None] = [None] * values.shape[1]
    turned = np.zeros(values.shape)
    for mask in np.unique(known, axis=1).T:
        place = covariate[mask] - covariate[mask].min(initial=np.inf)
        if len(place) < FEWEST_ON_SLOPE or np.ptp(place) == 0:
            continue
        same = np.flatnonzero((known == mask[:, None]).all(axis=0))
        own, place = values[np.ix_(mask, same)], place / np.ptp(place)
        difference[same], error[same] = slopes(covariate[mask], own)
        freedom[same] = len(place) - 2
        huge[same] = HUGE * np.sqrt(((place - place.mean()) ** 2).sum())
        turned[np.ix_(mask, same)] = own - own.mean(axis=0)
        for column in same:
            largest[column] = largest_t_of_slope(tuple(place.tolist()))
    dimensions = int(known.any(axis=1).sum()) - 1
    return _Columns(difference, error, freedom, largest, turned, dimensions, huge, freedom)


def _verdicts(columns: _Columns, among: int) -> FamilyVerdicts:
    from scipy.special import nctdtr, nctdtrinc, stdtr, stdtrit

    tested = [k for k, own in enumerate(columns.largest) if own is not None]
    t, half = columns.difference / columns.error, -stdtrit(columns.freedom, LEVEL / 2) * columns.error
    p, threshold, detectable = np.full((3, len(t)), np.nan)
    verdict, count = [""] * len(t), np.nan
    smallest = _largest_turns(columns) if tested else np.zeros(0)
    if tested:
        share = LEVEL / among
        level = min(share, float(np.quantile(smallest, share)))
        count = float(np.log1p(-share) / np.log1p(-level))
    for k in tested:
        largest = columns.largest[k]
        assert largest is not None
        alone = p_of_t(t[k], largest)
        n_smaller = np.searchsorted(smallest, alone * (1.0 + EQUAL), side="right")
        p[k] = max(alone, min((1.0 + n_smaller) / (1.0 + len(smallest)), alone * len(tested)))
        threshold[k] = critical_t(level, largest)
        detectable[k] = columns.error[k] * nctdtrinc(columns.freedom[k], 1.0 - POWER, threshold[k])
        power = 1.0 - nctdtr(columns.huge_freedom[k], columns.huge[k], threshold[k])
        verdict[k] = SHOWN if p[k] <= share else NOT_SHOWN if power >= LEAST_POWER else UNDECIDED
    low, high = columns.difference - half, columns.difference + half
    p_alone = 2.0 * stdtr(columns.freedom, -np.abs(t))
    return FamilyVerdicts(columns.difference, low, high, t, p_alone, threshold, p, detectable, verdict, count)


def _largest_turns(columns: _Columns) -> Array:
    """The p of the largest of all columns in each turned family, ascending (N_TURNS,).

    A direction is drawn in the space of all that is asked about; a column lies within it, and the more alike
    two columns are, the more often one direction is far along both.
    """
    from scipy.special import stdtr

    numbers = columns.turned[:, [own is not None for own in columns.largest]]
    lengths = np.sqrt((numbers**2).sum(axis=0))
    _, spread, axes = np.linalg.svd(numbers / np.where(lengths > EQUAL, lengths, np.inf), full_matrices=False)
    axes = (spread[:, None] * axes)[spread > EQUAL]
    rng = np.random.default_rng((len(numbers), len(axes)))
    along = rng.standard_normal((N_TURNS, len(axes)))
    rest = rng.chisquare(columns.dimensions - len(axes), N_TURNS) if columns.dimensions > len(axes) else 0.0
    blocks = (along[start : start + BLOCK] for start in range(0, N_TURNS, BLOCK))
    largest = np.concatenate([np.abs(block @ axes).max(axis=1) for block in blocks])
    share = np.minimum(largest**2 / ((along**2).sum(axis=1) + rest), 1.0)
    freedom = columns.dimensions - 1
    with np.errstate(divide="ignore"):
        return np.sort(2.0 * stdtr(freedom, -np.sqrt(freedom * share / (1.0 - share))))
