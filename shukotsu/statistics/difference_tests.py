"""Whether two levels of a factor differ in a number: one test for pairs, one for groups.

Pairs: the signs of the differences are flipped (`paired_statistics.sign_flip_p`). Groups: Welch's t, by
Cochran's p, the mean of both groups' Student p weighted by the variances of their means (W. G. Cochran,
Biometrics 20, 1964), which holds its level where groups spread differently, deep into the tail that Holm's
correction asks for. There neither Student's p with Welch's degrees of freedom does, with few subjects, nor a
permutation of Welch's t. Intervals are Student's and Welch's.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import EQUAL, Array, sign_flip_p

SHOWN, NOT_SHOWN = "shown", "not-shown"
FEWEST_WITHIN, FEWEST_IN_GROUP = 6, 4
"""Subjects: fewer cannot give a p under LEVEL, of pairs, or tell how much a group spreads."""


def paired_test(differences: Array) -> tuple[float, float, float]:
    """Return the two-sided p of differences (n,) of the same subjects, and their 95 % interval's ends."""
    interval = stats.ttest_1samp(differences, 0.0).confidence_interval(1.0 - LEVEL)
    return sign_flip_p(differences), float(interval.low), float(interval.high)


def group_test(values: Array, others: Array) -> tuple[float, float, float]:
    """Return the two-sided p of groups (n,) and (m,), and the 95 % interval's ends of their difference."""
    interval = stats.ttest_ind(values, others, equal_var=False).confidence_interval(1.0 - LEVEL)
    squares = np.array([group.var(ddof=1) / len(group) for group in (values, others)])
    t = (values.mean() - others.mean()) / np.sqrt(max(squares.sum(), EQUAL**2))
    each = 2.0 * stats.t.sf(abs(t), np.array([len(values), len(others)]) - 1)
    p = np.average(each, weights=squares + EQUAL**2)
    return float(p), float(interval.low), float(interval.high)
