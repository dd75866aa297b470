"""Repeatability: the textbook's ICC, sums of squares by regression, and simulated sessions of known error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from shukotsu.statistics.reliability_statistics import (
    bland_altman,
    mean_squares,
    reliability,
    stated_against_seen,
)

JUDGES = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], dtype=float
)
"""Table 2 of Shrout and Fleiss (1979): 6 targets, 4 judges."""


def test_iccs_of_shrout_and_fleiss() -> None:
    found = reliability(JUDGES)
    assert found.agreement.value == pytest.approx(0.29, abs=0.005)
    assert found.consistency.value == pytest.approx(0.71, abs=0.005)
    assert found.agreement.interval == pytest.approx((0.02, 0.76), abs=0.005)
    assert found.consistency.interval == pytest.approx((0.34, 0.95), abs=0.005)


def test_mean_squares_are_those_of_least_squares() -> None:
    """What is left of the values when subjects, sessions or both are fitted."""
    n, k = JUDGES.shape
    of_rows, of_columns = np.kron(np.eye(n), np.ones((k, 1))), np.kron(np.ones((n, 1)), np.eye(k))

    def left(design: np.ndarray) -> float:
        fitted = design @ np.linalg.lstsq(design, JUDGES.ravel(), rcond=None)[0]
        return float(((JUDGES.ravel() - fitted) ** 2).sum())

    both = left(np.hstack([of_rows, of_columns]))
    assert mean_squares(JUDGES) == pytest.approx(
        ((left(of_columns) - both) / 5, (left(of_rows) - both) / 3, both / 15)
    )


def test_limits_of_two_sessions_are_bland_and_altmans() -> None:
    d = JUDGES[:, 1] - JUDGES[:, 0]
    found = bland_altman(JUDGES[:, :2])
    assert found.bias == pytest.approx(d.mean())
    assert (found.high - found.low) / 2 == pytest.approx(stats.norm.ppf(0.975) * d.std(ddof=1))
    expected = stats.ttest_1samp(d, 0.0).confidence_interval()
    assert found.bias_interval == pytest.approx((expected.low, expected.high))
    assert found.high_interval[0] < found.high < found.high_interval[1]
    assert found.low - found.low_interval[0] == pytest.approx(found.high_interval[1] - found.high)


def test_limits_of_three_sessions_hold_new_differences() -> None:
    """Of 4000 subjects: an error of 2 in every session, and a shift of 1 from one to the next."""
    rng = np.random.default_rng(3)
    values = rng.normal(0, 9, (4000, 1)) + rng.normal(0, 2, (4000, 3)) + np.arange(3)
    found = bland_altman(values)
    assert found.bias == pytest.approx(1.0, abs=0.1)
    assert found.high == pytest.approx(1.0 + 1.96 * math.sqrt(8), abs=0.12)
    assert reliability(values).sem == pytest.approx(math.sqrt(4 + 1), abs=0.06)


def test_stated_sd_against_what_was_seen() -> None:
    found = stated_against_seen(np.array([1.0, -2.0, 5.0, np.nan]), np.array([1.0, 1.0, 2.0, 1.0]))
    assert found is not None
    assert found.n == 3
    assert found.held_percent == pytest.approx(100 / 3)
    assert found.stated == pytest.approx(math.sqrt(2))
    assert found.ratio == pytest.approx(math.sqrt(10 / 2))
    assert stated_against_seen(np.array([1.0]), np.array([np.nan])) is None


def test_a_shift_that_all_share_is_consistent_and_no_agreement() -> None:
    """Without any rest the ICC is the limit of that with a small one, its interval too."""
    values = np.arange(6.0)[:, None] + np.array([0.0, 3.0])
    found = reliability(values)
    assert found.consistency.value == 1.0
    noise = np.random.default_rng(1).normal(0.0, 1e-5, values.shape)
    near = reliability(values + noise).agreement
    assert found.agreement.value == pytest.approx(near.value, abs=1e-4)
    assert found.agreement.interval == pytest.approx(near.interval, abs=1e-3)
    assert found.agreement.value == pytest.approx(7.0 / (7.0 + 2 * 27.0 / 6))
    assert reliability(np.ones((5, 1)) * [0.0, 1.0]).agreement.value == 0.0
