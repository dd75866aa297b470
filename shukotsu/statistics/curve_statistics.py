"""Curves of n subjects over normalised time: where they differ, with one chance of a false positive a curve.

At every point a t is taken of the curves, and of curves with flipped signs (the same subjects twice) or with
subjects who changed groups. A difference is shown where |t| is among the largest 5 % of the largest |t| of
the resampled curves (T. E. Nichols, A. P. Holmes, Hum. Brain Mapp. 15, 2002; T. C. Pataky and others,
spm1d): this holds the false positives of the whole curve, however smooth it is, and needs no normal
distribution.

A subject may lack a stretch: a point is compared with those who have it, and not at all where they are too
few. Bands are pointwise 95 % intervals, Student's or Welch's; they say how well a point is known, not where
the curves differ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.statistics.group_statistics import (
    FEWEST_IN_GROUP,
    assignments,
    is_enumerated,
    welch_band,
    welch_t,
)
from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import (
    EQUAL,
    FEWEST_SUBJECTS,
    MOST_ENUMERATED,
    Array,
    sign_flips,
)

BLOCK = 2_000
"""Resampled curves that are held at once."""


@dataclass(frozen=True)
class CurveTest:
    """A difference of curves at k points; NaN where too few subjects have both.

    low, high : pointwise 95 % band. t : of the difference. p : two-sided, corrected for all points of the
    curve. threshold : |t| from which p is at most LEVEL; None where none can be. largest : the largest |t| of
    every resampled curve. n, n_other : subjects with a value anywhere.
    """

    difference: Array
    low: Array
    high: Array
    t: Array
    p: Array
    threshold: float | None
    largest: Array
    n: int
    n_other: int

    @property
    def significant(self) -> npt.NDArray[np.bool_]:
        """Mark where a difference is significant."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.p <= LEVEL)


def curves_within(differences: Array) -> CurveTest | None:
    """Test the curves (n, k) of n subjects' own differences; None with fewer than FEWEST_SUBJECTS.

    NaN is a point that a subject lacks. Signs are flipped a curve at a time, all of them up to
    MOST_ENUMERATED.
    """
    from scipy.special import stdtrit

    curves = _with_values(differences)
    n = len(curves)
    if n < FEWEST_SUBJECTS:
        return None
    known = np.isfinite(curves)
    counts = known.sum(axis=0).astype(float)
    counts[counts < FEWEST_SUBJECTS] = np.nan
    filled = np.where(known, curves, 0.0)
    squares = (filled**2).sum(axis=0)

    def means_and_errors(flips: Array) -> tuple[Array, Array]:
        means = flips @ filled / counts
        variances = np.maximum((squares - counts * means**2) / (counts - 1), EQUAL**2)
        return means, np.sqrt(variances / counts)

    mean, error = (part[0] for part in means_and_errors(np.ones((1, n))))
    half = -stdtrit(counts - 1, LEVEL / 2) * error
    flipped = (means_and_errors(rows) for rows in _blocks(sign_flips(n)))
    largest = np.concatenate([_largest(means / errors) for means, errors in flipped])
    band = (mean - half, mean + half)
    return _test(mean, band, mean / error, largest, (n, n), exact=n <= MOST_ENUMERATED)


def curves_between(values: Array, others: Array) -> CurveTest | None:
    """Test the curves (n, k) against those (m, k) of other subjects; None below FEWEST_IN_GROUP in either.

    NaN is a point that a subject lacks. t is Welch's. Points that fewer than FEWEST_IN_GROUP of a group have
    are not tested, under every assignment by its own groups, which keeps the test exact.
    """
    values, others = _with_values(values), _with_values(others)
    n, m = len(values), len(others)
    if min(n, m) < FEWEST_IN_GROUP:
        return None
    curves = np.concatenate([values, others])
    known = np.isfinite(curves).astype(float)

    def t_of(first: Array) -> Array:
        fewest = np.minimum(first @ known, (1.0 - first) @ known)
        return np.where(fewest >= FEWEST_IN_GROUP, welch_t(first, curves), np.nan)

    t = t_of(np.concatenate([np.ones(n), np.zeros(m)])[None])[0]
    low, high = (np.where(np.isnan(t), np.nan, edge) for edge in welch_band(values, others))
    largest = np.concatenate([_largest(t_of(rows)) for rows in _blocks(assignments(n, m))])
    return _test((low + high) / 2, (low, high), t, largest, (n, m), exact=is_enumerated(n, m))


def _with_values(curves: Array) -> Array:
    return curves[np.isfinite(curves).any(axis=1)]


def _blocks(rows: Array) -> Iterator[Array]:
    return (rows[start : start + BLOCK] for start in range(0, len(rows), BLOCK))


def _largest(t: Array) -> Array:
    """The largest |t| of every curve (a, k), NaN left out; 0 of a curve without any."""
    return np.asarray(np.nan_to_num(np.abs(t)).max(axis=1))


def _test(
    difference: Array, band: tuple[Array, Array], t: Array, largest: Array, n: tuple[int, int], *, exact: bool
) -> CurveTest:
    """Hold |t| (k,) against the largest of the resampled curves; of drawn ones the data count as one."""
    known = np.sort(largest)
    drawn = 0 if exact else 1
    reach = np.nan_to_num(np.abs(t)) * (1.0 - EQUAL)
    n_reached = drawn + len(known) - np.searchsorted(known, reach, side="left")
    p = np.where(np.isnan(t), np.nan, n_reached / (drawn + len(known)))
    allowed = int(LEVEL * (drawn + len(known)) + EQUAL) - drawn
    rare = known[np.searchsorted(known, known * (1.0 - EQUAL), side="left") >= len(known) - allowed]
    threshold = float(rare[0]) if len(rare) else None
    return CurveTest(difference, *band, t, p, threshold, largest, *n)
