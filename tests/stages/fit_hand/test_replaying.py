"""Recordings posed with a fitted hand, and both hands of a person."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import recorded

from schemas.layout import read_layout
from skeleton.rotations import rotate
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.replaying import pose_hand
from stages.fit_hand.sharing import SIDE_SD, share_lengths
from stages.simulate.random_hand import BONES, JOINTS
from stages.simulate.simulation import Simulated

QUICK = Settings(n_frames=60, rounds=1)
DISTAL = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def hands() -> dict[str, tuple[HandFit, Simulated]]:
    layout, found = read_layout("liberty16"), {}
    for side in ("right", "left"):
        made, poses = recorded(side, seed=4, n_frames=1600)
        found[side] = fit_hand([poses], layout, side, settings=QUICK), made
    return found


@pytest.mark.parametrize("side", ["right", "left"])
def test_bones_and_tips_of_another_recording(hands: dict[str, tuple[HandFit, Simulated]], side: str) -> None:
    """A task not fitted: metacarpals within 3 deg and joint centres within some mm of the truth; tips
    predicted without the distal receivers' positions within 1 mm of them.
    """
    fit = hands[side][0]
    made, poses = recorded(side, "opposition", seed=4, n_frames=1600)
    every = slice(None, None, 16)
    poses = poses.take(every)
    posed = pose_hand(fit, poses)
    assert posed.posed.all()
    assert np.median(posed.residual_mm) < 1.0
    angles = []
    for index, bone in enumerate(posed.bones):
        true_mm = made.truth.bone_position_mm[every, BONES.index(bone)]
        off = np.linalg.norm(posed.bone_position_mm[:, index] - true_mm, axis=-1)
        assert off.mean() < 8.0, bone
        if bone in ("ring_metacarpal", "little_metacarpal"):
            true = rotate(made.truth.bone_quaternion[every, BONES.index(bone)], DISTAL)
            found = rotate(posed.bone_quaternion[:, index], DISTAL)
            angles.append(np.degrees(np.arccos(np.clip((true * found).sum(-1), -1, 1))).mean())
    assert np.mean(angles) < 5.0
    tips = [name for name in posed.receivers if name.endswith("_distal")]
    blind = pose_hand(fit, poses, tips)
    for name in tips:
        index = posed.receivers.index(name)
        measured = poses.position_mm[:, poses.index(name)]
        seen = np.linalg.norm(posed.receiver_mm[:, index] - measured, axis=-1)
        unseen = np.linalg.norm(blind.receiver_mm[:, index] - measured, axis=-1)
        assert seen.mean() < unseen.mean() < 1.2, name


def test_angles_are_those_of_the_joints(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """PIP flexion follows the true one, frame by frame, up to a constant and the skin's share."""
    fit, made = hands["right"]
    every = slice(None, None, 16)
    posed = pose_hand(fit, recorded(seed=4, n_frames=1600)[1].take(every))
    for name in ("index_pip", "ring_pip", "little_mcp"):
        found = posed.angles_rad[:, posed.angle_names.index((name, "flexion"))]
        true = made.truth.angles_rad[every, JOINTS.index(name), 0]
        assert np.corrcoef(found, true)[0, 1] > 0.995
        assert np.ptp(found) == pytest.approx(np.ptp(true), rel=0.2)


def test_frames_without_receivers_are_nan(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """A frame with one receiver is not posed; a frame that lacks some is, and its neighbours do not mind."""
    fit = hands["right"][0]
    poses = recorded(seed=4, n_frames=1600)[1].take(slice(0, 40))
    whole = pose_hand(fit, poses)
    valid, position = poses.valid.copy(), poses.position_mm.copy()
    valid[3, 1:], valid[7, [2, 6, 10]] = False, False
    position[3, 1:] = np.nan
    posed = pose_hand(fit, replace(poses, valid=valid, position_mm=position))
    assert not posed.posed[3]
    assert posed.posed.sum() == 39
    assert np.isnan(posed.bone_position_mm[3]).all()
    assert np.linalg.norm(posed.bone_position_mm[7] - whole.bone_position_mm[7], axis=-1).max() < 5
    others = np.setdiff1d(np.arange(40), [3, 7])
    off_mm = posed.bone_position_mm[others] - whole.bone_position_mm[others]
    np.testing.assert_allclose(off_mm, 0, atol=1e-9)
    assert pose_hand(fit, poses.take(slice(0, 0))).angles_rad.shape == (0, len(posed.angle_names))


def test_both_hands_share_their_lengths(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """Lengths come together as far as they are known alike, and no joint is less certain than before."""
    right, left = hands["right"][0], hands["left"][0]
    one, other = share_lengths(right, left)
    for name, bone in right.bones.items():
        before = abs(bone.length_mm - left.bones[name].length_mm)
        after = abs(one.bones[name].length_mm - other.bones[name].length_mm)
        assert after < max(before, 5 * SIDE_SD * bone.length_mm)
        assert one.bones[name].sd_mm < bone.sd_mm
        middle = sorted([bone.length_mm, left.bones[name].length_mm])
        assert middle[0] - 2.0 < one.bones[name].length_mm < middle[1] + 2.0
    for before_fit, after_fit in ((right, one), (left, other)):
        assert np.linalg.eigvalsh(after_fit.evidence.posterior.covariance)[0] > 0
        for name, joint in before_fit.joints.items():
            assert after_fit.joints[name].sd_mm <= joint.sd_mm + 1e-9
