"""Whether two levels of a factor differ in a number: one permutation test for pairs, one for groups.

Pairs: the signs of the differences are flipped (`paired_statistics.sign_flip_p`). Groups: subjects are dealt
anew to the groups, by Welch's t, which holds its level where the groups spread differently (A. Janssen, Stat.
Probab. Lett. 36, 1997). Intervals are Student's and Welch's.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import EQUAL, Array, sign_flip_p

SHOWN, NOT_SHOWN = "shown", "not-shown"
FEWEST_WITHIN, FEWEST_IN_GROUP = 6, 4
"""Subjects: fewer cannot give a p under LEVEL."""
N_RESAMPLES = 9_999


def paired_test(differences: Array) -> tuple[float, float, float]:
    """Return the two-sided p of differences (n,) of the same subjects, and their 95 % interval's ends."""
    interval = stats.ttest_1samp(differences, 0.0).confidence_interval(1.0 - LEVEL)
    return sign_flip_p(differences), float(interval.low), float(interval.high)


def group_test(values: Array, others: Array) -> tuple[float, float, float]:
    """Return the two-sided p of groups (n,) and (m,), and the 95 % interval's ends of their difference."""
    interval = stats.ttest_ind(values, others, equal_var=False).confidence_interval(1.0 - LEVEL)
    result = stats.permutation_test(
        (values, others),
        _welch_t,
        vectorized=True,
        n_resamples=N_RESAMPLES,
        rng=np.random.default_rng((len(values), len(others))),
    )
    return float(result.pvalue), float(interval.low), float(interval.high)


def _welch_t(values: Array, others: Array, axis: int) -> Array:
    square = sum(group.var(axis=axis, ddof=1) / group.shape[axis] for group in (values, others))
    difference = values.mean(axis=axis) - others.mean(axis=axis)
    return np.asarray(difference / np.sqrt(np.maximum(square, EQUAL**2)))
