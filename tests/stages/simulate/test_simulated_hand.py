"""Anatomy and motion of the simulated hand."""

from __future__ import annotations

import numpy as np
import pytest

from skeleton import rotations
from stages.simulate.forward import poses_in_hand
from stages.simulate.random_hand import BONES, DIGITS, FINGERS, FLEXION, JOINTS, TIP_BONES, Hand, hand_of
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate

# mean length of each bone of each digit, Buryanov & Kotiuk 2010
MEAN_MM = {
    "thumb_metacarpal": 46.22,
    "thumb_distal": 21.67,
    "index_metacarpal": 68.12,
    "index_middle": 22.38,
    "middle_proximal": 44.63,
    "ring_distal": 17.30,
    "little_middle": 18.11,
}


def flexion_deg(simulated: Simulated, joint: str) -> np.ndarray:
    return np.degrees(simulated.truth.angles_rad[:, JOINTS.index(joint), FLEXION])


def pad_distances_mm(simulated: Simulated) -> np.ndarray:
    """Distance (T, 4) of the thumb's pad to each finger's."""
    truth = simulated.truth
    quaternion = truth.bone_quaternion[:, TIP_BONES]
    pads = truth.bone_position_mm[:, TIP_BONES] + rotations.rotate(quaternion, truth.hand.pad_mm)
    return np.linalg.norm(pads[:, 1:] - pads[:, :1], axis=-1)


def test_bone_lengths_of_fifty_subjects_are_anatomical() -> None:
    hands = [hand_of(f"{i:02d}", "right", 3, Realism.full()) for i in range(50)]
    for bone, mean_mm in MEAN_MM.items():
        lengths = np.array([hand.length_mm[BONES.index(bone)] for hand in hands])
        assert abs(lengths.mean() / mean_mm - 1) < 0.05
        assert 0.05 < lengths.std() / mean_mm < 0.14
        assert lengths.min() > 0.7 * mean_mm
        assert lengths.max() < 1.4 * mean_mm


def test_sides_differ_by_less_than_half_a_percent() -> None:
    for subject in ("01", "02", "03"):
        right, left = (hand_of(subject, side, 3, Realism.full()) for side in ("right", "left"))
        ratio = right.length_mm[2:] / left.length_mm[2:]
        assert np.abs(ratio - 1).max() < 0.005
        assert np.abs(ratio - 1).max() > 0


def test_left_hand_is_the_mirror_image_of_the_right() -> None:
    angles = 0.3 * np.random.default_rng(0).standard_normal((20, len(JOINTS), 3))
    right, left = (hand_of("01", side, 3, Realism.full()) for side in ("right", "left"))
    right_mm, right_turn = poses_in_hand(right, angles)
    left_mm, left_turn = poses_in_hand(left, angles)
    mirror = np.array([1.0, -1.0, 1.0])
    assert np.abs(left_mm - right_mm * mirror).max() < 1.0  # 0.5 % of the hand
    mirrored = np.diag(mirror) @ rotations.matrix(right_turn) @ np.diag(mirror)
    np.testing.assert_allclose(rotations.matrix(left_turn), mirrored, atol=1e-12)


def test_thumb_is_on_the_radial_side_and_flexion_bends_towards_the_palm() -> None:
    hand: Hand = hand_of("01", "right", 3, Realism.full())
    angles = np.zeros((2, len(JOINTS), 3))
    angles[1, :, FLEXION] = 0.4
    angles[1, [JOINTS.index(f"{d}_cmc") for d in FINGERS]] = 0.0
    position, _ = poses_in_hand(hand, angles)
    thumb, *fingers = TIP_BONES
    assert position[0, thumb, 1] > 40
    assert (position[1, fingers, 2] < position[0, fingers, 2] - 10).all()


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("subject", ["01", "02", "03"])
def test_thumb_meets_each_finger_in_turn(subject: str, side: str) -> None:
    apart_mm = pad_distances_mm(simulate(subject, side, "opposition", 20090601, Realism.full(), 960))
    assert apart_mm.min(0).max() < 10
    assert (apart_mm.max(0) > 30).all()
    assert (np.diff(apart_mm.argmin(0)) > 0).all()


@pytest.mark.parametrize("side", ["right", "left"])
def test_opposition_hardly_moves_the_dip_joints(side: str) -> None:
    simulated = simulate("01", side, "opposition", 5, Realism.full())
    dip = {digit: np.ptp(flexion_deg(simulated, f"{digit}_dip")) for digit in FINGERS}
    assert all(1.0 < range_deg < 12.0 for range_deg in dip.values())
    assert all(20 < np.ptp(flexion_deg(simulated, f"{digit}_pip")) < 60 for digit in FINGERS)
    if side == "left":
        assert max(dip["ring"], dip["little"]) < 4


def test_range_of_motion_moves_every_joint() -> None:
    simulated = simulate("01", "right", "rom", 5, Realism.full())
    assert len(simulated.frame) == 7200
    for digit in FINGERS:
        for kind in ("mcp", "pip", "dip"):
            assert 45 < np.ptp(flexion_deg(simulated, f"{digit}_{kind}")) < 105
    for joint in ("wrist", "thumb_cmc", "thumb_mcp", "thumb_ip"):
        assert np.ptp(flexion_deg(simulated, joint)) > 30
    assert np.ptp(flexion_deg(simulated, "little_cmc")) > 10


def test_hand_points_away_from_the_transmitters_x_axis() -> None:
    for subject in ("01", "02", "03", "04"):
        truth = simulate(subject, "right", "opposition", 5, Realism.full(), 1000).truth
        distal = rotations.rotate(truth.bone_quaternion[:, BONES.index("hand")], np.array([1.0, 0.0, 0.0]))
        assert 100 < np.degrees(np.arccos(distal[:, 0])).mean() < 125


def test_exact_fingers_stay_clear_of_the_twists_singularity() -> None:
    for task in ("opposition", "rom"):
        truth = simulate("01", "left", task, 5, Realism.exact()).truth
        wrist = truth.bone_position_mm[:, BONES.index("hand")]
        for digit in DIGITS[1:]:
            bone = BONES.index(f"{digit}_proximal")
            along = rotations.unit(truth.bone_position_mm[:, bone] - wrist)
            distal = rotations.rotate(truth.bone_quaternion[:, bone], np.array([1.0, 0.0, 0.0]))
            assert np.degrees(np.arccos((along * distal).sum(-1))).max() < 85
