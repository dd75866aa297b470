"""The second drawing of hands says what is true of the poses it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.other_hands import Recording, draw_person, record
from shukotsu.schemas.poses import Poses

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def calibration() -> Recording:
    return record(draw_person(3), "right", "calibration", seed=5, duration_s=30, rate_hz=60, forearm=True)


def turning(poses: Poses, segment: str) -> Rotation:
    return Rotation.from_quat(poses.quaternion[:, poses.index(segment)], scalar_first=True)


def test_bones_keep_their_length_but_for_the_joints_wander(calibration: Recording) -> None:
    for bone, length_mm in calibration.true_lengths_mm.items():
        digit, part = bone.split("_")
        ends = {"metacarpal": ("cmc", "mcp"), "proximal": ("mcp", "ip" if digit == "thumb" else "pip")}
        ends |= {"middle": ("pip", "dip"), "distal": ("ip" if digit == "thumb" else "dip", None)}
        first, last = ends[part]
        far = (
            calibration.true_tip_mm[digit] if last is None else calibration.true_centre_mm[f"{digit}_{last}"]
        )
        across = np.linalg.norm(far - calibration.true_centre_mm[f"{digit}_{first}"], axis=1)
        assert np.abs(across - length_mm).max() < (3.5 if bone == "thumb_metacarpal" else 2.2)
        assert np.ptp(across) < 4


@pytest.mark.parametrize("seed", range(6))
def test_receivers_lie_as_the_layout_says(seed: int) -> None:
    person = draw_person(seed, thumb_facing="between")
    for worn in person.worn["right"]:
        bone = person.bones[worn.bone]
        x, y, z = worn.axes.T
        assert x @ bone.along > np.cos(np.deg2rad(20))  # the cable leaves towards the wrist
        off = worn.place - bone.base
        off = off - (off @ bone.along) * bone.along
        if worn.bone not in ("hand", "forearm"):
            assert 4.5 < np.linalg.norm(off) < 16
            assert z @ off > 0.9 * np.linalg.norm(off)  # flat on the skin, z away from it
        if worn.bone != "thumb_metacarpal":
            assert z @ bone.up > np.cos(np.deg2rad(32))
            assert y @ np.cross(bone.up, bone.along) > 0.8  # to the thumb's side


def test_a_left_hand_is_the_right_one_in_a_mirror() -> None:
    person = draw_person(8)
    person = replace(person, worn={"right": person.worn["right"], "left": person.worn["right"]})
    right, left = (
        record(person, side, "grip", seed=2, duration_s=5, rate_hz=60) for side in ("right", "left")
    )
    assert np.allclose(left.true_pose.position_mm, right.true_pose.position_mm * MIRROR)
    for name, centre in right.true_centre_mm.items():
        assert np.allclose(left.true_centre_mm[name], centre * MIRROR)
    for segment in right.poses.segments:
        ours = turning(right.true_pose, segment).as_matrix() * MIRROR[:, None]
        theirs = turning(left.true_pose, segment).as_matrix()
        assert np.allclose(theirs, ours * [1, -1, 1])  # x to the tip, z off the skin, y to the other side
