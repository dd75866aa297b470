"""The one range of an angle: outliers do not stretch it, nor does rest shrink it where postures count."""

import numpy as np
import pytest

from skeleton.angle_range import angle_range, flattening


def test_one_bad_frame_in_forty_changes_nothing() -> None:
    angle = np.linspace(0.0, 100.0, 1001)
    assert angle_range(angle) == pytest.approx(95.0)
    assert angle_range(np.append(angle, [500.0] * 10)) == pytest.approx(95.0, abs=1.0)


def test_equal_weights_are_none() -> None:
    angle = np.random.default_rng(1).normal(size=4000)
    assert angle_range(angle, np.full(4000, 0.3)) == pytest.approx(angle_range(angle), rel=1e-3)


def test_a_joint_that_rests_most_of_the_time_keeps_its_range_where_postures_count() -> None:
    angle = np.concatenate([np.zeros(9000), np.linspace(0.0, 1.0, 1000)])
    assert angle_range(angle) < 0.8
    assert angle_range(angle, flattening(angle)) == pytest.approx(0.95, abs=0.03)


def test_of_one_frame_it_is_nothing() -> None:
    assert angle_range(np.array([3.0])) == 0.0
    assert angle_range(np.array([3.0]), np.ones(1)) == 0.0
