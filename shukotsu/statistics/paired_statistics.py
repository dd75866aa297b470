"""Estimate the mean of the differences of n subjects: interval, test and effect size.

Interval: percentile bootstrap over subjects, its tails widened as Student's are (expanded percentile
interval: T. Hesterberg, What Teachers Should Know About the Bootstrap, Am. Stat. 69, 2015). Of 8 and of 12
normal differences it holds the true mean in 94 % of studies, the plain percentile and BCa intervals in 89 and
91 %; of strongly skewed (exponential) ones in 90 %. It is not corrected for many comparisons.

Test: the signs of the differences are flipped, in all ways or at random, which is exact where a difference
is as likely to lie above 0 as so far below (R. A. Fisher, The Design of Experiments, 1935). Of random flips
the data themselves count as one (B. Phipson, G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 9, 2010). Effect
size: mean over standard deviation of the differences, Cohen's d_z, with the exact correction for few
subjects (L. V. Hedges, J. Educ. Stat. 6, 1981); its interval, of the size without the correction, from the
noncentral t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from shukotsu.statistics.multiple_comparisons import LEVEL

Array = npt.NDArray[np.float64]

N_RESAMPLES = 10_000
N_FLIPS = 20_000
MOST_ENUMERATED = 14
FEWEST_SUBJECTS = 6
"""With fewer the smallest p, 2 / 2^n, is over LEVEL. No bootstrap interval holds the mean in 95 % of studies
then, either: none leaves the range of the data, and in 2 / 2^n of studies all lie on one side of the median.
"""
EQUAL = 1e-9
"""Differences up to this, in mm or deg, are rounding: the models do the same."""


@dataclass(frozen=True)
class Paired:
    """Hold what n differences say, in the metric's unit.

    interval : 95 %; None with fewer than FEWEST_SUBJECTS. p : not corrected. smallest_p : what the test can
    give at best with so many. effect : d_z, corrected; None with fewer than 3 or with equal differences.
    n_better, n_equal : subjects with whom the first model does better, and the same.
    """

    n: int
    mean: float
    median: float
    lowest: float
    highest: float
    interval: tuple[float, float] | None
    p: float
    smallest_p: float
    effect: float | None
    n_better: int
    n_equal: int


def paired(differences: Array) -> Paired:
    """Estimate and test the mean of differences (n,), n at least 1; negative ones are better.

    What is random depends on n alone, so the same data give the same numbers, and the comparisons of a
    study, which are of the same subjects, share it: drawn once, it takes milliseconds a comparison.
    """
    d = np.where(np.abs(differences) <= EQUAL, 0.0, differences)
    n = len(d)
    return Paired(
        n=n,
        mean=math.fsum(d) / n,
        median=float(np.median(d)),
        lowest=float(d.min()),
        highest=float(d.max()),
        interval=interval_95(d) if n >= FEWEST_SUBJECTS else None,
        p=sign_flip_p(d),
        smallest_p=smallest_p(n),
        effect=effect_size(d),
        n_better=int((d < 0).sum()),
        n_equal=int((d == 0).sum()),
    )


def interval_95(differences: Array) -> tuple[float, float]:
    """95 % expanded percentile bootstrap interval of the mean of differences (n,), n at least 2."""
    n = len(differences)
    low, high = np.quantile(_shares(n) @ differences, [bootstrap_tail(n), 1.0 - bootstrap_tail(n)])
    return float(low), float(high)


@lru_cache(maxsize=64)
def bootstrap_tail(n: int) -> float:
    """The share of resampled means to leave out at either end: 0.025, less the fewer subjects there are.

    The resampled means of n scatter sqrt((n - 1) / n) too little, and a normal quantile stands for Student's.
    """
    from scipy.special import ndtr, stdtrit

    return float(ndtr(stdtrit(n - 1, LEVEL / 2) * math.sqrt(n / (n - 1))))


def sign_flip_p(differences: Array) -> float:
    """Two-sided p of the mean of differences (n,): exact up to MOST_ENUMERATED, else by N_FLIPS."""
    n, rounding = len(differences), EQUAL * float(np.abs(differences).sum())
    reached = abs(float(differences.sum())) - rounding
    return p_of(np.abs(sign_flips(n) @ differences) >= reached, exact=n <= MOST_ENUMERATED)


def p_of(reached: npt.NDArray[np.bool_], *, exact: bool) -> float:
    """The p of a test whose resamples (m,) reach what was seen, or not; of drawn ones the data count as
    one.
    """
    n_reached = int(reached.sum())
    return n_reached / len(reached) if exact else (1 + n_reached) / (1 + len(reached))


@lru_cache(maxsize=8)
def sign_flips(n: int) -> Array:
    """Signs of n differences, a row a flip: all, but for a mirror image, up to MOST_ENUMERATED, else
    N_FLIPS.
    """
    if n > MOST_ENUMERATED:
        drawn = np.random.default_rng((n, 2)).integers(0, 2, (N_FLIPS, n))
    else:
        drawn = np.arange(2 ** (n - 1))[:, None] >> np.arange(n) & 1
    return np.asarray(1.0 - 2.0 * drawn)


def smallest_p(n: int) -> float:
    """The smallest p that `sign_flip_p` can give of n differences."""
    return 2.0 / 2.0**n if n <= MOST_ENUMERATED else 1.0 / (1 + N_FLIPS)


def effect_size(differences: Array) -> float | None:
    """Cohen's d_z of differences (n,) with Hedges' correction for n - 1 degrees of freedom."""
    freedom = len(differences) - 1
    if freedom < 2 or np.ptp(differences) <= EQUAL:
        return None
    return float(small_sample_correction(freedom) * differences.mean() / differences.std(ddof=1))


def effect_interval(t: float, freedom: float, n_effective: float) -> tuple[float, float]:
    """95 % interval of the standardised mean difference that a t with so many degrees of freedom shows.

    n_effective : of one mean n, of two n m / (n + m). The noncentralities that put t at their 97.5 % and 2.5
    % (J. H. Steiger, R. T. Fouladi, in What If There Were No Significance Tests?, 1997): exact of normal
    data.
    """
    from scipy.special import nctdtrinc

    low, high = (float(nctdtrinc(freedom, share, t)) for share in (1.0 - LEVEL / 2, LEVEL / 2))
    return low / math.sqrt(n_effective), high / math.sqrt(n_effective)


def small_sample_correction(freedom: int) -> float:
    """Hedges' factor J, which makes a standardised mean difference unbiased."""
    log_ratio = math.lgamma(freedom / 2) - math.lgamma((freedom - 1) / 2)
    return math.exp(log_ratio) / math.sqrt(freedom / 2)


@lru_cache(maxsize=4)
def _shares(n: int) -> Array:
    """Draw the weight of each of n differences in every resampled mean, (N_RESAMPLES, n)."""
    drawn = np.random.default_rng((n, 1)).integers(0, n, (N_RESAMPLES, n))
    drawn += n * np.arange(N_RESAMPLES)[:, None]
    counts = np.bincount(drawn.ravel(), minlength=N_RESAMPLES * n).reshape(N_RESAMPLES, n)
    return np.asarray(counts / n)
