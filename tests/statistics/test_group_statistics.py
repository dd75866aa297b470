"""Two groups against scipy's permutation test, Welch's interval and the noncentral t."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from shukotsu.statistics.group_statistics import (
    permutation_p,
    two_groups,
    welch_t,
)


def groups(n: int, m: int, shift: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng((n, m))
    return rng.normal(shift, 1.0, n), rng.normal(0.0, 1.5, m)


def scipys_t(first: np.ndarray, others: np.ndarray, axis: int) -> np.ndarray:
    return np.asarray(stats.ttest_ind(first, others, axis=axis, equal_var=False).statistic)


@pytest.mark.parametrize(("n", "m"), [(4, 4), (5, 6), (4, 9)])
def test_exact_p_is_scipys(n: int, m: int) -> None:
    """Every assignment, Welch's t, twice the smaller tail."""
    a, b = groups(n, m)
    expected = stats.permutation_test((a, b), scipys_t, vectorized=True, n_resamples=np.inf)
    assert permutation_p(a, b) == pytest.approx(expected.pvalue, abs=1e-12)


def test_a_difference_with_its_interval_and_size() -> None:
    a, b = groups(7, 12)
    found = two_groups(a, b)
    expected = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    assert found.interval == pytest.approx((expected.low, expected.high))
    assert found.difference == pytest.approx(a.mean() - b.mean())
    pooled = math.sqrt((6 * a.var(ddof=1) + 11 * b.var(ddof=1)) / 17)
    assert found.effect == pytest.approx((1 - 3 / (4 * 17 - 1)) * (a.mean() - b.mean()) / pooled, rel=2e-3)
    assert found.effect_interval is not None
    t = (a.mean() - b.mean()) / pooled * math.sqrt(7 * 12 / 19)
    low, high = (end * math.sqrt(7 * 12 / 19) for end in found.effect_interval)
    assert stats.nct.sf(t, 17, low) == pytest.approx(0.025, abs=1e-5)
    assert stats.nct.cdf(t, 17, high) == pytest.approx(0.025, abs=1e-5)


def test_few_subjects_have_a_difference_and_no_test() -> None:
    found = two_groups(np.array([1.0, 2.0, 4.0]), np.array([0.0]))
    assert (found.n, found.n_other, found.p, found.interval, found.effect) == (3, 1, None, None, None)
    assert found.difference == pytest.approx(7 / 3)


def test_t_leaves_out_who_has_no_value() -> None:
    a, b = groups(5, 6)
    values = np.concatenate([a, b])
    values[[1, 8]] = np.nan
    first = np.r_[np.ones(5), np.zeros(6)]
    expected = stats.ttest_ind(values[:5], values[5:], equal_var=False, nan_policy="omit").statistic
    assert welch_t(first[None], values[:, None])[0, 0] == pytest.approx(expected)
    values[:4] = np.nan
    assert welch_t(first[None], values[:, None])[0, 0] == 0.0
