"""Paired differences, Holm's correction and repeatability against independent formulations.

pingouin is used if it is installed in .tools or the folder SHUKOTSU_TOOLS; see CONTRIBUTING.md.
"""

import json
import math
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from program_files import printed_by
from scipy import stats

from shukotsu.scores.paired_statistics import (
    N_FLIPS,
    effect_of,
    group_difference,
    holm,
    mean_squares,
    paired_difference,
    reliability,
    sign_flip_p,
    small_sample_correction,
)


def test_holm_by_hand() -> None:
    """Factors are 4, 3, 2 and 1, and values do not decrease; None (no test) stays None and is not counted."""
    assert holm([0.02, None, 0.9, 0.01, 0.03]) == pytest.approx([0.06, None, 0.9, 0.04, 0.06])
    assert holm([0.4, 0.5]) == pytest.approx([0.8, 0.8])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


SKEWED = np.array([-0.9, -0.5, -0.45, -0.3, -0.2, -0.15, -0.1, 0.02, 0.3])


@pytest.mark.parametrize("n", [2, 5, 9])
def test_exact_p_equals_scipys(n: int) -> None:
    """All sign flips of the mean are enumerated, like scipy's permutations of single pairs."""
    d = SKEWED[:n]
    expected = stats.permutation_test(
        (d,), lambda x, axis: np.mean(x, axis=axis), permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(d) == pytest.approx(expected.pvalue, abs=1e-12)


def test_exact_p_counts_ties() -> None:
    """Flips with the same sum count although their sums differ by rounding."""
    d = np.array([0.1, 0.2, 0.3, -0.3, 0.7, 0.1])
    sums = [
        abs(sum(s * round(10 * x) for s, x in zip(signs, d, strict=True)))
        for signs in product((1, -1), repeat=6)
    ]
    expected = np.mean([total >= 11 for total in sums])
    assert sign_flip_p(d) == expected


@pytest.mark.parametrize("n", [14, 15, 20])
def test_the_p_of_random_flips_is_near_the_exact_p(n: int) -> None:
    """It is within Monte Carlo error of the enumeration of all flips."""
    d = np.random.default_rng(5).normal(0.4, 1.0, n)
    sums = np.zeros(1)
    for value in d:
        sums = np.concatenate([sums + value, sums - value])
    exact = float((np.abs(sums) >= abs(d.sum()) - 1e-9).mean())
    error = 0.0 if n <= 14 else 4 * math.sqrt(exact * (1 - exact) / N_FLIPS)
    assert 0.01 < exact < 0.5
    assert sign_flip_p(d) == pytest.approx(exact, abs=error + 1e-12)


def test_effect_size_by_hand() -> None:
    """The mean is 3, the SD sqrt(2.5), the correction for 4 degrees of freedom gamma(2) / (sqrt(2)
    gamma(1.5)).
    """
    d = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    correction = 1.0 / (math.sqrt(2.0) * math.sqrt(math.pi) / 2)
    assert paired_difference(d).effect == pytest.approx(3.0 / math.sqrt(2.5) * correction)
    assert paired_difference(-d).effect == pytest.approx(-3.0 / math.sqrt(2.5) * correction)
    assert paired_difference(d[:2]).effect is None
    assert paired_difference(np.full(9, 0.7)).effect is None


def test_an_interval_is_students_and_needs_six_subjects() -> None:
    expected = stats.ttest_1samp(SKEWED, 0.0).confidence_interval(0.95)
    assert paired_difference(SKEWED).interval == pytest.approx((expected.low, expected.high))
    assert paired_difference(SKEWED[:5]).interval is None


@pytest.mark.parametrize(("size", "freedom", "n_effective"), [(0.8, 5, 6), (-1.4, 18, 5), (0.0, 11, 12)])
def test_the_effects_interval_is_that_of_scipys_noncentral_t(
    size: float, freedom: int, n_effective: float
) -> None:
    t = size * math.sqrt(n_effective)
    low, high = (end * math.sqrt(n_effective) for end in effect_of(size, freedom, n_effective)[1])
    assert stats.nct.sf(t, freedom, low) == pytest.approx(0.025, abs=1e-5)
    assert stats.nct.cdf(t, freedom, high) == pytest.approx(0.025, abs=1e-5)


JUDGES = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], dtype=float
)
"""Table 2 of Shrout and Fleiss (1979): 6 targets, 4 judges."""


def test_iccs_of_shrout_and_fleiss() -> None:
    icc = reliability(JUDGES)
    assert icc.agreement.value == pytest.approx(0.29, abs=0.005)
    assert icc.consistency.value == pytest.approx(0.71, abs=0.005)
    assert icc.agreement.interval == pytest.approx((0.02, 0.76), abs=0.005)
    assert icc.consistency.interval == pytest.approx((0.34, 0.95), abs=0.005)


def test_mean_squares_equal_those_of_least_squares() -> None:
    """They are computed from the residuals after fitting subjects, sessions or both."""
    n, k = JUDGES.shape
    of_rows, of_columns = np.kron(np.eye(n), np.ones((k, 1))), np.kron(np.ones((n, 1)), np.eye(k))

    def residual(design: np.ndarray) -> float:
        fitted = design @ np.linalg.lstsq(design, JUDGES.ravel(), rcond=None)[0]
        return float(((JUDGES.ravel() - fitted) ** 2).sum())

    both = residual(np.hstack([of_rows, of_columns]))
    assert mean_squares(JUDGES) == pytest.approx(
        ((residual(of_columns) - both) / 5, (residual(of_rows) - both) / 3, both / 15)
    )


def test_a_common_shift_is_consistent_but_not_in_agreement() -> None:
    """Without residuals the ICC and its interval are the limits for small residuals."""
    values = np.arange(6.0)[:, None] + np.array([0.0, 3.0])
    icc = reliability(values)
    assert icc.consistency.value == 1.0
    noise = np.random.default_rng(1).normal(0.0, 1e-5, values.shape)
    near = reliability(values + noise).agreement
    assert icc.agreement.value == pytest.approx(near.value, abs=1e-4)
    assert icc.agreement.interval == pytest.approx(near.interval, abs=1e-3)
    assert icc.agreement.value == pytest.approx(7.0 / (7.0 + 2 * 27.0 / 6))
    assert reliability(np.ones((5, 1)) * [0.0, 1.0]).agreement.value == 0.0


@pytest.mark.parametrize(("n", "m", "spread"), [(4, 9, 3.0), (12, 5, 0.2), (2, 2, 1.0), (6, 4, 0.0)])
def test_the_interval_of_two_groups_equals_welchs(n: int, m: int, spread: float) -> None:
    rng = np.random.default_rng(n)
    first, other = rng.normal(1.0, 1.0, n), rng.normal(0.0, spread, m)
    welch = stats.ttest_ind(first, other, equal_var=False).confidence_interval(0.95)
    assert group_difference(first, other).interval == pytest.approx(tuple(welch), rel=1e-12)


def test_groups_without_spread_differ_by_their_means() -> None:
    assert group_difference(np.full(4, 3.0), np.full(5, 1.0)).interval == (2.0, 2.0)


SCRIPT = Path(__file__).resolve().parents[1] / "export_tools" / "statistics_of_others.py"
ROUNDING = 1e-9


@pytest.mark.tools
@pytest.mark.parametrize(("n", "k", "shift"), [(6, 4, 2.0), (12, 3, 0.0), (20, 2, 0.5)])
def test_pingouin_has_the_same_iccs_and_sizes(
    export_tool: Callable[..., Path], n: int, k: int, shift: float
) -> None:
    python = export_tool("python/bin/python", "pingouin")
    rng = np.random.default_rng(n)
    values = rng.normal(0, 3, (n, 1)) + rng.normal(size=(n, k)) + shift * np.arange(k)
    first, other = rng.normal(1.0, 1.0, n), rng.normal(0.0, 2.0, n + 3)
    arrays = {"values": values, "first": first, "other": other}
    asked = json.dumps({name: array.tolist() for name, array in arrays.items()})
    theirs = json.loads(printed_by(python, SCRIPT, input=asked))
    ours = reliability(values)
    for name, icc in (("ICC(A,1)", ours.agreement), ("ICC(C,1)", ours.consistency)):
        assert [icc.value, *icc.interval] == pytest.approx(theirs["icc"][name], abs=ROUNDING)
    two = group_difference(first, other)
    assert two.effect is not None
    assert two.effect / small_sample_correction(2 * n + 1) == pytest.approx(theirs["cohen"], abs=ROUNDING)
    assert two.interval == pytest.approx(theirs["welch"][:2], abs=ROUNDING)
    assert two.p == pytest.approx(theirs["welch"][2], abs=0.1)
    size = paired_difference(first - other[:n]).effect
    assert size is not None
    assert size / small_sample_correction(n - 1) == pytest.approx(theirs["d_z"], abs=ROUNDING)
