"""Standardised differences, corrected for few subjects, and their intervals.

Of one mean of differences Cohen's d_z, of two groups the difference over the pooled standard deviation
(Hedges' g), each with the exact correction (L. V. Hedges, J. Educ. Stat. 6, 1981); the intervals are of the
size without the correction, from the noncentral t.
"""

from __future__ import annotations

import math

from shukotsu.statistics.paired_statistics import (
    EQUAL,
    Array,
    effect_interval,
    effect_size,
    small_sample_correction,
)

Interval = tuple[float, float]


def paired_effect(first: Array, other: Array) -> tuple[float, Interval] | None:
    """d_z of numbers (n,) at two levels of the same subjects; None of fewer than 3 or equal differences."""
    differences = first - other
    n, size = len(differences), effect_size(differences)
    if size is None:
        return None
    t = float(differences.mean() / differences.std(ddof=1)) * math.sqrt(n)
    return size, effect_interval(t, n - 1, n)


def two_group_effect(values: Array, others: Array) -> tuple[float, Interval] | None:
    """Hedges' g of groups (n,) and (m,); None with fewer than 2 in either or where nobody differs."""
    n, m = len(values), len(others)
    if min(n, m) < 2:
        return None
    freedom = n + m - 2
    pooled = math.sqrt((values.var() * n + others.var() * m) / freedom)
    if pooled <= EQUAL:
        return None
    standardised = float(values.mean() - others.mean()) / pooled
    n_effective = n * m / (n + m)
    interval = effect_interval(standardised * math.sqrt(n_effective), freedom, n_effective)
    return small_sample_correction(freedom) * standardised, interval
