"""Statistics of paired differences against other formulations of the same."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy import stats

from shukotsu.statistics.paired_statistics import (
    N_FLIPS,
    bootstrap_tail,
    effect_interval,
    effect_size,
    interval_95,
    sign_flip_p,
)

SKEWED = np.array([-0.9, -0.5, -0.45, -0.3, -0.2, -0.15, -0.1, 0.02, 0.3])


@pytest.mark.parametrize("n", [2, 5, 9])
def test_exact_p_is_scipys(n: int) -> None:
    """Enumerated sign flips of the mean, as scipy permutes samples of one pair each."""
    d = SKEWED[:n]
    expected = stats.permutation_test(
        (d,), lambda x, axis: np.mean(x, axis=axis), permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(d) == pytest.approx(expected.pvalue, abs=1e-12)


def test_exact_p_counts_ties() -> None:
    """Flips that reach the same sum count, though their sums differ by rounding."""
    d = np.array([0.1, 0.2, 0.3, -0.3, 0.7, 0.1])
    sums = [
        abs(sum(s * round(10 * x) for s, x in zip(signs, d, strict=True)))
        for signs in product((1, -1), repeat=6)
    ]
    expected = np.mean([total >= 11 for total in sums])
    assert sign_flip_p(d) == expected


@pytest.mark.parametrize("n", [14, 15, 20])
def test_random_flips_are_near_the_exact_p(n: int) -> None:
    """Within Monte Carlo error of the enumeration, which sums one subject after the other."""
    d = np.random.default_rng(5).normal(0.4, 1.0, n)
    sums = np.zeros(1)
    for value in d:
        sums = np.concatenate([sums + value, sums - value])
    exact = float((np.abs(sums) >= abs(d.sum()) - 1e-9).mean())
    error = 0.0 if n <= 14 else 4 * math.sqrt(exact * (1 - exact) / N_FLIPS)
    assert 0.01 < exact < 0.5
    assert sign_flip_p(d) == pytest.approx(exact, abs=error + 1e-12)


def test_interval_is_scipys_percentile_bootstrap_with_wider_tails() -> None:
    """Ends within Monte Carlo error of scipy's at the widened level."""
    tail = bootstrap_tail(len(SKEWED))
    expected = stats.bootstrap(
        (SKEWED,),
        np.mean,
        n_resamples=20_000,
        confidence_level=1 - 2 * tail,
        method="percentile",
        random_state=np.random.default_rng(2),
    ).confidence_interval
    low, high = interval_95(SKEWED)
    assert low == pytest.approx(expected.low, abs=0.03)
    assert high == pytest.approx(expected.high, abs=0.03)
    assert high - low == pytest.approx(expected.high - expected.low, rel=0.035)
    plain = np.ptp(stats.bootstrap((SKEWED,), np.mean, method="percentile", rng=1).confidence_interval)
    assert high - low > 1.1 * plain


def test_effect_size_by_hand() -> None:
    """Mean 3, SD sqrt(2.5), and the correction for 4 degrees of freedom, gamma(2) / (sqrt(2) gamma(1.5))."""
    d = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    correction = 1.0 / (math.sqrt(2.0) * math.sqrt(math.pi) / 2)
    assert effect_size(d) == pytest.approx(3.0 / math.sqrt(2.5) * correction)
    assert effect_size(-d) == pytest.approx(-3.0 / math.sqrt(2.5) * correction)
    assert effect_size(d[:2]) is None
    assert effect_size(np.full(9, 0.7)) is None


@pytest.mark.parametrize(("t", "freedom", "n_effective"), [(2.0, 5, 6.0), (-3.1, 18, 5.0), (0.0, 11, 12.0)])
def test_effect_interval_is_where_scipys_noncentral_t_has_its_tails(
    t: float, freedom: int, n_effective: float
) -> None:
    low, high = (end * math.sqrt(n_effective) for end in effect_interval(t, freedom, n_effective))
    assert stats.nct.sf(t, freedom, low) == pytest.approx(0.025, abs=1e-5)
    assert stats.nct.cdf(t, freedom, high) == pytest.approx(0.025, abs=1e-5)
