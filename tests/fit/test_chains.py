"""Kinematic chains of the hand: geometry, derivatives, choice of frames, and recovery of a known hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.fit.chain import HandModel, hand_model
from shukotsu.fit.compiled_equations import pose, reach, reduce
from shukotsu.fit.gauss_newton import solve
from shukotsu.fit.measurements import side_by_side
from shukotsu.fit.normal_equations import Frames, Observations, Point, Problem, states_by_unknowns
from shukotsu.fit.posterior import Posterior
from shukotsu.fit.receiver_frames import spread_frames
from shukotsu.hand.rotations import Array, exp_rotation
from shukotsu.study.layout import Layout


def model_of(layout: Layout) -> HandModel:
    receivers = [name for name in layout.measured if name != "forearm"]
    return hand_model(layout, receivers, receivers, np.array([-35.0, 0.0, -14.0]))


def random_point(model: HandModel, n_frames: int, seed: int = 0) -> Point:
    rng = np.random.default_rng(seed)
    n_x, n_y = len(model.unknowns.names), len(model.states.names)
    root = exp_rotation(rng.normal(size=(n_frames, 3)))
    y = np.array(model.states.mean) + 0.6 * np.array(model.states.sd) * rng.normal(size=(n_frames, n_y))
    return Point(0.7 * rng.normal(size=n_x), y, root, 200 * rng.normal(size=(n_frames, 3)))


def problem_at(model: HandModel, point: Point, noise: float, seed: int = 1) -> Problem:
    """Observe the chain at a point: receivers' poses with noise (mm and deg), a tenth of them invalid."""
    rng = np.random.default_rng(seed)
    n_frames, n_receivers = len(point.y), len(model.receivers)
    rotation = np.empty((n_frames, n_receivers, 3, 3))
    position = np.empty((n_frames, n_receivers, 3))
    receivers = tuple(branch.receivers(model.receivers) for branch in model.branches)
    for branch, of_branch in zip(model.branches, receivers, strict=True):
        reached = reach(branch, point.x, point.y, point.root, point.root_mm)
        for mark, s in of_branch:
            turn = exp_rotation(np.radians(noise) * rng.normal(size=(n_frames, 3)))
            rotation[:, s] = reached.rotation[mark] @ turn
            position[:, s] = reached.position_mm[mark] + noise * rng.normal(size=(n_frames, 3))
    valid = rng.random((n_frames, n_receivers)) > 0.1
    n_x = len(point.x)
    return Problem(
        model.branches,
        receivers,
        Frames(rotation, position, valid),
        np.tile([0.5, 0.01], (n_receivers, 1)),
        0.3,
        np.array(model.states.mean),
        np.array(model.states.sd),
        np.full(n_x, 0.8),
        Observations(rng.normal(size=(2, n_x)), rng.normal(size=2)),
    )


def test_a_narrow_palm_moves_the_knuckles_and_keeps_them_apart(layout: Layout) -> None:
    """The first-order knuckle positions match the chain's to 0.2 mm; knuckles closer together than their
    bones are wide add observations that push them apart.
    """
    model, at = model_of(layout), (np.eye(3)[None], np.zeros((1, 3)))
    narrow = np.zeros(len(model.unknowns.names))
    narrow[model.unknowns.names.index("palm breadth")] = -0.5
    for branch in model.branches:
        reached = reach(branch, narrow, np.zeros((1, len(model.states.names))), *at)
        for name, amounts in model.knuckles.items():
            if (mark := f"bone {name}_proximal") in branch.marks:
                first_order = [amount.constant + amount.row(len(narrow)) @ narrow for amount in amounts]
                joint_mm = reached.position_mm[branch.marks.index(mark), 0]
                np.testing.assert_allclose(joint_mm, first_order, atol=0.2)
    assert len(side_by_side(model, narrow).rows) == 0
    near = side_by_side(model, 14 * narrow)
    assert len(near.rows) == 2  # the little finger lies lower than the ring finger
    closest = near.rows.T @ np.linalg.solve(near.rows @ near.rows.T, near.values)
    assert [len(side_by_side(model, share * closest).rows) for share in (0.99, 1.01)] == [0, 2]


def test_the_derivative_of_states_by_unknowns_equals_posing_again(layout: Layout) -> None:
    """Moving one unknown and posing all frames again changes the mean states as the derivative predicts."""
    model = model_of(layout)
    truth = random_point(model, 4)
    problem = problem_at(model, truth, 0.0)
    everything = np.ones_like(problem.frames.valid)
    problem = replace(
        problem, state_sd=10 * problem.state_sd, frames=replace(problem.frames, valid=everything)
    )

    def posed(x: Array) -> Point:
        point = Point(x, truth.y, truth.root, truth.root_mm)
        for _ in range(8):
            point = pose(problem, point)
        return point

    here = posed(truth.x)
    reduced = reduce(problem, here).frames_first()
    by_x = states_by_unknowns(problem, reduced, np.full(4, 0.25))
    for unknown in range(0, len(truth.x), 41):
        ends = []
        for sign in (1, -1):
            x = truth.x.copy()
            x[unknown] += sign * 1e-4
            ends.append(posed(x).y.mean(0))
        slope = (ends[0] - ends[1]) / 2e-4
        np.testing.assert_allclose(by_x[:, unknown], slope, atol=2e-4)


@pytest.mark.slow
def test_a_hand_made_by_the_model_is_recovered(layout: Layout) -> None:
    """From noise-free poses of the model's own chain, a fit that starts at the average hand comes within 0.05
    mm of the true one in every direction that the data determine, and every length within 2 sd.
    """
    model = model_of(layout)
    truth = random_point(model, 40, seed=5)
    truth = replace(truth, x=0.5 * truth.x)
    n_x = len(truth.x)
    exact = replace(
        problem_at(model, truth, 0.0),
        sd=np.tile([0.02, 0.0004], (len(model.receivers), 1)),
        temper=1.0,
        precision=np.full(n_x, 0.02),
        state_sd=30 * np.array(model.states.sd),
        observations=Observations(np.zeros((0, n_x)), np.zeros(0)),
    )
    point = replace(truth, x=np.zeros(n_x))
    for coarse in (25, 8, 2.5, 1):
        solution = solve(replace(exact, sd=coarse * exact.sd), point, 30)
        point = solution.point
        assert solution.converged
    reduced = reduce(exact, point).frames_first()
    variance, directions = np.linalg.eigh(np.linalg.inv(reduced.matrix))
    off_mm = 3.9 * directions.T @ (point.x - truth.x)  # the widest prior has an sd of 3.9 mm
    shown = variance < 0.05**2
    assert shown.sum() > n_x / 3
    assert np.abs(off_mm[shown]).max() < 0.05
    posterior = Posterior.of(exact, point, reduced, np.full(40, 1 / 40))
    for length in model.length.values():
        length_mm, sd = posterior.of_amount(length)
        true = length.constant + sum(c * truth.x[i] for c, i in length.parts)
        assert abs(length_mm - true) < 0.05 + 2 * sd


@given(st.integers(0, 1000), st.integers(1, 300), st.integers(1, 60))
def test_chosen_frames_differ_and_their_shares_sum_to_one(seed: int, n_frames: int, wanted: int) -> None:
    postures = np.random.default_rng(seed).normal(size=(n_frames, 4))
    rows, share = spread_frames(postures, wanted)
    assert len(rows) == len(share) == min(n_frames, wanted)
    assert (np.diff(rows) > 0).all()
    assert share.sum() == np.float64(1.0) or abs(share.sum() - 1) < 1e-12
    assert (share > 0).all()


def test_a_held_posture_gets_one_frame_with_its_share_of_time() -> None:
    postures = np.concatenate([np.zeros((900, 1)), np.linspace(0.1, 1, 100)[:, None]])
    rows, share = spread_frames(postures, 10)
    held = rows < 900
    assert held.sum() == 1
    assert share[held][0] > 0.89
