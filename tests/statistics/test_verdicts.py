"""Verdicts on families against SciPy, brute force and what must not change them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shukotsu.statistics.least_favourable import N_DRAWN, critical_t, largest_t_of_groups, p_of_t
from shukotsu.statistics.verdicts import (
    NOT_SHOWN,
    SHOWN,
    UNDECIDED,
    FamilyVerdicts,
    between_family,
    interaction_family,
    slope_family,
    within_family,
)


def skewed(rng: np.random.Generator, size: tuple[int, int]) -> np.ndarray:
    """Lognormal numbers of mean 0 and standard deviation 1, independently of how nulls are drawn."""
    return (rng.lognormal(size=size) - np.exp(0.5)) / np.sqrt(np.e * (np.e - 1.0))


def drawn(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape)


def test_a_mean_of_differences_is_students() -> None:
    d = drawn(1, 9, 4) + np.array([0.0, 1.0, 2.0, 4.0])
    found, theirs = within_family(d), stats.ttest_1samp(d, 0.0)
    assert found.t == pytest.approx(theirs.statistic)
    assert found.p_alone == pytest.approx(theirs.pvalue)
    ends = theirs.confidence_interval(0.95)
    assert [*found.low, *found.high] == pytest.approx([*ends.low, *ends.high])
    assert found.difference == pytest.approx(d.mean(axis=0))
    assert found.verdict[3] == SHOWN
    assert found.verdict[0] == NOT_SHOWN


def test_a_difference_of_groups_is_welchs_whoever_is_missing() -> None:
    a, b = 3.0 * drawn(2, 6, 3) + 1.0, drawn(3, 11, 3)
    a[0, 1] = b[2, 2] = b[3, 2] = np.nan
    found, theirs = between_family(a, b), stats.ttest_ind(a, b, equal_var=False, nan_policy="omit")
    assert found.t == pytest.approx(np.asarray(theirs.statistic))
    assert found.p_alone == pytest.approx(np.asarray(theirs.pvalue))
    ends = theirs.confidence_interval(0.95)
    assert [*found.low, *found.high] == pytest.approx([*ends.low, *ends.high])


def test_a_difference_of_differences_has_the_errors_of_four_means() -> None:
    cells = [drawn(10 + i, n, 2) * (1 + i) for i, n in enumerate((5, 6, 7, 8))]
    found = interaction_family(cells)
    means, errors = zip(*((c.mean(axis=0), c.var(axis=0, ddof=1) / len(c)) for c in cells), strict=True)
    difference = means[0] - means[1] - means[2] + means[3]
    assert found.difference == pytest.approx(difference)
    assert found.t == pytest.approx(difference / np.sqrt(sum(errors)))


def test_a_slope_is_that_of_least_squares() -> None:
    x, y = np.linspace(20.0, 60.0, 15), drawn(4, 15, 2)
    y[:, 1] += 0.3 * x
    found = slope_family(x, y)
    assert found.difference == pytest.approx([stats.linregress(x, own).slope for own in y.T])
    assert found.verdict == [NOT_SHOWN, SHOWN]


def test_a_slope_of_whom_some_are_missing_is_that_of_the_others() -> None:
    x, y = np.linspace(20.0, 60.0, 15), drawn(5, 15, 2)
    y[[3, 8], 1] = np.nan
    known = np.isfinite(y[:, 1])
    alone = slope_family(x[known], y[known, 1:])
    assert slope_family(x, y).t[1] == pytest.approx(alone.t[0])


@pytest.mark.parametrize("sizes", [(8,), (6, 6), (5, 15)])
def test_no_worst_null_is_easier_than_a_normal_one(sizes: tuple[int, ...]) -> None:
    worst = largest_t_of_groups(sizes)
    for t in (1.0, 2.0, 3.0, 5.0):
        of_normal = 2.0 * stats.t.sf(t, sum(sizes) - len(sizes))  # the most degrees of freedom
        slack = 4.0 * np.sqrt(of_normal / N_DRAWN)
        assert p_of_t(t, worst) >= of_normal - slack


def test_p_and_the_critical_t_are_two_sides_of_one() -> None:
    worst = largest_t_of_groups((6, 6))
    for p in (0.05, 0.01, 0.001):
        assert p_of_t(critical_t(p, worst), worst) == pytest.approx(p, rel=0.02)


def test_copies_count_as_one_comparison_and_strangers_as_many() -> None:
    one = drawn(6, 12, 1)
    assert within_family(one).n_comparisons == pytest.approx(1.0, abs=0.1)
    assert within_family(np.repeat(one, 20, axis=1)).n_comparisons == pytest.approx(1.0, abs=0.1)
    strangers = np.linalg.qr(drawn(7, 30, 20))[0]
    assert within_family(strangers).n_comparisons == pytest.approx(20.0, rel=0.15)


def test_order_units_and_sides_change_no_verdict() -> None:
    a, b = drawn(8, 7, 6) + np.array([0, 0, 0, 2, 3, 5]), drawn(9, 8, 6)
    found = between_family(a, b)
    order = [4, 2, 0, 5, 1, 3]
    for other, p in (
        (between_family(a[:, order], b[:, order]), found.p[order]),
        (between_family(100 * a - 7, 100 * b - 7), found.p),
        (between_family(-a, -b), found.p),
    ):
        assert other.p == pytest.approx(p, abs=0.02)  # columns share their random directions
    assert between_family(b, a).difference == pytest.approx(-found.difference)


def test_a_family_asks_for_more_than_one_number_and_few_subjects_decide_nothing_in_it() -> None:
    a, b = drawn(10, 6, 51), drawn(11, 6, 51)
    a[:, 0] += 4.0
    alone, family = between_family(a[:, :1], b[:, :1]), between_family(a, b)
    assert family.p[0] > alone.p[0] > alone.p_alone[0]
    assert family.t_threshold[0] > alone.t_threshold[0]
    assert family.detectable[0] > alone.detectable[0]
    assert alone.verdict == [SHOWN]
    assert set(family.verdict[1:]) == {UNDECIDED}


def test_too_few_subjects_have_no_verdict_and_leave_the_others_theirs() -> None:
    d = drawn(12, 8, 3)
    d[:4, 1] = np.nan
    found = within_family(d)
    assert found.verdict[1] == ""
    assert np.isnan([found.p[1], found.low[1], found.detectable[1]]).all()
    others = within_family(d[:, [0, 2]])
    assert found.p[[0, 2]] == pytest.approx(others.p, abs=0.02)


def test_numbers_that_are_all_the_same_are_no_difference() -> None:
    assert within_family(np.zeros((8, 2))).verdict == [NOT_SHOWN, NOT_SHOWN]
    assert within_family(np.full((8, 1), 3.0)).verdict == [SHOWN]


def test_what_errs_with_skewed_numbers_of_unequal_spread_is_held_by_the_worst_null() -> None:
    """Welch's t of 6 and 6: in 13 % of studies at 5 %, and in 1.5 % at 0.1 %."""
    rng, studies = np.random.default_rng(14), 40_000
    first, other = (spread * skewed(rng, (6, studies)) for spread in (3.0, 1.0))
    found = stats.ttest_ind(first, other, equal_var=False)
    assert (found.pvalue <= 0.05).mean() == pytest.approx(0.13, abs=0.01)
    assert (found.pvalue <= 0.001).mean() == pytest.approx(0.015, abs=0.003)
    worst = largest_t_of_groups((6, 6))
    for level in (0.05, 0.001):
        share = (np.abs(found.statistic) >= critical_t(level, worst)).mean()
        assert share == pytest.approx(level, abs=4 * np.sqrt(level / studies))


@pytest.mark.parametrize("n_groups", [1, 2])
def test_what_is_detectable_is_shown_in_four_of_five_studies(n_groups: int) -> None:
    rng, n, studies = np.random.default_rng(13), 8, 400

    def judged(shift: float) -> FamilyVerdicts:
        groups = [rng.normal(size=(n, 1)) for _ in range(n_groups)]
        groups[0] += shift
        return within_family(*groups) if n_groups == 1 else between_family(*groups)

    detectable = float(np.mean([judged(0.0).detectable[0] for _ in range(studies)]))
    shown = np.mean([judged(detectable).verdict == [SHOWN] for _ in range(studies)])
    assert shown == pytest.approx(0.8, abs=0.08)
