"""Measure how well a number repeats when n subjects are measured k times.

ICC(2,1) (absolute agreement: the sessions are a sample of all) and ICC(3,1) (consistency), single measures:
P. E. Shrout, J. L. Fleiss, Psychol. Bull. 86, 1979, the F-based intervals of K. O. McGraw, S. P. Wong,
Psychol. Methods 1, 1996. SEM is the standard deviation within subjects, sessions' own shift included (H. C.
W. de Vet and others, J. Clin. Epidemiol. 59, 2006); MDC = 1.96 sqrt(2) SEM.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shukotsu.scores.paired_statistics import LEVEL, Array, Interval

Z_95 = 1.959963984540054
FEWEST_REPEATED = 3
"""Subjects, measured at least twice, from which repeatability is stated at all."""


@dataclass(frozen=True)
class Icc:
    """An intraclass correlation and its 95 % interval; NaN where all values are the same."""

    value: float
    interval: Interval


@dataclass(frozen=True)
class Reliability:
    """What values (n, k) say, in their unit; icc without one. sem_interval : 95 %."""

    n: int
    k: int
    agreement: Icc
    consistency: Icc
    sem: float
    sem_interval: Interval

    @property
    def mdc(self) -> float:
        """The smallest change of one subject between two sessions that is not measurement error, at 95 %."""
        return Z_95 * math.sqrt(2.0) * self.sem


def reliability(values: Array) -> Reliability:
    """Repeatability of values (n subjects, k sessions), all there; n and k at least 2."""
    from scipy.special import chdtri

    n, k = values.shape
    of_subjects, of_sessions, rest = mean_squares(values)
    freedom = n * (k - 1)
    within = ((k - 1) * of_sessions + (n - 1) * (k - 1) * rest) / freedom
    return Reliability(
        n,
        k,
        _agreement(n, k, of_subjects, of_sessions, rest),
        _consistency(n, k, of_subjects, rest),
        math.sqrt(within),
        (
            math.sqrt(within * freedom / chdtri(freedom, LEVEL / 2)),
            math.sqrt(within * freedom / chdtri(freedom, 1 - LEVEL / 2)),
        ),
    )


def mean_squares(values: Array) -> tuple[float, float, float]:
    """Mean squares of subjects, of sessions and of the rest in a two-way table (n, k)."""
    n, k = values.shape
    mean = values.mean()
    rows, columns = values.mean(axis=1) - mean, values.mean(axis=0) - mean
    rest = values - mean - rows[:, None] - columns
    return (
        float(k * (rows**2).sum() / (n - 1)),
        float(n * (columns**2).sum() / (k - 1)),
        float((rest**2).sum() / ((n - 1) * (k - 1))),
    )


def _agreement(n: int, k: int, of_subjects: float, of_sessions: float, rest: float) -> Icc:
    """ICC(2,1); degrees of freedom of its interval by F. E. Satterthwaite.

    Without a rest they are those of the sessions: a shift that all subjects share is no agreement.
    """
    spread = of_subjects + (k - 1) * rest + k * (of_sessions - rest) / n
    if spread <= 0 or (rest <= 0 and of_sessions <= 0):
        return _undefined(of_subjects, rest)
    value = (of_subjects - rest) / spread
    freedom = float(k - 1)
    if rest > 0:
        ratio = k * value * of_sessions / rest
        others = n * (1 + (k - 1) * value) - k * value
        freedom = (n - 1) * (k - 1) * (ratio + others) ** 2 / ((n - 1) * ratio**2 + others**2)
    share = 1 - LEVEL / 2
    upper, lower = _f(share, n - 1, freedom), _f(share, freedom, n - 1)
    whole = k * of_sessions + (k * n - k - n) * rest
    return Icc(
        value,
        (
            n * (of_subjects - upper * rest) / (upper * whole + n * of_subjects),
            n * (lower * of_subjects - rest) / (whole + n * lower * of_subjects),
        ),
    )


def _consistency(n: int, k: int, of_subjects: float, rest: float) -> Icc:
    """ICC(3,1)."""
    if rest <= 0:
        return _undefined(of_subjects, rest)
    ratio, freedom, share = of_subjects / rest, (n - 1) * (k - 1), 1 - LEVEL / 2
    low, high = ratio / _f(share, n - 1, freedom), ratio * _f(share, freedom, n - 1)
    return Icc((ratio - 1) / (ratio + k - 1), ((low - 1) / (low + k - 1), (high - 1) / (high + k - 1)))


def _undefined(of_subjects: float, rest: float) -> Icc:
    """Return 1 of sessions that repeat exactly, and nothing of values that are all the same."""
    value = 1.0 if of_subjects > 0 and rest <= 0 else math.nan
    return Icc(value, (value, value))


def _f(share: float, freedom: float, other: float) -> float:
    """Quantile of Fisher's F."""
    from scipy.special import fdtri

    return float(fdtri(freedom, other, share))
