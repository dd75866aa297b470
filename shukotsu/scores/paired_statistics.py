"""Statistics of differences and of repeated measurements: tests, intervals, effect sizes, ICC.

Paired test: the signs of the differences are flipped, exhaustively or at random. This is exact if the
differences are distributed symmetrically about 0 under the null hypothesis (R. A. Fisher, The Design of
Experiments, 1935). With random flips, the data themselves are included as one of them (B. Phipson, G. K.
Smyth, Stat. Appl. Genet. Mol. Biol. 9, 2010). The flips for n subjects form one matrix that is used for all
comparisons of a study; scipy.stats.permutation_test computes the same p but takes a hundred times as long.

Interval: Student's t. Effect size: Cohen's d_z with the exact small-sample correction (L. V. Hedges, J. Educ.
Stat. 6, 1981); its interval is that of the uncorrected size, from the noncentral t. Only `holm` corrects for
multiple comparisons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import chdtri, fdtri, nctdtrinc, stdtr, stdtrit

from shukotsu.arrays import Array, Float

LEVEL = 0.05
"""Accepted rate of false positives in a family of comparisons; intervals have the level 1 - LEVEL."""


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Correct p-values for multiple comparisons by Holm's method.

    Parameters
    ----------
    p_values : sequence of float or None
        p-values; None if there was no test.

    Returns
    -------
    list of float or None
        Corrected p-values in the same order; None if there was no test.

    """
    ascending = sorted((p, index) for index, p in enumerate(p_values) if p is not None)
    corrected: list[float | None] = [None] * len(p_values)
    highest = 0.0
    for rank, (p, index) in enumerate(ascending):
        highest = max(highest, min(1.0, p * (len(ascending) - rank)))
        corrected[index] = highest
    return corrected


Interval = tuple[float, float]

N_FLIPS = 20_000
MOST_ENUMERATED = 14
FEWEST_SUBJECTS = 6
"""Least number of subjects for an interval; with fewer, the smallest possible p, 2 / 2^n, exceeds LEVEL."""

EQUAL = 1e-9
"""Differences up to this, in mm or deg, are rounding errors and are set to 0."""


@dataclass(frozen=True)
class Difference:
    """Test of a difference of means; values are None if there are too few subjects or no differences.

    Attributes
    ----------
    p : float
        Two-sided p-value.
    interval : tuple of float or None
        95 % interval of the difference of means.
    effect, effect_interval : float or None, tuple of float or None
        Standardised difference, and its 95 % interval.

    """

    p: float
    interval: Interval | None
    effect: float | None
    effect_interval: Interval | None


def paired_difference(differences: Float[Array, " n"]) -> Difference:
    """Test the mean of paired differences: sign flips, Student's interval, Hedges' effect size.

    Parameters
    ----------
    differences : array, shape (n,)
        One difference for each subject, n >= 1.

    Returns
    -------
    Difference
        The test; the interval requires FEWEST_SUBJECTS subjects, the effect size 3.

    """
    d = np.where(np.abs(differences) <= EQUAL, 0.0, differences)
    n, interval = len(d), None
    if n >= FEWEST_SUBJECTS:
        half = float(stdtrit(n - 1, 1.0 - LEVEL / 2) * d.std(ddof=1)) / math.sqrt(n)
        interval = float(d.mean()) - half, float(d.mean()) + half
    varies = n > 2 and np.ptp(d) > EQUAL
    effect = effect_of(float(d.mean() / d.std(ddof=1)), n - 1, n) if varies else (None, None)
    return Difference(sign_flip_p(d), interval, *effect)


def sign_flip_p(differences: Float[Array, " n"]) -> float:
    """Compute the two-sided p of the mean of differences by flipping their signs.

    Parameters
    ----------
    differences : array, shape (n,)
        One difference for each subject.

    Returns
    -------
    float
        p; exact for n up to MOST_ENUMERATED, otherwise from N_FLIPS random flips.

    """
    n, rounding = len(differences), EQUAL * float(np.abs(differences).sum())
    reached = np.abs(_sign_flips(n) @ differences) >= abs(float(differences.sum())) - rounding
    n_reached, n_flips = int(reached.sum()), len(reached)
    return n_reached / n_flips if n <= MOST_ENUMERATED else (1 + n_reached) / (1 + n_flips)


def smallest_p(n: int) -> float:
    """Return the smallest p that `sign_flip_p` can return.

    Parameters
    ----------
    n : int
        Number of differences.

    Returns
    -------
    float
        2 / 2^n if all flips are enumerated, otherwise 1 / (1 + N_FLIPS).

    """
    return 2.0 / 2.0**n if n <= MOST_ENUMERATED else 1.0 / (1 + N_FLIPS)


@lru_cache(maxsize=8)
def _sign_flips(n: int) -> Array:
    """Return signs (flips, n): all combinations except mirror images, or N_FLIPS random ones, fixed per n."""
    if n > MOST_ENUMERATED:
        drawn = np.random.default_rng((n, 2)).integers(0, 2, (N_FLIPS, n))
    else:
        drawn = np.arange(2 ** (n - 1))[:, None] >> np.arange(n) & 1
    return np.asarray(1.0 - 2.0 * drawn)


def effect_of(size: float, freedom: int, n_effective: float) -> tuple[float, Interval]:
    """Correct a standardised difference for few subjects, and compute the uncorrected one's 95 % interval.

    The limits are the noncentralities at which t is the 97.5 % and the 2.5 % quantile (J. H. Steiger, R. T.
    Fouladi, in What If There Were No Significance Tests?, 1997); exact for normal data.

    Parameters
    ----------
    size : float
        Uncorrected standardised difference.
    freedom : int
        Degrees of freedom.
    n_effective : float
        n for one mean, n m / (n + m) for two groups.

    Returns
    -------
    tuple
        Corrected size, and (low, high).

    """
    root = math.sqrt(n_effective)
    low, high = (float(nctdtrinc(freedom, share, size * root)) for share in (1.0 - LEVEL / 2, LEVEL / 2))
    return small_sample_correction(freedom) * size, (low / root, high / root)


def small_sample_correction(freedom: int) -> float:
    """Compute Hedges' factor J, which makes a standardised mean difference unbiased (Hedges 1981).

    Parameters
    ----------
    freedom : int
        Degrees of freedom.

    Returns
    -------
    float
        Gamma(m / 2) / (sqrt(m / 2) Gamma((m - 1) / 2)).

    """
    log_ratio = math.lgamma(freedom / 2) - math.lgamma((freedom - 1) / 2)
    return math.exp(log_ratio) / math.sqrt(freedom / 2)


FEWEST_IN_GROUP = 4
"""Least number of subjects in a group for an estimate of its spread."""


def group_difference(values: Float[Array, " n"], others: Float[Array, " m"]) -> Difference:
    """Test the difference of the means of two groups with unequal variances.

    Parameters
    ----------
    values, others : array, shape (n,) and (m,)
        One value for each subject, n and m >= 2.

    Returns
    -------
    Difference
        The test, with Cochran's (1964) p: the mean of the p-values of t with n - 1 and with m - 1 degrees of
        freedom, weighted by the groups' squared standard errors. The interval is Welch's, the effect size
        Hedges' g.

    """
    n, m = len(values), len(others)
    difference = float(values.mean() - others.mean())
    squares = np.array([group.var(ddof=1) / len(group) for group in (values, others)])
    t = difference / np.sqrt(max(squares.sum(), EQUAL**2))
    freedom = np.array([n, m]) - 1
    each = 2.0 * stdtr(freedom, -abs(t))
    p = float(np.average(each, weights=squares + EQUAL**2))
    pooled = math.sqrt((values.var() * n + others.var() * m) / (n + m - 2))
    n_effective = n * m / (n + m)
    effect = effect_of(difference / pooled, n + m - 2, n_effective) if pooled > EQUAL else (None, None)
    of_welch = squares.sum() ** 2 / (squares**2 / freedom).sum() if squares.any() else 1.0
    half = float(stdtrit(of_welch, 1.0 - LEVEL / 2) * np.sqrt(squares.sum()))
    return Difference(p, (difference - half, difference + half), *effect)


Z_95 = 1.959963984540054
FEWEST_REPEATED = 3
"""Least number of subjects, each measured at least twice, for which repeatability is stated."""


@dataclass(frozen=True)
class Icc:
    """Intraclass correlation and its 95 % interval; NaN if all values are equal."""

    value: float
    interval: Interval


@dataclass(frozen=True)
class Reliability:
    """Repeatability of subjects over sessions.

    Attributes
    ----------
    agreement, consistency : Icc
        ICC(2,1) and ICC(3,1).
    sem : float
        Standard error of measurement, in the unit of the values.
    sem_interval : tuple of float
        Its 95 % interval.

    """

    agreement: Icc
    consistency: Icc
    sem: float
    sem_interval: Interval

    @property
    def mdc(self) -> float:
        """Minimal detectable change between two sessions of a subject at 95 %, in the unit of the values."""
        return Z_95 * math.sqrt(2.0) * self.sem


def reliability(values: Float[Array, "n k"]) -> Reliability:
    """Compute the repeatability of values over sessions from the two-way analysis of variance.

    Parameters
    ----------
    values : array, shape (n, k)
        n >= 2 subjects in k >= 2 sessions, without gaps.

    Returns
    -------
    Reliability
        ICC, standard error of measurement and minimal detectable change.

    """
    n, k = values.shape
    of_subjects, of_sessions, rest = mean_squares(values)
    freedom = n * (k - 1)
    within = ((k - 1) * of_sessions + (n - 1) * (k - 1) * rest) / freedom
    low, high = (math.sqrt(within * freedom / chdtri(freedom, share)) for share in (LEVEL / 2, 1 - LEVEL / 2))
    agreement = _agreement(n, k, of_subjects, of_sessions, rest)
    consistency = _consistency(n, k, of_subjects, rest)
    return Reliability(agreement, consistency, math.sqrt(within), (low, high))


def mean_squares(values: Float[Array, "n k"]) -> tuple[float, float, float]:
    """Compute the mean squares of a two-way table without replication.

    Parameters
    ----------
    values : array, shape (n, k)
        Subjects by sessions.

    Returns
    -------
    tuple of float
        Mean squares of subjects, of sessions, and of the residual.

    """
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
    """Compute ICC(2,1), with Satterthwaite's degrees of freedom for its interval.

    If the residual is zero, they are those of the sessions, as a shift shared by all subjects is
    disagreement.
    """
    spread = of_subjects + (k - 1) * rest + k * (of_sessions - rest) / n
    if spread <= 0 or (rest <= 0 and of_sessions <= 0):
        return _undefined_icc(of_subjects, rest)
    value = (of_subjects - rest) / spread
    freedom = float(k - 1)
    if rest > 0:
        ratio = k * value * of_sessions / rest
        others = n * (1 + (k - 1) * value) - k * value
        freedom = (n - 1) * (k - 1) * (ratio + others) ** 2 / ((n - 1) * ratio**2 + others**2)
    share = 1 - LEVEL / 2
    upper, lower = float(fdtri(n - 1, freedom, share)), float(fdtri(freedom, n - 1, share))
    whole = k * of_sessions + (k * n - k - n) * rest
    low = n * (of_subjects - upper * rest) / (upper * whole + n * of_subjects)
    high = n * (lower * of_subjects - rest) / (whole + n * lower * of_subjects)
    return Icc(value, (low, high))


def _consistency(n: int, k: int, of_subjects: float, rest: float) -> Icc:
    """Compute ICC(3,1) and its interval."""
    if rest <= 0:
        return _undefined_icc(of_subjects, rest)
    ratio, freedom, share = of_subjects / rest, (n - 1) * (k - 1), 1 - LEVEL / 2
    low, high = ratio / float(fdtri(n - 1, freedom, share)), ratio * float(fdtri(freedom, n - 1, share))
    return Icc((ratio - 1) / (ratio + k - 1), ((low - 1) / (low + k - 1), (high - 1) / (high + k - 1)))


def _undefined_icc(of_subjects: float, rest: float) -> Icc:
    """Return 1 if sessions repeat exactly, NaN if all values are equal."""
    value = 1.0 if of_subjects > 0 and rest <= 0 else math.nan
    return Icc(value, (value, value))
