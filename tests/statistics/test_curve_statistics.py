"""Tests of curves against the same with plain loops and scipy, and where subjects and stretches are
missing.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from scipy import stats

from shukotsu.statistics.curve_statistics import CurveTest, curves_between, curves_within


def smooth(n: int, seed: int, points: int = 21) -> np.ndarray:
    """Curves of n subjects that scatter smoothly about 0."""
    rng = np.random.default_rng(seed)
    at = np.linspace(0.0, np.pi, points)
    return np.asarray(rng.normal(size=(n, 4)) @ np.cos(np.arange(4)[:, None] * at))


def bump(points: int = 21) -> np.ndarray:
    return np.asarray(4.0 * np.exp(-((np.linspace(-1, 1, points) / 0.2) ** 2)))


def present(found: CurveTest | None) -> CurveTest:
    assert found is not None
    return found


def test_within_is_every_flip_by_loop() -> None:
    curves = smooth(7, 1) + bump()
    found = present(curves_within(curves))
    flipped = [np.array(signs)[:, None] * curves for signs in product((1, -1), repeat=7)]
    largest = np.array([np.abs(stats.ttest_1samp(own, 0.0).statistic).max() for own in flipped])
    seen = stats.ttest_1samp(curves, 0.0)
    assert found.t == pytest.approx(seen.statistic)
    expected = [(largest >= abs(t) - 1e-9).mean() for t in seen.statistic]
    assert found.p == pytest.approx(np.array(expected))
    ends = seen.confidence_interval(0.95)
    assert found.low == pytest.approx(ends.low)
    assert found.high == pytest.approx(ends.high)
    assert found.significant[10]
    assert not found.significant[[0, 20]].any()


def test_between_is_every_assignment_by_loop() -> None:
    a, b = smooth(5, 2) + bump(), smooth(4, 3)
    found = present(curves_between(a, b))
    curves = np.concatenate([a, b])
    largest = []
    for chosen in combinations(range(9), 5):
        rest = [i for i in range(9) if i not in chosen]
        t = stats.ttest_ind(curves[list(chosen)], curves[rest], equal_var=False).statistic
        largest.append(np.abs(t).max())
    seen = stats.ttest_ind(a, b, equal_var=False)
    assert found.t == pytest.approx(seen.statistic)
    expected = [(np.array(largest) >= abs(t) - 1e-9).mean() for t in seen.statistic]
    assert found.p == pytest.approx(np.array(expected))
    ends = seen.confidence_interval(0.95)
    assert found.low == pytest.approx(ends.low)
    assert found.high == pytest.approx(ends.high)


@pytest.mark.parametrize("n", [6, 9, 20])
def test_the_threshold_is_where_p_falls_to_the_level(n: int) -> None:
    found = present(curves_within(smooth(n, n) + bump() / 2))
    assert found.threshold is not None
    assert (found.significant == (np.abs(found.t) >= found.threshold - 1e-9)).all()
    assert (found.largest >= found.threshold - 1e-9).mean() <= 0.05


def test_a_missing_stretch_is_left_out_point_by_point() -> None:
    curves = smooth(10, 5) + bump()
    curves[:3, :4] = np.nan
    curves[:5, 15:] = np.nan
    curves[9] = np.nan
    found = present(curves_within(curves))
    assert found.n == 9
    assert np.isnan(found.t[15:]).all()  # 4 have it
    assert np.isnan(found.p[15:]).all()
    assert found.t[:15] == pytest.approx(stats.ttest_1samp(curves[:9, :15], 0.0, nan_policy="omit").statistic)
    between = present(curves_between(curves, smooth(6, 6)))
    assert np.isfinite(between.t).all()
    assert between.n == 9
    curves[5, 15:] = np.nan
    assert np.isnan(present(curves_between(curves, smooth(6, 6))).p[15:]).all()  # 3 have it
