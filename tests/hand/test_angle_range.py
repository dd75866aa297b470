"""The one range of an angle: outliers do not stretch it, nor does rest shrink it where postures count."""

import numpy as np
import pytest

from shukotsu.hand.angle_range import angle_range, flattening


def test_one_bad_frame_in_forty_changes_nothing() -> None:
    angle = np.linspace(0.0, 100.0, 1001)
    assert angle_range(angle) == pytest.approx(95.0)
    assert angle_range(np.append(angle, [500.0] * 10)) == pytest.approx(95.0, abs=1.0)


def test_a_joint_that_rests_most_of_the_time_keeps_its_range_where_postures_count() -> None:
    angle = np.concatenate([np.zeros(9000), np.linspace(0.0, 1.0, 1000)])
    assert angle_range(angle) < 0.8
    assert angle_range(angle, flattening(angle)) == pytest.approx(0.95, abs=0.03)
