"""The whole-hand fit on simulated hands and on random chains: accuracy, stated errors, missing receivers."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from chains import Chain, chain_layout, random_chain
from simulated_poses import recorded

from shukotsu.fit.compiled_equations import pose, reduce
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.fit.gauss_newton import first_guess, solve
from shukotsu.fit.measurements import Measurement
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.rotations import exp_rotation
from shukotsu.paper.joint_solution import solve_closed
from shukotsu.paper.moments import JointMoments
from shukotsu.paper.part_solutions import add_block
from shukotsu.simulate.random_hand import BONES
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.layout import Layout
from shukotsu.study.verdict import NO_POSE
from shukotsu.tables.poses import Poses

QUICK = FitSettings(n_frames=40, rounds=1)
hand = partial(recorded, seed=3)


@pytest.fixture(scope="module")
def fitted(layout: Layout) -> HandFit:
    return fit_hand([hand()[1]], layout, "right", settings=QUICK)


def child_errors_mm(fit: HandFit, drawn: Simulated) -> dict[str, float]:
    return {
        name: float(np.linalg.norm(joint.child_mm - drawn.truth.joints[name].child_mm))
        for name, joint in fit.joints.items()
    }


def without(poses: Poses, *segments: str) -> Poses:
    valid, position = poses.valid.copy(), poses.position_mm.copy()
    for segment in segments:
        valid[:, poses.index(segment)] = False
        position[:, poses.index(segment)] = np.nan
    return replace(poses, valid=valid, position_mm=position)


def test_the_fit_beats_one_that_treats_each_joint_alone(layout: Layout, fitted: HandFit) -> None:
    """With all disturbances on, every centre is within 5 mm and their median within 2 mm, below 0.7 of that
    of the closed-form solution joint by joint.
    """
    drawn, poses = hand()
    errors = child_errors_mm(fitted, drawn)
    assert len(errors) == 15
    assert fitted.converged
    assert max(errors.values()) < 5.0
    assert np.median(list(errors.values())) < 2.0
    moments = JointMoments(len(errors))
    add_block(moments, poses, [layout.joints[name] for name in errors])
    alone = [
        np.linalg.norm(solve_closed(moments, i, 6).q_mm - drawn.truth.joints[name].child_mm)
        for i, name in enumerate(errors)
    ]
    assert np.median(list(errors.values())) < 0.7 * np.median(alone)


def test_wrist_bones_and_receivers_are_within_their_stated_errors(fitted: HandFit) -> None:
    drawn, _ = hand()
    true = drawn.truth.joints
    wrist = fitted.summary.fixed["wrist"]
    off = wrist.child_mm - true["wrist"].child_mm
    assert off @ np.linalg.solve(wrist.covariance_mm2[3:, 3:], off) < 16
    for name, joint in fitted.joints.items():
        assert not joint.doubts, name
        assert joint.gap_rms_mm < 4
        # skin lets the thumb metacarpal's receiver miss up to half of the CMC's motion
        near_deg = true[name].range_deg / 2 if name == "thumb_cmc" else 15
        assert abs(joint.range_deg - true[name].range_deg) < near_deg
        for fitted_value, axis in (
            (joint.axis_parent, true[name].axis_parent),
            (joint.axis_child, true[name].axis_child),
        ):
            assert np.degrees(np.arccos(min(1.0, fitted_value @ axis))) < 15, name
    assert set(fitted.summary.palm) == {"ring_cmc", "little_cmc"}
    for joint in fitted.summary.palm.values():
        assert np.isnan(joint.child_mm).all()
        assert 5 < joint.range_deg < 30
    for name, bone in fitted.bones.items():
        assert abs(bone.length_mm - drawn.truth.hand.length_mm[BONES.index(name)]) < 4 * bone.sd_mm, name


def span_mm(fit: HandFit) -> float:
    """Return the distance between the index's and the little finger's knuckles in mm."""
    ends = (fit.model.knuckles[name] for name in ("index", "little"))
    places = [[fit.posterior.of_amount(amount)[0] for amount in each] for each in ends]
    return float(np.linalg.norm(np.subtract(*places)))


@pytest.mark.slow
def test_measured_sizes_change_the_quantities_they_measure(layout: Layout, fitted: HandFit) -> None:
    """A hand breadth moves the knuckles, a stated receiver height reduces the uncertainty in depth, and a
    calliper's length determines its bone.
    """
    anew = partial(fit_hand, [hand()[1]], hand="right", settings=QUICK)
    narrow, broad = (anew(layout=layout, hand_breadth_mm=breadth_mm) for breadth_mm in (72.0, 92.0))
    assert 0.5 < span_mm(broad) - span_mm(narrow) < 20 * 49 / 82
    assert narrow.joints["ring_mcp"].sd_mm < 1.01 * fitted.joints["ring_mcp"].sd_mm
    told = anew(layout=replace(layout, receiver_height_mm=2.0))
    heights = [fit.posterior.of_amount(fit.model.mount["index_distal"][2]) for fit in (told, fitted)]
    assert heights[0][1] < 0.95 * heights[1][1]
    assert fitted.bones["ring_metacarpal"].sd_mm > PRIOR.UNMODELLED_LENGTH_MM["metacarpal"]
    length_mm = fitted.bones["ring_metacarpal"].length_mm + 3.0
    measured = anew(layout=layout, measurements=[Measurement("ring_metacarpal", length_mm, 0.5)])
    assert measured.bones["ring_metacarpal"].sd_mm < 0.5
    assert measured.bones["ring_metacarpal"].length_mm == pytest.approx(length_mm, abs=0.5)


@pytest.mark.parametrize(
    "dead",
    [
        pytest.param("hand", marks=pytest.mark.slow),
        "index_middle",
        pytest.param("little_distal", marks=pytest.mark.slow),
    ],
)
def test_a_hand_is_fitted_without_a_dead_receiver(layout: Layout, dead: str) -> None:
    """Only the joints beside it carry a doubt that names it; every error is within 3 sd."""
    drawn, poses = hand()
    fit = fit_hand([without(poses, dead)], layout, "right", settings=QUICK)
    assert fit.converged
    errors = child_errors_mm(fit, drawn)
    for name, joint in fit.joints.items():
        touched = dead in (joint.parent_segment, joint.child_segment)
        assert joint.doubts == ({NO_POSE: {"segments": [dead]}} if touched else {}), name
        assert errors[name] < 3.0 * joint.sd_mm, name
    assert np.isnan(fit.residual_rms[dead]).all()


def test_a_forearm_receiver_locates_the_wrist(layout: Layout) -> None:
    drawn, poses = hand(forearm=True)
    wrist = fit_hand([poses], layout, "right", settings=QUICK).joints["wrist"]
    true = drawn.truth.joints["wrist"]
    for fitted_value, centre, rows in (
        (wrist.parent_mm, true.parent_mm, slice(0, 3)),
        (wrist.child_mm, true.child_mm, slice(3, 6)),
    ):
        off = fitted_value - centre
        assert off @ np.linalg.solve(wrist.covariance_mm2[rows, rows], off) < 16
        assert np.linalg.norm(off) < 5
    assert wrist.axis_child @ true.axis_child > 0.97


def free_layout(chain: Chain) -> Layout:
    layout = chain_layout(chain)
    return replace(layout, joints={name: replace(joint, dof=3) for name, joint in layout.joints.items()})


def test_a_chain_of_free_joints_is_located_without_anatomy() -> None:
    chain = random_chain(2, 6, 300, parents=(0, 0, 1, 2, 0), off_axis_rad=0.3, noise_mm=0.2)
    fit = fit_hand([chain.poses], free_layout(chain), "right")
    assert fit.converged
    for index, joint in enumerate(chain.joints):
        fitted_value = fit.joints[joint.name]
        assert np.linalg.norm(fitted_value.child_mm - chain.q_mm[index]) < 0.5
        assert np.linalg.norm(fitted_value.parent_mm - chain.p_mm[index]) < 0.5
    assert fit.summary.fixed == {}


@pytest.mark.slow
def test_the_stated_covariance_equals_that_of_repeated_recordings() -> None:
    """The stated variances agree with the scatter of fits to 120 noisy copies of a small chain's
    recording.
    """
    chain = random_chain(3, 3, 60, off_axis_rad=0.5)
    rng = np.random.default_rng(0)
    once = fit_hand([chain.poses], free_layout(chain), "right", settings=FitSettings(rounds=0))
    problem = replace(once.problem, temper=1.0)
    frames, sd = problem.frames, problem.sd[0]
    point = pose(problem, first_guess(problem, once.model, once.posterior.x))
    fitted_value = []
    for _ in range(120):
        turned = frames.rotation @ exp_rotation(sd[1] * rng.normal(size=frames.position_mm.shape))
        placed = frames.position_mm + sd[0] * rng.normal(size=frames.position_mm.shape)
        noisy = replace(problem, frames=replace(frames, rotation=turned, position_mm=placed))
        fitted_value.append(solve(noisy, point, 10).point.x)
    reduced = reduce(problem, point)
    stated = np.linalg.inv(reduced.matrix)
    sampled = np.cov(np.array(fitted_value).T)
    shown = np.diag(stated) < 0.01  # the others are determined by the prior, which noise does not change
    assert shown.sum() >= 12
    ratio = np.diag(sampled)[shown] / np.diag(stated)[shown]
    assert ratio.min() > 0.6
    assert ratio.max() < 1.6
    assert 0.85 < ratio.mean() < 1.15
