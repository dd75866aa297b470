"""The compiled equations against plain numpy, on random chains."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shukotsu.fit.compiled_equations import BLOCK_FRAMES, back_substitute, pose, reach, reduce, residuals
from shukotsu.fit.kernel import compiled, forward
from shukotsu.fit.normal_equations import (
    HUBER,
    FieldDistortion,
    Frames,
    Observations,
    Point,
    Problem,
    log_rotation,
)
from shukotsu.fit.operations import Branch, Mark, Operation, Reached, Side, Step, Term, Turn
from shukotsu.hand.rotations import Array, exp_rotation, unit

UNKNOWNS, STATES, RECEIVERS = 12, (3, 0, 4), 6
"""Sizes of a random hand; a state belongs to one branch, an unknown may occur in any."""

FIELD = FieldDistortion(np.arange(UNKNOWNS, UNKNOWNS + 12), np.array([20.0, -10.0, 5.0]), 100.0)
ALL = UNKNOWNS + 12
"""Number of unknowns with the twelve of the room's field."""

CLOSE, STEP = 1e-9, 1e-6


def random_operation(rng: np.random.Generator, states: range) -> Operation:

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
    """Return operations and turns up to each mark, the second mark on a side branch."""
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
    """Return a problem whose second branch has no states, and a point some way from the one measured."""
    rng = np.random.default_rng(seed)
    names = [f"receiver {i}" for i in range(RECEIVERS)]
    first = np.cumsum([0, *STATES])
    branches = tuple(
        Branch(random_steps(rng, range(first[b], first[b + 1]), each, depth=1))
        for b, each in enumerate((["bone a", *names[:2]], names[2:3], [*names[3:], "bone b"]))
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
    receivers = tuple(branch.receivers([str(i) for i in range(RECEIVERS)]) for branch in branches)
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
    """Return receivers' poses with noise and outliers, a tenth of them invalid and, of several frames, all of
    the first.
    """
    n_frames = len(point.y)
    rotation, position = np.empty((n_frames, RECEIVERS, 3, 3)), np.empty((n_frames, RECEIVERS, 3))
    for branch, each in zip(branches, receivers, strict=True):
        reached = reach(branch, point.x, point.y, point.root, point.root_mm)
        for mark, s in each:
            turn = exp_rotation(0.02 * rng.standard_t(2, size=(n_frames, 3)).clip(-40, 40))
            rotation[:, s] = reached.rotation[mark] @ turn
            position[:, s] = reached.position_mm[mark] + rng.standard_t(2, size=(n_frames, 3))
    valid = rng.random((n_frames, RECEIVERS)) > 0.1
    valid[0] = n_frames == 1
    return Frames(rotation, position, valid)


def computed_step_by_step(branch: Branch, point: Point) -> Reached:
    """Compute a branch's poses and axes step by step as products of matrices."""
    (n_frames, _), (R, t), left = point.y.shape, (point.root, point.root_mm), list[tuple[Array, Array]]()
    reached = Reached(*(np.empty((n, n_frames, *shape)) for n, shape in (
        (len(branch.marks), (3, 3)), (len(branch.marks), (3,)),
        (len(branch.operations), (3,)), (len(branch.operations), (3,)),
    )))  # fmt: skip
    for kind, index, constant in branch.plan:
        if kind in ("rotate", "translate"):
            operation, amount = branch.operations[index], np.zeros((n_frames, 1))
            for term in operation.terms:
                of_hand = 1.0 if term.unknown is None else point.x[term.unknown]
                of_frame = 1.0 if term.state is None else point.y[:, term.state]
                amount[:, 0] += term.coefficient * of_hand * of_frame
            amount += operation.constant
            reached.axis[index], reached.origin_mm[index] = R @ constant, t
            if operation.rotates:
                R = R @ exp_rotation(amount * constant)
            else:
                t = t + amount * (R @ constant)
        elif kind == "turn":
            R = R @ constant
        elif kind == "mark":
            reached.rotation[index], reached.position_mm[index] = R, t
        elif kind == "leave":
            left.append((R, t))
        else:
            R, t = left.pop()
    return reached


def assert_same(computed: Array, expected: Array) -> None:
    assert computed.shape == expected.shape
    largest = np.abs(expected).max(initial=1e-300)
    np.testing.assert_allclose(computed, expected, rtol=CLOSE, atol=CLOSE * largest)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_frames", [1, 7])
def test_compiled_residuals_equal_numpy(seed: int, n_frames: int) -> None:
    problem, point = random_problem(seed, n_frames)
    computed, rotation = residuals(problem, point), problem.rotation(point.x)
    y_off = (point.y - problem.state_mean) @ problem.state_prior().T
    frame_cost = problem.temper * (y_off**2).sum(1) / 2
    for each, branch, receivers in zip(computed.branches, problem.branches, problem.receivers, strict=True):
        reached = computed_step_by_step(branch, point)
        for name in ("rotation", "position_mm", "axis", "origin_mm"):
            assert_same(getattr(each.reached, name), getattr(reached, name))
        for i, (mark, s) in enumerate(receivers):
            back = rotation[:, s].swapaxes(-1, -2)
            off = reached.position_mm[mark] - problem.frames.position_mm[:, s]
            turned = log_rotation(back @ reached.rotation[mark]) / problem.sd[s, 1]
            r = np.concatenate([(back @ off[..., None])[..., 0] / problem.sd[s, 0], turned], -1)
            r *= problem.frames.valid[:, s, None]
            norm = np.linalg.norm(r, axis=-1)
            assert_same(each.r[i], r)
            assert_same(each.weight[i], HUBER / np.maximum(norm, HUBER))
            robust = np.where(norm > HUBER, HUBER * norm - HUBER**2 / 2, norm**2 / 2)
            frame_cost = frame_cost + problem.temper * robust
    assert_same(computed.frame_cost, frame_cost)
    off_rows = problem.observations.rows @ point.x - problem.observations.values
    priors = (problem.precision * point.x**2).sum() + (off_rows**2).sum()
    assert computed.cost == pytest.approx(frame_cost.sum() + priors / 2, rel=CLOSE)


@pytest.mark.parametrize("seed", range(4))
def test_analytic_derivatives_equal_finite_differences(seed: int) -> None:
    """Derivatives by the root, the states and the unknowns include weights and tempering. Those by the room's
    field are exact to first order only, and are taken of rotations alone.
    """
    problem, point = random_problem(seed, 7)
    weights = [np.sqrt(problem.temper * each.weight) for each in residuals(problem, point).branches]

    def slopes(nudged: Callable[[float], Point]) -> list[Array]:
        ends = (residuals(problem, nudged(step)).branches for step in (STEP, -STEP))
        return [
            ((ahead.r - behind.r) * weight[..., None]).swapaxes(0, 1).reshape(7, -1) / (2 * STEP)
            for ahead, behind, weight in zip(*ends, weights, strict=True)
        ]

    def by_root(column: int) -> Callable[[float], Point]:
        d = np.eye(6)[column]
        return lambda step: replace(
            point,
            root=point.root @ exp_rotation(step * d[3:]),
            root_mm=point.root_mm + step * point.root @ d[:3],
        )

    of_root = [slopes(by_root(column)) for column in range(6)]
    of_states = [
        slopes(lambda step, d=d: replace(point, y=point.y + step * d)) for d in np.eye(point.y.shape[1])
    ]
    of_unknowns = [slopes(lambda step, d=d: replace(point, x=point.x + step * d)) for d in np.eye(ALL)]
    for b, jacobian in enumerate(reduce(problem, point).jacobians()):
        branch, chain = problem.branches[b], len(problem.branches[b].unknowns)
        for by, columns, of_column in (
            (jacobian.by_root, range(6), of_root),
            (jacobian.by_states, branch.states, of_states),
            (jacobian.by_unknowns, problem.unknowns_of(b), of_unknowns),
        ):
            if not by.size:
                continue
            expected = np.stack([of_column[column][b] for column in columns], -1)
            of_field = slice(chain if by is jacobian.by_unknowns else by.shape[-1], None)
            expected.reshape(7, -1, 6, by.shape[-1])[:, :, :3, of_field] = 0.0
            np.testing.assert_allclose(by[..., of_field], expected[..., of_field], atol=0.02)
            expected[..., of_field] = by[..., of_field]
            np.testing.assert_allclose(by, expected, rtol=1e-4, atol=1e-4)


def dense_step(problem: Problem, point: Point, damping: float) -> tuple[Array, Array, Point]:
    """Return the reduced matrix and gradient of x, and the point after the step, by elimination of all
    frames' states and roots from one dense matrix.
    """
    n, n_y, n_x = len(point.y), point.y.shape[1], len(point.x)
    size = n * (n_y + 6) + n_x
    states = np.arange(n * n_y).reshape(n, n_y)
    roots = n * n_y + np.arange(6 * n).reshape(n, 6)
    unknowns = n * (n_y + 6) + np.arange(n_x)
    H, g = np.zeros((size, size)), np.zeros(size)
    prior = problem.temper * problem.state_prior().T @ problem.state_prior()
    rows = problem.observations.rows
    H[np.ix_(unknowns, unknowns)] = np.diag(problem.precision) + rows.T @ rows
    g[unknowns] = problem.precision * point.x + rows.T @ (rows @ point.x - problem.observations.values)
    for f in range(n):
        H[np.ix_(states[f], states[f])] += prior
        g[states[f]] += prior @ (point.y[f] - problem.state_mean)
        for b, each in enumerate(reduce(problem, point).jacobians()):
            of_x = unknowns[problem.unknowns_of(b)]
            at = np.concatenate([states[f, problem.branches[b].states], roots[f], of_x])
            J = np.concatenate([each.by_states[f], each.by_root[f], each.by_unknowns[f]], -1)
            H[np.ix_(at, at)] += J.T @ J
            g[at] += J.T @ each.r[f]
    whole, slope = H, g
    eliminated = []
    for inner, least in ((states.ravel(), 0.0), (roots.ravel(), 1e-9)):
        block = whole[np.ix_(inner, inner)] + np.diag(damping * np.diag(whole)[inner] + least)
        pull = np.linalg.solve(block, whole[inner])
        rest = np.linalg.solve(block, slope[inner])
        eliminated.append((inner, pull, rest))
        whole, slope = whole - whole[:, inner] @ pull, slope - whole[:, inner] @ rest
    matrix, gradient = whole[np.ix_(unknowns, unknowns)], slope[unknowns]
    step = np.zeros(size)
    step[unknowns] = -np.linalg.solve(matrix, gradient)
    for inner, pull, rest in reversed(eliminated):
        later = np.arange(size) > inner[-1]
        step[inner] = -(rest + pull[:, later] @ step[later])
    d_root = step[roots]
    moved = Point(
        point.x + step[unknowns],
        point.y + step[states],
        point.root @ exp_rotation(d_root[:, 3:]),
        point.root_mm + (point.root @ d_root[:, :3, None])[..., 0],
    )
    return matrix, gradient, moved


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_the_eliminated_step_equals_the_dense_one(seed: int, damping: float) -> None:
    problem, point = random_problem(seed, 7)
    steps = reduce(problem, point, damping)
    matrix, gradient, moved = dense_step(problem, point, damping)
    np.testing.assert_allclose(steps.matrix, matrix, rtol=1e-6, atol=1e-6 * np.abs(matrix).max())
    np.testing.assert_allclose(steps.gradient, gradient, rtol=1e-6, atol=1e-6 * np.abs(gradient).max())
    ahead = back_substitute(problem, point, steps, -np.linalg.solve(matrix, gradient))
    for name in ("x", "y", "root", "root_mm"):
        np.testing.assert_allclose(getattr(ahead, name), getattr(moved, name), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("seed", "n_frames"), [(0, 1), (1, 7), (2, 2 * BLOCK_FRAMES + 1)])
def test_each_frame_is_posed_independently_to_its_optimum(seed: int, n_frames: int) -> None:
    problem, point = random_problem(seed, n_frames)
    computed = pose(problem, point)
    before, cost, later = (
        residuals(problem, at).frame_cost for at in (point, computed, pose(problem, computed, 60))
    )
    assert (cost <= before + CLOSE).all()
    assert (cost - later <= 0.01 * cost + CLOSE).all()
    for row in {0, n_frames // 2, n_frames - 1}:
        each = slice(row, row + 1)
        alone = pose(replace(problem, frames=problem.frames.take(each)), point.take(each))
        for name in ("y", "root", "root_mm"):
            np.testing.assert_allclose(
                getattr(computed, name)[row], getattr(alone, name)[0], rtol=1e-6, atol=1e-7
            )


def test_cache_files_of_an_older_kernel_are_removed() -> None:
    """They may hold outdated code or name types that no longer exist, which would end the process."""
    folder, name = Path(forward.condense.stats.cache_path), forward.condense.py_func.__qualname__
    stale, fresh = folder / "forward.condense_012345678901-0.old.nbi", folder / f"forward.{name}-0.new.nbi"
    for index in (stale, fresh):
        index.write_bytes(b"")
    compiled.compiled(forward.condense.py_func)
    assert (stale.exists(), fresh.exists()) == (False, True)
    fresh.unlink()
