"""95 % bounds of a covariance: 95 % of simulated errors are inside the ellipsoid and its radius."""

import numpy as np
import pytest

from shukotsu.study.stated_error import CHI_SQUARE_95, halves_mm2, is_within_95, radius_95_mm


@pytest.mark.slow
@pytest.mark.parametrize("sds", [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (3.0, 3.0, 1.0), (4.0, 0.5, 0.1)])
def test_95_percent_of_errors_are_inside_for_any_shape(sds: tuple[float, ...]) -> None:
    """A fixed 1.614 sd would include only 91 % of errors with an sd three times as large in one direction."""
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    covariance, off = turn @ np.diag(np.square(sds)) @ turn.T, rng.normal(size=(20_000, 3)) * sds @ turn.T
    radius = radius_95_mm(covariance)
    assert np.mean([is_within_95(each, covariance) for each in off]) == pytest.approx(0.95, abs=0.005)
    assert np.mean(np.linalg.norm(off, axis=1) <= radius) == pytest.approx(0.95, abs=0.005)
    assert 0.99 * np.sqrt(CHI_SQUARE_95 / 3) < radius / np.linalg.norm(sds) < 1.96


def test_an_error_without_a_covariance_is_not_judged() -> None:
    """A fixed point has no covariance; a flat covariance excludes errors off its plane; an sd alone is a
    ball.
    """
    parent, child = halves_mm2(np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 0.0]).ravel(), 1.0)
    assert is_within_95(np.zeros(3), parent) is None
    assert is_within_95(np.array([1.0, 1.0, 0.0]), child) is True
    assert is_within_95(np.array([0.0, 0.0, 0.1]), child) is False
    assert is_within_95(np.array([1.6, 0.0, 0.0]), halves_mm2(None, 1.0)[0]) is True
    assert is_within_95(np.array([1.63, 0.0, 0.0]), halves_mm2(None, 1.0)[1]) is False
