"""What a difference of means says, of two groups: test, interval and effect size.

Test: Welch's t by Cochran's p, the mean of both groups' Student p weighted by the variances of their means
(W. G. Cochran, Biometrics 20, 1964), which holds its level where groups spread differently, deep into the
tail that Holm's correction asks for. There neither Student's p with Welch's degrees of freedom does, with few
subjects, nor a permutation of Welch's t (scipy.stats.permutation_test). Interval: Welch's. Effect size:
Hedges' g, over the pooled standard deviation.
"""

from __future__ import annotations

import math

import numpy as np

from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import EQUAL, Array, Difference, Interval, effect_of

FEWEST_IN_GROUP = 4
"""Subjects: fewer cannot tell how much a group spreads."""


def group_difference(values: Array, others: Array) -> Difference:
    """Test the difference of the means of two groups (n,) and (m,), each 2 or more."""
    from scipy import stats

    n, m = len(values), len(others)
    squares = np.array([group.var(ddof=1) / len(group) for group in (values, others)])
    t = (values.mean() - others.mean()) / np.sqrt(max(squares.sum(), EQUAL**2))
    each = 2.0 * stats.t.sf(abs(t), np.array([n, m]) - 1)
    p = float(np.average(each, weights=squares + EQUAL**2))
    pooled = math.sqrt((values.var() * n + others.var() * m) / (n + m - 2))
    effect: tuple[float, Interval] | tuple[None, None] = (None, None)
    if pooled > EQUAL:
        effect = effect_of(float(values.mean() - others.mean()) / pooled, n + m - 2, n * m / (n + m))
    ends = stats.ttest_ind(values, others, equal_var=False).confidence_interval(1.0 - LEVEL)
    return Difference(p, (float(ends.low), float(ends.high)), *effect)
