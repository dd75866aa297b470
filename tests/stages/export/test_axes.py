"""Turning the world mirrors nothing and takes up to up."""

from __future__ import annotations

import numpy as np
import pytest
from export_samples.moving_fingers import moving_fingers

from shukotsu.skeleton.rotations import angle, conjugate, matrix, multiply, rotate
from shukotsu.stages.export.axes import DIRECTIONS, turned, upright
from shukotsu.stages.export.motion import local_motion


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("transmitter_up", list(DIRECTIONS))
def test_up_goes_up_by_a_proper_rotation(transmitter_up: str, up: str) -> None:
    turn = upright(transmitter_up, up)
    np.testing.assert_allclose(rotate(turn, DIRECTIONS[transmitter_up]), DIRECTIONS[up], atol=1e-12)
    assert np.linalg.det(matrix(turn)) == pytest.approx(1)
    np.testing.assert_allclose(np.abs(matrix(turn)).max(0), 1, atol=1e-12)


def test_a_turned_world_has_the_same_hand_in_it() -> None:
    motion = moving_fingers(20, slip_mm=1.0)
    there = turned(motion, upright("z", "y"))
    before, after = local_motion(motion), local_motion(there)
    np.testing.assert_allclose(before.offset_mm[:, 1:], after.offset_mm[:, 1:], atol=1e-9)
    assert angle(multiply(conjugate(before.quaternion), after.quaternion))[:, 1:].max() < 1e-7
    np.testing.assert_allclose(there.position_mm[..., 1], motion.position_mm[..., 2], atol=1e-9)
    np.testing.assert_allclose(there.receivers.position_mm[..., 1], motion.receivers.position_mm[..., 2])
