"""Stated errors of posed frames: their derivatives, their agreement with the truth, and missing receivers."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import fitted, recorded

from shukotsu.fit import frame_uncertainty
from shukotsu.fit.compiled_equations import back_substitute, reach, reduce
from shukotsu.fit.fingertips import Fingertips, fingertips
from shukotsu.fit.fitted_motion import PosedHand, joint_angles_of, pose_hand
from shukotsu.hand.rotations import Array, from_matrix
from shukotsu.simulate.random_hand import BONES, FINGERS
from shukotsu.tables.poses import Poses

SIX = ("hand", *(f"{digit}_distal" for digit in ("thumb", *FINGERS)))


@pytest.fixture(scope="module", params=["right", pytest.param("left", marks=pytest.mark.slow)])
def tips(request: pytest.FixtureRequest) -> Fingertips:
    return fingertips(fitted(request.param))


def task_of(tips: Fingertips, worn: tuple[str, ...] = ()) -> tuple[Poses, PosedHand]:
    side = "left" if tips.fit.convention.left else "right"
    poses = recorded(side, "opposition", seed=4, n_frames=1600)[1].take(slice(0, None, 80))
    if worn:
        poses = replace(poses, valid=poses.valid & np.isin(np.array(poses.segments), worn))
    return poses, pose_hand(tips.fit, poses)


def stated_errors(tips: Fingertips, poses: Poses, posed: PosedHand) -> frame_uncertainty.PosedErrors:
    return frame_uncertainty.posed_errors(tips, posed, tips.fit.convention.frames(poses))


@pytest.mark.slow
@pytest.mark.parametrize("worn", [(), SIX])
def test_error_derivatives_equal_posing_with_a_changed_hand(tips: Fingertips, worn: tuple[str, ...]) -> None:
    """The unknowns are moved along an uncertain direction, and the frames' states are solved again."""
    poses, posed = task_of(tips, worn)
    fit = tips.fit
    frames = fit.convention.frames(poses)
    postures = frame_uncertainty.Postures.of(tips, posed)
    spread = frame_uncertainty._spread_of(postures, frames)
    problem = replace(fit.problem, frames=frames, temper=1.0, state_sd=np.array(fit.model.states.sd))
    number = len(spread.unknowns) - 3  # one of the most uncertain directions
    step = 1e-5 * spread.unknowns[: len(fit.posterior.x), number]

    def moved_hand(x: Array) -> tuple[Array, Array]:
        moved = fit.moved_to(x, fit.posterior.covariance)
        point = replace(frame_uncertainty.Postures.of(replace(tips, fit=moved), posed).point, x=x)
        solved = back_substitute(problem, point, reduce(problem, point), np.zeros(len(x)))
        places = {f"bone {posed.bones[0]}": (solved.root, solved.root_mm)}
        for branch in problem.branches:
            reached = reach(branch, x, solved.y, solved.root, solved.root_mm)
            reached_poses = zip(reached.rotation, reached.position_mm, strict=True)
            places |= dict(zip(branch.marks, reached_poses, strict=True))
        bones = [places[f"bone {name}"] for name in posed.bones]
        turns = [from_matrix(fit.convention.world(*each)[0]) for each in bones]
        angles = joint_angles_of(moved, replace(posed, bone_quaternion=np.stack(turns, 1)))
        return np.stack([position_mm for _, position_mm in bones], 1), np.stack([*angles.values()], 1)

    ahead, behind = (moved_hand(fit.posterior.x + sign * step) for sign in (1, -1))
    maps = dict(frame_uncertainty._angle_errors_deg(postures, spread))
    angle_map = np.stack([maps[joint] for joint in tips.fit.summary.angle_axes], 1)
    for derivative, first, second in zip((spread.shift_mm, angle_map), ahead, behind, strict=True):
        slope = (first - second) / 2e-5
        np.testing.assert_allclose(derivative[..., number], slope, atol=0.05 * np.abs(slope).max())


@pytest.mark.parametrize("worn", [(), SIX])
def test_errors_agree_with_the_stated_ones(tips: Fingertips, worn: tuple[str, ...]) -> None:
    """Nearly all centres and PIP angles are within their stated 95 % bounds, which are not far too wide."""
    poses, posed = task_of(tips, worn)
    errors = stated_errors(tips, poses, posed)
    side = "left" if tips.fit.convention.left else "right"
    truth = recorded(side, "opposition", seed=4, n_frames=1600)[0].truth
    rows, places = slice(0, None, 80), [BONES.index(name) for name in posed.bones]
    off_mm = np.linalg.norm(posed.bone_position_mm - truth.bone_position_mm[rows][:, places], axis=-1)
    assert np.mean(off_mm < 1.614 * errors.centre_mm) > 0.9  # 1.614: 95 % of isotropic errors
    assert np.sqrt((errors.centre_mm**2).mean()) < 2.5 * np.sqrt((off_mm**2).mean())
    true = replace(posed, bone_quaternion=truth.bone_quaternion[rows][:, places])
    angles = [joint_angles_of(tips.fit, each) for each in (posed, true)]
    off, sd = (
        np.stack([values[f"{digit}_pip"][:, 0] for digit in FINGERS])
        for values in ({joint: angles[0][joint] - angles[1][joint] for joint in angles[0]}, errors.angles_deg)
    )
    assert np.mean(np.abs(off) < 1.96 * sd) > 0.85


def test_unposed_frames_have_no_error_and_a_lost_receiver_raises_it(tips: Fingertips) -> None:
    poses, _ = task_of(tips)
    valid = poses.valid.copy()
    valid[3, 1:] = False
    valid[7, poses.index("ring_distal")] = False
    lossy = replace(poses, valid=valid)
    errors = stated_errors(tips, lossy, pose_hand(tips.fit, lossy))
    whole = stated_errors(tips, poses, pose_hand(tips.fit, poses))
    for values in (errors.centre_mm, errors.turn_deg, errors.tips_mm, errors.angles_deg["index_pip"]):
        assert np.isnan(values[3]).all()
        assert np.isfinite(np.delete(values, 3, 0)).all()
    ring = list(tips.digits).index("ring")
    assert errors.angles_deg["ring_dip"][7, 0] > 2 * whole.angles_deg["ring_dip"][7, 0]
    assert (errors.tips_mm[7, ring] > whole.tips_mm[7, ring]).all()
    others = [index for index in range(5) if index != ring]
    np.testing.assert_allclose(errors.tips_mm[7, others], whole.tips_mm[7, others])


def test_errors_between_sessions_of_one_hand_are_smaller(tips: Fingertips) -> None:
    """Angles compared between sessions of one hand are more certain than angles themselves, and the change of
    a posture that stays the same has no error.
    """
    poses, posed = task_of(tips)
    errors = stated_errors(tips, poses, posed)
    for joint, sd_deg in errors.angles_deg.items():
        assert (errors.session_deg[joint] < sd_deg).all()
        assert (errors.session_changes_deg[joint] < errors.changes_deg[joint]).all()
        assert np.median(errors.session_deg[joint] / sd_deg) > 0.1
    still = np.zeros(20, int)
    errors = frame_uncertainty.posed_errors(
        tips, frame_uncertainty.posed_frames(posed, still), tips.fit.convention.frames(poses.take(still))
    )
    assert max(each.max() for each in errors.session_changes_deg.values()) < 1e-6
