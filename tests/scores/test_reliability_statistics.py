"""Repeatability: the textbook's ICC, sums of squares by regression, and simulated sessions of known error."""

from __future__ import annotations

import numpy as np
import pytest

from shukotsu.scores.reliability_statistics import mean_squares, reliability

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
