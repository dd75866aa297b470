"""Tasks posed with a fitted hand, and lengths shared between a person's two hands."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import fitted, recorded

from shukotsu.fit.compiled_equations import pose, residuals
from shukotsu.fit.fit import SIDE_SD, HandFit, share_lengths
from shukotsu.fit.fitted_motion import pose_hand
from shukotsu.fit.gauss_newton import first_guess
from shukotsu.fit.length_pulls import pull_rows
from shukotsu.fit.measurements import Measurement, observations
from shukotsu.hand.rotations import rotate
from shukotsu.simulate.random_hand import BONES
from shukotsu.simulate.simulation import Simulated

DISTAL = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def hands() -> dict[str, tuple[HandFit, Simulated]]:
    return {side: (fitted(side), recorded(side, seed=4, n_frames=1600)[0]) for side in ("right", "left")}


@pytest.mark.parametrize("side", ["right", "left"])
def test_an_unfitted_task_is_posed_well(hands: dict[str, tuple[HandFit, Simulated]], side: str) -> None:
    """Metacarpals are within 6 deg and joint centres within 8 mm of the truth on average; distal receivers'
    positions predicted without them are within 1.2 mm of the measured ones.
    """
    fit = hands[side][0]
    drawn, poses = recorded(side, "opposition", seed=4, n_frames=1600)
    every = slice(None, None, 16)
    poses = poses.take(every)
    posed = pose_hand(fit, poses)
    assert posed.posed.all()
    assert np.median(posed.residual_mm) < 1.0
    angles = []
    for index, bone in enumerate(posed.bones):
        true_mm = drawn.truth.bone_position_mm[every, BONES.index(bone)]
        off = np.linalg.norm(posed.bone_position_mm[:, index] - true_mm, axis=-1)
        assert off.mean() < 8.0, bone
        if bone in ("ring_metacarpal", "little_metacarpal"):
            true = rotate(drawn.truth.bone_quaternion[every, BONES.index(bone)], DISTAL)
            direction = rotate(posed.bone_quaternion[:, index], DISTAL)
            angles.append(np.degrees(np.arccos(np.clip((true * direction).sum(-1), -1, 1))).mean())
    assert np.mean(angles) < 6.0
    tips = [name for name in posed.receivers if name.endswith("_distal")]
    blind = pose_hand(fit, poses, tips)
    for name in tips:
        index = posed.receivers.index(name)
        measured = poses.position_mm[:, poses.index(name)]
        seen = np.linalg.norm(posed.receiver_mm[:, index] - measured, axis=-1)
        unseen = np.linalg.norm(blind.receiver_mm[:, index] - measured, axis=-1)
        assert seen.mean() < unseen.mean() < 1.2, name


def test_a_frame_is_posed_alike_alone_and_among_others(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """Frames start between their neighbours unless frames or receivers are missing, which changes no pose."""
    fit, poses = hands["right"][0], hands["right"][1].take(np.r_[0:200, 230:300])
    poses.valid[40:55, [0, 3, 4, 5]] = poses.valid[100:103] = False
    poses.valid[130, 7] = False
    whole, every = pose_hand(fit, poses), np.arange(len(poses.frame))
    alone = [pose_hand(fit, poses.take(every[offset::7])) for offset in range(7)]
    for offset, posed in enumerate(alone):
        off = np.degrees(whole.angles_rad[offset::7] - posed.angles_rad)
        assert np.nanmax(np.abs(off)) < 0.1
        np.testing.assert_array_equal(whole.posed[offset::7], posed.posed)
    assert not whole.posed[100:103].any()


def test_frames_with_few_receivers_are_posed_to_the_end(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """With the hand's and the distal receivers alone, further steps would lower few frames' cost by 2 %."""
    fit, poses = hands["left"][0], hands["left"][1].take(slice(None, None, 4))
    poses.valid[:, [name != "hand" and not name.endswith("_distal") for name in poses.segments]] = False
    frames, state_sd = fit.convention.frames(poses), np.array(fit.model.states.sd)
    problem = replace(fit.problem, frames=frames, state_sd=state_sd)
    posed = pose(problem, first_guess(problem, fit.model, fit.posterior.x))
    cost, least = (residuals(problem, point).frame_cost for point in (posed, pose(problem, posed, 200)))
    assert (cost > 1.02 * least).mean() < 0.01


def test_both_hands_share_their_lengths(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """The hands' lengths come closer and their sds shrink; no joint becomes less certain."""
    right, left = hands["right"][0], hands["left"][0]
    shared_right, shared_left = share_lengths(right, left)
    for name, bone in right.bones.items():
        before = abs(bone.length_mm - left.bones[name].length_mm)
        after = abs(shared_right.bones[name].length_mm - shared_left.bones[name].length_mm)
        assert after < max(before, 5 * SIDE_SD * bone.length_mm)
        assert shared_right.bones[name].sd_mm < bone.sd_mm
        middle = sorted([bone.length_mm, left.bones[name].length_mm])
        assert middle[0] - 2.0 < shared_right.bones[name].length_mm < middle[1] + 2.0
    for before_fit, after_fit in ((right, shared_right), (left, shared_left)):
        assert pull_rows(after_fit) == pull_rows(before_fit)  # pulls are reported for each hand's own fit
        assert np.linalg.eigvalsh(after_fit.posterior.covariance)[0] > 0
        for name, joint in before_fit.joints.items():
            assert after_fit.joints[name].sd_mm <= joint.sd_mm + 1e-9


def test_pulls_on_a_length_account_for_most_of_its_error(hands: dict[str, tuple[HandFit, Simulated]]) -> None:
    """The squared pulls sum to less than the length's variance; a length measured by calliper has no
    pulls.
    """
    fit = hands["right"][0]
    squares = sum(row["pull_mm"] ** 2 for row in pull_rows(fit) if row["bone"] == "index_middle")
    assert 0.5 < np.sqrt(squares) / fit.bones["index_middle"].sd_mm < 1.0
    measured = observations(fit.model, [Measurement("index_middle", 25.0, 0.4)])
    with_calliper = replace(fit, problem=replace(fit.problem, observations=measured))
    assert {row["bone"] for row in pull_rows(with_calliper)} == {*fit.bones} - {"index_middle"}
