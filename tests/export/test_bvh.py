"""Angles and names of a BVH file; test_other_programs.py has what other programs read of one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from export_samples.moving_fingers import moving_fingers
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.export.bvh import euler_zyx_deg, write


@given(st.integers(0, 2**32 - 1))
def test_angles_are_the_rotations_and_go_on_from_frame_to_frame(seed: int) -> None:
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


def test_a_file_has_ascii_names_and_angles_that_never_jump(tmp_path: Path) -> None:
    """Also of a bone that bends beyond a right angle and a root that spins beyond half a turn."""
    motion = moving_fingers(600)
    joints = (*motion.joints[:4], replace(motion.joints[4], name="小指 1"), motion.joints[5])
    write(replace(motion, joints=joints), tmp_path / "motion.bvh")
    hierarchy, _, frames = (tmp_path / "motion.bvh").read_text("ascii").partition("MOTION\n")
    assert "JOINT _u5c0f_u6307_u00201\n" in hierarchy
    numbers = np.loadtxt(frames.splitlines()[2:])
    np.testing.assert_allclose(numbers[:, :3], motion.position_mm[:, 0] / 10, atol=1e-6)
    assert np.abs(np.diff(numbers[:, 3:], axis=0)).max() < 40
    assert np.abs(numbers[:, 3:]).max() > 180
