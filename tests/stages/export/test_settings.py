"""A motion made ready for a format: what the user asked, in an order that loses nothing."""

from __future__ import annotations

import numpy as np
import pytest
from export_samples.moving_fingers import blanked, moving_fingers, timed

from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import angle, conjugate, matrix, multiply, rotate
from shukotsu.stages.export.motion import local_motion
from shukotsu.stages.export.registry import DIRECTIONS, Settings, prepared, upright


def test_a_format_that_holds_gaps_keeps_them_unless_told_otherwise() -> None:
    motion = blanked(moving_fingers(40), np.s_[10:13, 2])
    kept = prepared(motion, Settings(), holds_gaps=True, up="")
    np.testing.assert_array_equal(kept.whole, motion.whole)
    assert prepared(motion, Settings(gaps="hold"), holds_gaps=True, up="").whole.all()
    with pytest.raises(InputError, match="joint index_mcp has no pose in frames 17 to 19"):
        prepared(motion, Settings(), holds_gaps=False, up="y")


def test_gaps_are_closed_before_the_rate_is_changed() -> None:
    motion = blanked(moving_fingers(40), np.s_[10:13, 2])
    assert prepared(motion, Settings(gaps="interpolate", fps=30), holds_gaps=False, up="y").whole.all()


def test_a_clock_that_jumps_is_not_bridged_unasked() -> None:
    """Frame numbers go on, time does not: nobody knows what the hand did meanwhile."""
    motion = moving_fingers(40)
    time_s = motion.time_s.copy()
    time_s[20:] += 0.3
    jumped = timed(motion, time_s=time_s)
    with pytest.raises(InputError, match=r"nothing was recorded about 0\.2\d\d s \(frame 26\)"):
        prepared(jumped, Settings(fps=30), holds_gaps=False, up="y")
    assert not prepared(jumped, Settings(fps=30), holds_gaps=True, up="").whole.all()
    wide = Settings(fps=30, gaps="interpolate", max_gap_s=0.5)
    assert prepared(jumped, wide, holds_gaps=False, up="y").whole.all()


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("transmitter_up", DIRECTIONS)
def test_up_goes_up_by_a_proper_rotation(transmitter_up: str, up: str) -> None:
    turn, axes = upright(transmitter_up, up), dict(zip(DIRECTIONS, [*np.eye(3), *-np.eye(3)], strict=True))
    np.testing.assert_allclose(rotate(turn, axes[transmitter_up]), axes[up], atol=1e-12)
    assert np.linalg.det(matrix(turn)) == pytest.approx(1)
    np.testing.assert_allclose(np.abs(matrix(turn)).max(0), 1, atol=1e-12)


def test_a_turned_world_has_the_same_hand_in_it() -> None:
    motion = moving_fingers(20, slip_mm=1.0)
    there = prepared(motion, Settings(), holds_gaps=True, up="y")
    (before_mm, before), (after_mm, after) = local_motion(motion), local_motion(there)
    np.testing.assert_allclose(before_mm[:, 1:], after_mm[:, 1:], atol=1e-9)
    assert angle(multiply(conjugate(before), after))[:, 1:].max() < 1e-7
    np.testing.assert_allclose(there.position_mm[..., 1], motion.position_mm[..., 2], atol=1e-9)
    np.testing.assert_allclose(there.receivers.position_mm[..., 1], motion.receivers.position_mm[..., 2])
