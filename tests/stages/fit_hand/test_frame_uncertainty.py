"""Errors stated of posed frames: against posing again, against the truth, and with receivers taken away."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import recorded

from anatomy.average_hand import DIGITS
from anatomy.drawn_hands import SOURCES
from schemas.layout import read_layout
from schemas.poses import Poses
from skeleton.joint_angles import angles_of_hand, joint_angles
from skeleton.rotations import Array, from_matrix, unit
from stages.evaluate_skeletons.truth_errors import RADIUS_SD
from stages.fit_hand.facing import facing_nails
from stages.fit_hand.fingertips import TIP, Fingertips, fingertips
from stages.fit_hand.fit import Settings, fit_hand
from stages.fit_hand.frame_uncertainty import (
    NEUTRAL_SD_DEG,
    PosedErrors,
    Postures,
    _point,
    _spread_of,
    errors_with,
    measured_as_posed,
    new_in_a_session,
    posed_errors,
    posed_frames,
)
from stages.fit_hand.normal_equations import back_substitute, reduce, residuals
from stages.fit_hand.posed_tables import posed_ends_mm
from stages.fit_hand.replaying import PosedHand, pose_hand
from stages.simulate.random_hand import BONES, FINGERS

QUICK = Settings(n_frames=60, rounds=1)
SIX = ("hand", *(f"{digit}_distal" for digit in ("thumb", *FINGERS)))


def only(poses: Poses, worn: tuple[str, ...]) -> Poses:
    """The recording with the poses of some receivers alone."""
    return replace(poses, valid=poses.valid & np.isin(np.array(poses.segments), worn))


@pytest.fixture(scope="module", params=["right", "left"])
def tips(request: pytest.FixtureRequest) -> Fingertips:
    poses = recorded(request.param, seed=4, n_frames=1600)[1]
    return fingertips(fit_hand([poses], read_layout("liberty16"), request.param, settings=QUICK))


def task_of(tips: Fingertips, worn: tuple[str, ...] = ()) -> tuple[Poses, PosedHand]:
    """Twenty frames of another task, posed."""
    side = "left" if tips.fit.evidence.convention.left else "right"
    poses = recorded(side, "opposition", seed=4, n_frames=1600)[1].take(slice(0, None, 80))
    poses = only(poses, worn) if worn else poses
    return poses, pose_hand(tips.fit, poses)


def stated(tips: Fingertips, poses: Poses, posed: PosedHand) -> PosedErrors:
    return posed_errors(tips, posed, tips.fit.evidence.convention.frames(poses))


@pytest.mark.parametrize("worn", [(), SIX])
def test_the_map_is_what_posing_with_another_hand_does(tips: Fingertips, worn: tuple[str, ...]) -> None:
    """Unknowns moved a little along one of the map's numbers, and the frames' own solved again."""
    poses, posed = task_of(tips, worn)
    evidence = tips.fit.evidence
    frames = evidence.convention.frames(poses)
    spread = _spread_of(Postures.of(tips, posed), frames)
    problem = replace(
        evidence.problem, frames=frames, temper=1.0, state_sd=np.array(evidence.model.states.sd)
    )
    number = len(spread.unknowns) - 3  # one of the most uncertain directions
    step = 1e-5 * spread.unknowns[: len(evidence.posterior.x), number]

    def bones_mm(x: Array) -> Array:
        moved = replace(evidence, posterior=replace(evidence.posterior, x=x), problem=problem)
        again = replace(tips, fit=replace(tips.fit, evidence=moved))
        point = replace(_point(again, posed), x=x)
        reduced = reduce(problem, point, residuals(problem, point), np.zeros(len(point.y)), fixed_x=True)
        solved = back_substitute(problem, point, reduced, None)
        places = {posed.bones[0]: solved.root_mm}
        for branch in problem.branches:
            reached = branch.reach(x, solved.y, solved.root, solved.root_mm)
            places |= dict(zip(branch.marks, reached.position_mm, strict=True))
        return np.stack([places.get(f"bone {name}", places[posed.bones[0]]) for name in posed.bones], 1)

    slope = (bones_mm(evidence.posterior.x + step) - bones_mm(evidence.posterior.x - step)) / 2e-5
    np.testing.assert_allclose(spread.shift_mm[..., number], slope, atol=0.05 * np.abs(slope).max())


@pytest.mark.parametrize("worn", [(), SIX])
def test_errors_are_as_large_as_stated(tips: Fingertips, worn: tuple[str, ...]) -> None:
    """Nearly all centres, PIP angles and tips are within the 95 % that is stated, and not far within."""
    poses, posed = task_of(tips, worn)
    errors, layout = stated(tips, poses, posed), tips.fit.evidence.layout
    side = "left" if tips.fit.evidence.convention.left else "right"
    truth = recorded(side, "opposition", seed=4, n_frames=1600)[0].truth
    rows, places = slice(0, None, 80), [BONES.index(name) for name in posed.bones]
    off_mm = np.linalg.norm(posed.bone_position_mm - truth.bone_position_mm[rows][:, places], axis=-1)
    assert np.mean(off_mm < RADIUS_SD * errors.centre_mm) > 0.9
    assert np.sqrt((errors.centre_mm**2).mean()) < 2.5 * np.sqrt((off_mm**2).mean())
    true = replace(posed, bone_quaternion=truth.bone_quaternion[rows][:, places])
    angles = []
    for own in (posed, true):
        bones, rests = facing_nails(tips.fit, own)
        angles.append(angles_of_hand(posed.bones, bones, bones[:, 0], layout, side, rests))
    off, sd = (
        np.stack([values[f"{digit}_pip"][:, 0] for digit in FINGERS])
        for values in (
            {joint: angles[0][joint] - angles[1][joint] for joint in angles[0]},
            errors.angles_deg,
        )
    )
    assert np.mean(np.abs(off) < 1.96 * sd) > 0.85


def test_fewer_receivers_never_say_more(tips: Fingertips) -> None:
    """Of the same postures of a hand that is known, whatever is left out."""
    _, posed = task_of(tips)
    rng, worn = np.random.default_rng(1), np.array(tips.fit.evidence.model.receivers)
    known = replace(tips, covariance=np.zeros_like(tips.covariance))
    postures = Postures.of(known, posed)
    frames = measured_as_posed(postures)
    before = errors_with(postures, frames, worn)
    while len(worn) > 3:
        worn = np.delete(worn, rng.integers(len(worn), size=4))
        after = errors_with(postures, frames, worn)
        assert (after.centre_mm > before.centre_mm * (1 - 1e-6)).all()
        assert (after.turn_deg > before.turn_deg * (1 - 1e-6)).all()
        before = after


def test_six_receivers_say_less_of_a_pip_joint_than_all(tips: Fingertips) -> None:
    _, posed = task_of(tips)
    receivers = tips.fit.evidence.model.receivers
    postures = Postures.of(tips, posed)
    frames = measured_as_posed(postures)
    with_all, with_six = (errors_with(postures, frames, own).angles_deg for own in (receivers, SIX))
    for digit in FINGERS:
        joint = f"{digit}_pip"
        assert 1.2 < with_six[joint][:, 0].mean() / with_all[joint][:, 0].mean() < 5
        assert with_six[joint][:, 0].max() < 20


def test_what_is_not_posed_has_no_error_and_a_lost_receiver_costs_its_frames(tips: Fingertips) -> None:
    poses, _ = task_of(tips)
    valid = poses.valid.copy()
    valid[3, 1:] = False
    valid[7, poses.index("ring_distal")] = False
    lossy = replace(poses, valid=valid)
    errors = stated(tips, lossy, pose_hand(tips.fit, lossy))
    whole = stated(tips, poses, pose_hand(tips.fit, poses))
    for values in (errors.centre_mm, errors.turn_deg, errors.tips_mm, errors.angles_deg["index_pip"]):
        assert np.isnan(values[3]).all()
        assert np.isfinite(np.delete(values, 3, 0)).all()
    ring = list(tips.digits).index("ring")
    assert errors.angles_deg["ring_dip"][7, 0] > 2 * whole.angles_deg["ring_dip"][7, 0]
    assert (errors.tips_mm[7, ring] > whole.tips_mm[7, ring]).all()
    others = [index for index in range(5) if index != ring]
    np.testing.assert_allclose(errors.tips_mm[7, others], whole.tips_mm[7, others])


def test_ends_carried_by_their_bones_move_as_the_map_says(tips: Fingertips) -> None:
    """A skin's end is less certain than its bone's by the flesh between, and both are finite."""
    poses, _ = task_of(tips)
    blind = only(poses, tuple(s for s in poses.segments if not s.endswith("_distal")))
    posed = pose_hand(tips.fit, blind)
    errors = stated(tips, blind, posed)
    assert (errors.tips_mm[..., 1] > errors.tips_mm[..., 0]).mean() > 0.9
    assert posed_ends_mm(tips, posed)[TIP].shape == (*errors.tips_mm[..., 0].shape, 3)


def test_a_change_has_no_error_that_all_frames_share(tips: Fingertips) -> None:
    """In one posture no unknown of the hand is in the change; over a task it is less than the angle's."""
    poses, posed = task_of(tips)
    errors = stated(tips, poses, posed)
    again = posed_errors(tips, posed, tips.fit.evidence.convention.frames(poses), errors.reference_deg)
    for joint, sd_deg in errors.angles_deg.items():
        assert (again.changes_deg[joint] == errors.changes_deg[joint]).all()
        assert np.nanmedian(errors.changes_deg[joint][:, 0]) < np.nanmedian(sd_deg[:, 0])
    one = np.zeros(20, int)
    still, frames = posed_frames(posed, one), tips.fit.evidence.convention.frames(poses.take(one))
    known = replace(tips, covariance=np.zeros_like(tips.covariance))
    own, alone = posed_errors(tips, still, frames), posed_errors(known, still, frames)
    for joint, sd_deg in alone.angles_deg.items():
        of_frame = np.sqrt(sd_deg**2 - NEUTRAL_SD_DEG**2)
        np.testing.assert_allclose(own.changes_deg[joint], of_frame, rtol=1e-6)


def test_of_the_same_hand_in_another_session_less_is_uncertain(tips: Fingertips) -> None:
    """Nothing differs in a posture's change from itself; elsewhere a part of what the hand leaves open."""
    poses, posed = task_of(tips)
    errors = stated(tips, poses, posed)
    for joint, sd_deg in errors.angles_deg.items():
        assert (errors.session_deg[joint] < sd_deg).all()
        assert (errors.session_changes_deg[joint] < errors.changes_deg[joint]).all()
        assert np.median(errors.session_deg[joint] / sd_deg) > 0.1
    one = np.zeros(20, int)
    still = posed_errors(tips, posed_frames(posed, one), tips.fit.evidence.convention.frames(poses.take(one)))
    assert max(own.max() for own in still.session_changes_deg.values()) < 1e-6


@pytest.mark.parametrize("new_share", [0.0, 1.0])
def test_sessions_of_drawn_unknowns_differ_as_stated(new_share: float) -> None:
    """Of a linear problem: people drawn from the priors, measured twice, a part of them drawn anew."""
    rng = np.random.default_rng(8)
    n_unknowns, n_people = 6, 20_000
    seen, precision = rng.normal(size=(9, n_unknowns)), rng.uniform(0.5, 2.0, n_unknowns)
    put_on = np.arange(n_unknowns) % 2 == 0
    covariance = np.linalg.inv(seen.T @ seen + np.diag(precision))
    root = np.linalg.cholesky(covariance)
    person = rng.normal(size=(n_people, n_unknowns)) / np.sqrt(precision)
    noise = rng.normal(size=(n_people, 9))
    found = []
    for _ in range(2):
        anew = rng.normal(size=person.shape) / np.sqrt(precision)
        true = np.where(put_on, anew, person)
        other = new_share * rng.normal(size=noise.shape) + (1.0 - new_share) * noise
        found.append((true @ seen.T + other) @ seen @ covariance - true)
    expected = root @ new_in_a_session(root, precision, put_on, new_share)
    np.testing.assert_allclose(
        np.cov((found[1] - found[0]).T), 2 * expected @ expected.T, atol=0.05 * np.trace(covariance)
    )


def test_the_neutral_is_as_uncertain_as_published_hands_differ() -> None:
    """Of each joint's angles between bones that face as their axes do, in every source's average hand."""
    angles = []
    for hand in SOURCES.values():
        own = []
        for digit, drawn_digit in hand.items():
            rests = [np.eye(3), *replace(DIGITS[digit], faces_nail=digit == "thumb").frames()]
            facing = [np.eye(3), *map(_facing, drawn_digit.directions, drawn_digit.flexion_axes)]
            for place in range(1, len(facing)):
                turn, rest = (from_matrix(of[place - 1].T @ of[place]) for of in (facing, rests))
                own.append(joint_angles(np.array([1.0, 0, 0, 0]), turn, "right", rest))
        angles.append(own)
    spread = np.sqrt(np.var(angles, axis=0, ddof=1).mean(0))
    np.testing.assert_allclose(spread, [1.6, 1.5, 2.8], atol=0.05)
    np.testing.assert_allclose(NEUTRAL_SD_DEG, spread, atol=0.25)


def _facing(direction: Array, axis: Array) -> Array:
    x = unit(np.asarray(direction))
    y = unit(np.asarray(axis) - (np.asarray(axis) @ x) * x)
    return np.stack([x, y, np.cross(x, y)], -1)
