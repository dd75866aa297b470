"""Other rates and ranges: constant speed stays constant, device time counts, gaps stay gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from export_samples.moving_fingers import moving_fingers, timed
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.errors import InputError
from shukotsu.skeleton.posing import PosedRecording
from shukotsu.skeleton.rotations import about_axis, angle, conjugate, multiply, unit
from shukotsu.stages.export.gaps import resampled


def spinning(time_s: np.ndarray, axis: np.ndarray, speed: float, rate_hz: float) -> PosedRecording:
    """Every bone turns about one axis at one speed, and moves along it at another."""
    motion = moving_fingers(len(time_s))
    turn = about_axis(axis, speed * time_s)[:, None].repeat(6, 1)
    place = (time_s[:, None, None] * axis * 30).repeat(6, 1)
    return replace(timed(motion, time_s=time_s), rate_hz=rate_hz, position_mm=place, quaternion=turn)


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(-40, 40),
    st.floats(5, 300),
    st.integers(0, 2**31),
)
def test_a_constant_angular_velocity_stays_one(
    axis: list[float], speed: float, fps: float, seed: int
) -> None:
    """At uneven times too, and through half turns; up to 0.2 rad between frames as recorded."""
    rng = np.random.default_rng(seed)
    time_s = 3 + np.cumsum(rng.uniform(0.002, 0.005, 60))
    along = unit(np.array(axis))
    motion = spinning(time_s, along, speed, 1 / 0.0035)
    found = resampled(motion, fps)
    even = time_s[0] + np.arange(len(found.frame)) / fps
    np.testing.assert_allclose(found.time_s, even, atol=1e-9)
    assert time_s[-1] - 1 / fps < found.time_s[-1] <= time_s[-1]
    truth = about_axis(along, speed * found.time_s)
    assert angle(multiply(conjugate(truth), found.quaternion[:, 0])).max() < 1e-7
    np.testing.assert_allclose(found.position_mm[:, 3], found.time_s[:, None] * along * 30, atol=1e-9)
    assert (np.sum(found.quaternion[1:] * found.quaternion[:-1], -1) >= -1e-9).all()
    assert found.rate_hz == fps


def test_a_gap_that_was_kept_stays_a_gap() -> None:
    motion = moving_fingers(100)
    position = motion.position_mm.copy()
    position[40:50, 2] = np.nan
    found = resampled(replace(motion, position_mm=position), 30)
    inside = (found.time_s > motion.time_s[39]) & (found.time_s < motion.time_s[50])
    np.testing.assert_array_equal(~found.known[:, 2], inside)
    assert found.known[:, 0].all()
    assert inside.sum() == 3


def test_nothing_is_made_between_frames_that_are_far_apart() -> None:
    motion = moving_fingers(100).take(np.r_[0:40, 50:100])
    found = resampled(motion, 30)
    inside = (found.time_s > motion.time_s[39]) & (found.time_s < motion.time_s[40])
    np.testing.assert_array_equal(~found.whole, inside)
    assert not found.receivers.valid[inside].any()
    assert found.receivers.valid[~inside].all()
    assert resampled(motion, 30, widest_s=0.2).whole.all()


def test_times_that_do_not_tell_are_refused() -> None:
    motion = moving_fingers(10)
    timeless = replace(timed(motion, time_s=np.full(10, np.nan)), rate_hz=np.nan)
    with pytest.raises(InputError, match="rate_hz"):
        resampled(timeless, 60)
    time_s = motion.time_s.copy()
    time_s[5] = time_s[4]
    with pytest.raises(InputError, match="does not grow from frame 11"):
        resampled(timed(motion, time_s=time_s), 60)
