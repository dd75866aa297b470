"""Angles over time are those of the rotations, and do not jump."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.stages.export.bvh import euler_zyx_deg


@given(st.integers(0, 2**32 - 1))
def test_they_are_the_same_rotations_and_go_on_from_frame_to_frame(seed: int) -> None:
    """A motion in small steps, through any posture, has angles that step no further than twice its turn
    unless the second is near a right angle.
    """
    rng = np.random.default_rng(seed)
    steps = Rotation.from_rotvec(rng.normal(size=(200, 3)) * 0.02)
    turns = [Rotation.random(random_state=rng)]
    for step in steps:
        turns.append(turns[-1] * step)
    turn = Rotation.concatenate(turns)
    angles = euler_zyx_deg(turn.as_quat(scalar_first=True)[:, None])[:, 0]
    back = Rotation.from_euler("ZYX", angles, degrees=True)
    assert np.degrees((turn.inv() * back).magnitude()).max() < 1e-9
    steep = np.abs(np.cos(np.radians(angles[:, 1]))) < 0.2
    calm = ~(steep[1:] | steep[:-1])
    assert not calm.any() or np.abs(np.diff(angles, axis=0))[calm].max() < 60
    assert np.abs(angles[0, 1]) <= 90
