"""Compiled code against the same in NumPy, on random chains."""

from dataclasses import replace

import numpy as np
import pytest

from skeleton.rotations import Array, exp_rotation, unit
from stages.fit_hand import compiled_equations, kernel, normal_equations
from stages.fit_hand.normal_equations import Frames, Observations, Point, Problem, pairs
from stages.fit_hand.operations import Branch, Mark, Operation, Side, Step, Term, Turn
from stages.fit_hand.room_field import RoomField

UNKNOWNS, STATES, RECEIVERS = 12, (3, 0, 4), 6
"""Of a random hand; states of each branch are its own, unknowns are anybody's."""

FIELD = RoomField(np.arange(UNKNOWNS, UNKNOWNS + 12), np.array([20.0, -10.0, 5.0]), 100.0)
ALL = UNKNOWNS + 12
"""The room's field has as many unknowns again."""

CLOSE = 1e-9


def random_operation(rng: np.random.Generator, states: range) -> Operation:
    """Any amount: constant, by unknowns, by states, by their products."""

    def terms(most: int) -> tuple[Term, ...]:
        unknowns = [None, *range(UNKNOWNS)]
        drawn = [
            (rng.choice(np.array(unknowns, object)), rng.choice(np.array([None, *states], object)))
            for _ in range(rng.integers(0, most + 1))
        ]
        return tuple(Term(0.2 * rng.normal(), *factors) for factors in drawn)

    rotates = bool(rng.integers(2))
    return Operation(rotates, unit(rng.normal(size=3)), (1 if rotates else 20) * rng.normal(), terms(5))


def random_steps(rng: np.random.Generator, states: range, marks: list[str], depth: int) -> list[Step]:
    """Operations and turns up to each mark, the middle one on a side branch."""
    steps: list[Step] = []
    for i, mark in enumerate(marks):
        way: list[Step] = [random_operation(rng, states) for _ in range(rng.integers(2, 6))]
        way += [Turn(exp_rotation(rng.normal(size=3))), random_operation(rng, states), Mark(mark)]
        if depth and i == 1:
            steps.append(Side((*way, Side((random_operation(rng, states), Mark(f"{mark} beyond"))))))
        else:
            steps += way
    return steps


def random_problem(seed: int, n_frames: int) -> tuple[Problem, Point]:
    """A hand whose second branch has no states, and a point some way off what was measured."""
    rng = np.random.default_rng(seed)
    names = [f"receiver {i}" for i in range(RECEIVERS)]
    first = np.cumsum([0, *STATES])
    branches = tuple(
        Branch(random_steps(rng, range(first[b], first[b + 1]), own, depth=1))
        for b, own in enumerate((["bone a", *names[:2]], names[2:3], [*names[3:], "bone b"]))
    )
    n_states = first[-1]
    link = np.eye(n_states)
    link[1, 0], link[5, 4] = -0.6, 0.3
    point = Point(
        0.5 * rng.normal(size=ALL),
        0.4 * rng.normal(size=(n_frames, n_states)),
        exp_rotation(rng.normal(size=(n_frames, 3))),
        100 * rng.normal(size=(n_frames, 3)),
    )
    receivers = pairs(branches, [str(i) for i in range(RECEIVERS)])
    frames = measured(rng, branches, receivers, point)
    problem = Problem(
        branches,
        receivers,
        frames,
        rng.uniform([0.3, 0.01], [0.9, 0.03], (RECEIVERS, 2)),
        0.4,
        0.1 * rng.normal(size=n_states),
        rng.uniform(0.2, 0.6, n_states),
        rng.uniform(0.5, 2.0, ALL),
        Observations(rng.normal(size=(2, ALL)), rng.normal(size=2)),
        link,
        None if seed % 2 else FIELD,
    )
    return problem, replace(point, y=point.y + 0.05 * rng.normal(size=point.y.shape))


def measured(
    rng: np.random.Generator,
    branches: tuple[Branch, ...],
    receivers: tuple[tuple[tuple[int, int], ...], ...],
    point: Point,
) -> Frames:
    """Poses of receivers with noise and a few far off, a tenth of them not valid, and in one frame all."""
    n_frames = len(point.y)
    rotation, position = np.empty((n_frames, RECEIVERS, 3, 3)), np.empty((n_frames, RECEIVERS, 3))
    for branch, own in zip(branches, receivers, strict=True):
        reached = branch.reach(point.x, point.y, point.root, point.root_mm)
        for mark, s in own:
            turn = exp_rotation(0.02 * rng.standard_t(2, size=(n_frames, 3)).clip(-40, 40))
            rotation[:, s] = reached.rotation[mark] @ turn
            position[:, s] = reached.position_mm[mark] + rng.standard_t(2, size=(n_frames, 3))
    valid = rng.random((n_frames, RECEIVERS)) > 0.1
    valid[0] = n_frames == 1
    return Frames(rotation, position, valid)


def assert_same(found: Array, expected: Array) -> None:
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=CLOSE, atol=CLOSE * np.abs(expected).max(initial=1e-300))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_frames", [1, 7])
def test_residuals(seed: int, n_frames: int) -> None:
    problem, point = random_problem(seed, n_frames)
    found, expected = (
        equations.residuals(problem, point) for equations in (compiled_equations, normal_equations)
    )
    assert found.cost == pytest.approx(expected.cost, rel=CLOSE)
    assert_same(found.frame_cost, expected.frame_cost)
    for own, other in zip(found.branches, expected.branches, strict=True):
        assert_same(own.r, other.r)
        assert_same(own.weight, other.weight)
        for name in ("rotation", "position_mm", "axis", "origin_mm"):
            assert_same(getattr(own.reached, name), getattr(other.reached, name))


@pytest.mark.parametrize("seed", range(4))
def test_derivatives(seed: int) -> None:
    """By states, by the root and by the unknowns, with weights and tempering in."""
    problem, point = random_problem(seed, 7)
    current = normal_equations.residuals(problem, point)
    for index, jacobian in enumerate(compiled_equations.weighted_jacobians(problem, point)):
        branch, part = problem.branches[index], current.branches[index]
        r, by_operation, by_root = normal_equations.weighted_jacobian(problem, index, part, point)
        assert_same(jacobian.r, r)
        assert_same(jacobian.by_root, by_root)
        assert_same(jacobian.by_states, by_operation @ branch.per_state(point.x))
        by_unknowns = normal_equations.by_unknowns(problem, index, part, point, by_operation)
        assert_same(jacobian.by_unknowns, by_unknowns)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_a_step_of_the_whole_hand(seed: int, damping: float) -> None:
    problem, point = random_problem(seed, 7)
    steps = compiled_equations.reduce(problem, point, damping)
    current = normal_equations.residuals(problem, point)
    expected = normal_equations.reduce(problem, point, current, np.full(7, damping))
    found = steps.frames_first()
    for name in ("matrix", "gradient", "root_inverse", "root_by_x", "root_rhs"):
        assert_same(getattr(found, name), getattr(expected, name))
    for own, other in zip(found.eliminated, expected.eliminated, strict=True):
        for name in ("inverse", "by_rest", "rhs"):
            assert_same(getattr(own, name), getattr(other, name))
    dx = np.asarray(-np.linalg.solve(expected.matrix, expected.gradient))
    ahead = compiled_equations.back_substitute(problem, point, steps, dx)
    same = normal_equations.back_substitute(problem, point, expected, dx)
    for name in ("x", "y", "root", "root_mm"):
        assert_same(getattr(ahead, name), getattr(same, name))


@pytest.mark.parametrize(("seed", "n_frames"), [(0, 1), (1, 7), (2, 2 * compiled_equations.BLOCK_FRAMES + 1)])
def test_posing_is_levenberg_marquardt_of_every_frame(seed: int, n_frames: int) -> None:
    """Frame by frame in NumPy: steps that go up are taken back, frames stop by themselves."""
    problem, point = random_problem(seed, n_frames)
    found = compiled_equations.pose(problem, point)
    for row in {0, n_frames // 2, n_frames - 1}:
        own = replace(problem, frames=problem.frames.take(slice(row, row + 1)))
        expected = posed_alone(own, point.take(slice(row, row + 1)))
        for name in ("y", "root", "root_mm"):
            np.testing.assert_allclose(
                getattr(found, name)[row], getattr(expected, name)[0], rtol=1e-6, atol=1e-7
            )


def posed_alone(problem: Problem, point: Point) -> Point:
    damping, current = 1e-3, normal_equations.residuals(problem, point)
    for _ in range(12):
        reduced = normal_equations.reduce(problem, point, current, np.array([damping]), fixed_x=True)
        tried = normal_equations.back_substitute(problem, point, reduced, None)
        new = normal_equations.residuals(problem, tried)
        gain = current.frame_cost[0] - new.frame_cost[0]
        if gain < 0:
            damping *= 10
            continue
        is_last = gain <= 1e-4 * current.frame_cost[0]
        point, current, damping = tried, new, damping / 10
        if is_last:
            break
    return point


def test_every_function_is_compiled_once() -> None:
    """However arrays come: a second version would be compiled in every process that first needs it."""
    problem, point = random_problem(0, 7)
    read_only = Point(
        *(np.asfortranarray(values) for values in (point.x, point.y, point.root, point.root_mm))
    )
    for values in (read_only.x, read_only.y, problem.frames.valid, problem.sd, problem.state_mean):
        values.setflags(write=False)
    for own in (point, read_only):
        compiled_equations.residuals(problem, own)
        compiled_equations.pose(problem, own)
        steps = compiled_equations.reduce(problem, own)
        compiled_equations.back_substitute(problem, own, steps, np.zeros(ALL))
    versions = {
        name: len(function.signatures)
        for name, function in vars(kernel).items()
        if hasattr(function, "signatures") and function.signatures
    }
    assert versions
    assert max(versions.values()) == 1, versions
