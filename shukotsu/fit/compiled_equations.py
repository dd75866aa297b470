"""Residuals, normal equations and posing by the compiled kernel, which takes chains as flat arrays.

On paper: docs/whole-hand.md, sections 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.fit.kernel import derivatives, elimination, forward, posing
from shukotsu.fit.normal_equations import (
    HUBER,
    BranchResiduals,
    Elimination,
    Point,
    Problem,
    Reduced,
    Residuals,
)
from shukotsu.fit.operations import Branch, Index, Reached
from shukotsu.hand.rotations import Array

BLOCK_FRAMES = 128
"""Number of frames that are posed together; their data fit into a core's cache."""

_LEAST_GAIN = 1e-4
"""Relative decrease of a frame's cost below which its iteration ends."""

_FIRST_DAMPING = 1e-4
"""Damping with which the iteration of a frame starts."""

_FEW_STEPS = 2
"""Steps after which frames that have not converged are gathered; most have, from a good start."""

_KINDS = {
    "rotate": forward.ROTATE,
    "translate": forward.TRANSLATE,
    "turn": forward.MOVE,
    "mark": forward.MARK,
    "leave": forward.LEAVE,
    "return": forward.RETURN,
}


class Jacobian(NamedTuple):
    """A branch's weighted and tempered residuals r (F, m), and their derivatives by its states (F, m, s), by
    the root (F, m, 6) and by its unknowns (F, m, g).
    """

    r: Array
    by_states: Array
    by_root: Array
    by_unknowns: Array


@dataclass(frozen=True)
class Steps:
    """Normal equations with all states and roots eliminated, as in `Reduced`, but with the frames last.

    Attributes
    ----------
    matrix, gradient : array, shape (G, G) and (G,)
        Normal equations of the hand's unknowns.
    root_inverse, root_by_x, root_rhs : array, shape (6, 6, F), (G, 6, F) and (6, F)
        Elimination of the roots.
    eliminated, unknowns, r, derivatives : tuple
        For every branch: elimination of its states, indices of its unknowns, weighted residuals (m, F) and
        their derivatives.

    """

    matrix: Array
    gradient: Array
    root_inverse: Array
    root_by_x: Array
    root_rhs: Array
    eliminated: tuple[elimination.EliminatedStates, ...]
    unknowns: tuple[Index, ...]
    r: tuple[Array, ...]
    derivatives: tuple[derivatives.Derivatives, ...]

    def jacobians(self) -> list[Jacobian]:
        """Return every branch's residuals and derivatives with the frames first."""
        jacobians = []
        for r, each in zip(self.r, self.derivatives, strict=True):
            by_states, by_rest = (_first(values.swapaxes(0, 1)) for values in each)
            jacobians.append(Jacobian(_first(r), by_states, by_rest[..., :6], by_rest[..., 6:]))
        return jacobians

    def frames_first(self) -> Reduced:
        """Return the same equations with the frames first."""
        return Reduced(
            self.matrix,
            self.gradient,
            _first(self.root_inverse),
            _first(self.root_by_x.swapaxes(0, 1)),
            _first(self.root_rhs),
            tuple(
                Elimination(
                    _first(part.inverse), _first(part.by_rest.swapaxes(0, 1)), _first(part.rhs), unknowns
                )
                for part, unknowns in zip(self.eliminated, self.unknowns, strict=True)
            ),
        )


def _last(values: Array) -> Array:
    """Return a copy with the frames last instead of first."""
    return np.moveaxis(values, 0, -1).copy()


def _first(values: Array) -> Array:
    """Return a copy with the frames first instead of last."""
    return np.moveaxis(values, -1, 0).copy()


def _reached_buffers(branches: Sequence[Branch], n: int) -> forward.ReachedFrames:
    n_operations = sum(len(branch.operations) for branch in branches)
    n_marks = sum(len(branch.marks) for branch in branches)
    return forward.ReachedFrames(
        np.empty((n_operations, 3, n)),
        np.empty((n_operations, 3, n)),
        np.empty((n_marks, 3, 3, n)),
        np.empty((n_marks, 3, n)),
    )


def _residual_buffers(problem: Problem, n: int) -> derivatives.ResidualArrays:
    n_receivers = sum(map(len, problem.receivers))
    return derivatives.ResidualArrays(np.empty((n_receivers, 6, n)), np.empty((n_receivers, n)), np.empty(n))


def _posing_buffers(problem: Problem, n: int) -> posing.PosingBuffers:
    """Allocate the buffers for posing n frames."""
    b, m = len(problem.branches), 6 * max(map(len, problem.receivers), default=0)
    s = max((len(branch.states) for branch in problem.branches), default=0)
    return posing.PosingBuffers(
        forward.BranchPoses(np.empty((len(problem.state_mean), n)), np.empty((3, 3, n)), np.empty((3, n))),
        derivatives.Derivatives(np.empty((s, m, n)), np.empty((6, m, n))),
        elimination.EliminatedStates(np.empty((b, s, s, n)), np.empty((b, 6, s, n)), np.empty((b, s, n))),
        elimination.RootEquations(np.empty((6, 6, n)), np.empty((0, 6, n)), np.empty((6, n))),
        root_inverse=np.empty((6, 6, n)),
        root_rhs=np.empty((6, n)),
        d_root=np.empty((6, n)),
    )


def _chains(problem: Problem) -> forward.FlatChains:
    shared = () if problem.field is None else tuple(problem.field.unknowns.tolist())
    return _flat_chains(problem.branches, problem.receivers, shared)


def _amounts(chains: forward.FlatChains, x: Array) -> forward.Amounts:
    """Return the constant part of every operation's amount, and the factor of each term on its state."""
    terms = chains.terms
    slope = terms.coefficient * np.where(terms.unknown >= 0, x[terms.unknown], 1.0)
    running = np.append(0.0, np.cumsum(np.where(terms.state < 0, slope, 0.0)))
    return forward.Amounts(chains.constant + np.diff(running[terms.start]), slope)


def _poses(point: Point) -> forward.BranchPoses:
    return forward.BranchPoses(_last(point.y), _last(point.root), _last(point.root_mm))


def _measured_poses(problem: Problem, x: Array, *, free_x: bool) -> derivatives.MeasuredPoses:
    frames = problem.frames
    turned = np.zeros((len(frames.valid), frames.valid.shape[1], 3, 0))
    if free_x and problem.field is not None:
        turned = problem.field.by_unknown(frames.position_mm)
    return derivatives.MeasuredPoses(
        _last(problem.rotation(x)),
        _last(frames.position_mm),
        frames.valid.T.copy(),
        problem.sd.copy(),
        turned.transpose(1, 3, 2, 0).copy(),
    )


def _objective(problem: Problem) -> derivatives.Objective:
    most = max((len(branch.states) for branch in problem.branches), default=0)
    precision = np.zeros((len(problem.branches), most, most))
    for block, branch in zip(precision, problem.branches, strict=True):
        root, n = problem.state_prior(branch.states), len(branch.states)
        block[:n, :n] = problem.temper * root.T @ root
    return derivatives.Objective(problem.state_mean.copy(), precision, float(problem.temper), HUBER)


def reach(branch: Branch, x: Array, y: Array, root: Array, root_mm: Array) -> Reached:
    """Compute where a branch's chain reaches (forward kinematics, docs/whole-hand.md, section 2).

    Parameters
    ----------
    branch : Branch
        The chain.
    x : array, shape (G,)
        The hand's unknowns.
    y : array, shape (F, S)
        Joint angles, rad.
    root, root_mm : array, shape (F, 3, 3) and (F, 3)
        Pose of the hand's frame in the transmitter's.

    Returns
    -------
    Reached
        Poses of its marks, and axis and origin of every operation, in the transmitter's frame.

    """
    chains, n = _flat_chains((branch,), ((),)), len(y)
    reached = _reached_buffers((branch,), n)
    at = forward.BranchPoses(_last(y), _last(root), _last(root_mm))
    forward.reach(chains, chains.plan, _amounts(chains, x), at, reached)
    axis, origin_mm, rotation, position_mm = (np.moveaxis(values, -1, 1) for values in reached)
    return Reached(rotation, position_mm, axis, origin_mm)


@lru_cache(maxsize=2)
def _evaluated(problem: Problem, point: Point) -> derivatives.Evaluation:
    """Evaluate a problem at a point; the last two evaluations are cached, as most are needed again."""
    chains = _chains(problem)
    evaluation = derivatives.Evaluation(
        chains,
        _amounts(chains, point.x),
        _poses(point),
        _measured_poses(problem, point.x, free_x=True),
        _objective(problem),
        _reached_buffers(problem.branches, len(point.y)),
        _residual_buffers(problem, len(point.y)),
    )
    chains, amounts, at, _, _, reached, _ = evaluation
    forward.reach(chains, chains.plan, amounts, at, reached)
    derivatives.residuals(evaluation)
    return evaluation


def residuals(problem: Problem, point: Point) -> Residuals:
    """Compute residuals and the objective J (docs/whole-hand.md, sections 4 and 5).

    Parameters
    ----------
    problem : Problem
        Chains, measured frames and priors.
    point : Point
        Values of all unknowns.

    Returns
    -------
    Residuals
        Residuals by branch and receiver in units of their sd, the total cost, and each frame's part of it.

    """
    at = _evaluated(problem, point)
    parts, operation, mark, receiver = [], 0, 0, 0
    reached = [np.moveaxis(values, -1, 1) for values in at.reached]
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        operations = slice(operation, operation + len(branch.operations))
        marks = slice(mark, mark + len(branch.marks))
        rows = slice(receiver, receiver + len(receivers))
        parts.append(
            BranchResiduals(
                at.current.r[rows].swapaxes(1, 2),
                at.current.weight[rows],
                Reached(reached[2][marks], reached[3][marks], reached[0][operations], reached[1][operations]),
            )
        )
        operation, mark, receiver = operations.stop, marks.stop, rows.stop
    off_rows = problem.observations.rows @ point.x - problem.observations.values
    cost = at.current.cost.sum() + (problem.precision * point.x**2).sum() / 2 + (off_rows**2).sum() / 2
    return Residuals(tuple(parts), float(cost), at.current.cost)


def reduce(problem: Problem, point: Point, damping: float = 0.0) -> Steps:
    """Eliminate states and roots from the normal equations (docs/whole-hand.md, section 6).

    Parameters
    ----------
    problem : Problem
        Chains, measured frames and priors.
    point : Point
        Point at which it is linearised.
    damping : float
        Marquardt's: share of the diagonal that is added to it, for states and roots only.

    Returns
    -------
    Steps
        Matrix (G, G) and gradient (G,) of the hand's unknowns, and the terms for `back_substitute`.

    """
    at, G, n = _evaluated(problem, point), len(point.x), len(point.y)
    rows = problem.observations.rows
    matrix = np.diag(problem.precision) + rows.T @ rows
    gradient = problem.precision * point.x + rows.T @ (rows @ point.x - problem.observations.values)
    root = elimination.RootEquations(np.zeros((6, 6, n)), np.zeros((G, 6, n)), np.zeros((6, n)))
    dampings = np.full(n, damping)
    eliminated, of_branches, rs = [], [], []
    unknowns_of = tuple(map(problem.unknowns_of, range(len(problem.branches))))
    for b, unknowns in enumerate(unknowns_of):
        s, m, columns = len(problem.branches[b].states), 6 * len(problem.receivers[b]), 6 + len(unknowns)
        part = elimination.EliminatedStates(np.empty((s, s, n)), np.empty((columns, s, n)), np.empty((s, n)))
        of_branch = derivatives.Derivatives(np.empty((s, m, n)), np.empty((columns, m, n)))
        derivatives.jacobian(at, b, of_branch)
        r = elimination.eliminate(at, b, of_branch, dampings, part)
        elimination.add_to_root(at.chains, b, of_branch.by_rest, r, part, root)
        J_x = of_branch.by_rest[6:].reshape(len(unknowns), r.size)
        Z_x = part.by_rest[6:].reshape(len(unknowns), part.rhs.size)
        matrix[np.ix_(unknowns, unknowns)] += J_x @ J_x.T - Z_x @ Z_x.T
        gradient[unknowns] += J_x @ r.ravel() - Z_x @ part.rhs.ravel()
        eliminated.append(part)
        of_branches.append(of_branch)
        rs.append(r)
    inverse, rhs, by_x = np.empty((6, 6, n)), np.empty((6, n)), np.empty((G, 6, n))
    elimination.reduce_roots(root, dampings, inverse, rhs, by_x)
    flat = by_x.reshape(G, 6 * n)
    matrix -= flat @ flat.T
    gradient -= flat @ rhs.ravel()
    parts = tuple(eliminated), unknowns_of, tuple(rs), tuple(of_branches)
    return Steps(matrix, gradient, inverse, by_x, rhs, *parts)


def back_substitute(problem: Problem, point: Point, steps: Steps, dx: Array) -> Point:
    """Take a step of the hand's unknowns and the steps of roots and states that follow (section 6).

    Parameters
    ----------
    problem : Problem
        Chains, measured frames and priors.
    point : Point
        Point at which the step starts.
    steps : Steps
        Normal equations as reduced at that point.
    dx : array, shape (G,)
        Step of the unknowns.

    Returns
    -------
    Point
        Point after the step.

    """
    at = _poses(point)
    rhs = steps.root_rhs + np.tensordot(dx, steps.root_by_x, 1)
    d_root = -np.einsum("jif,jf->if", steps.root_inverse, rhs)
    for branch, part, unknowns in zip(problem.branches, steps.eliminated, steps.unknowns, strict=True):
        of_x = np.broadcast_to(dx[unknowns, None], (len(unknowns), len(point.y)))
        elimination.step_states(branch.states.astype(int), part, np.concatenate([d_root, of_x]), at.y)
    elimination.step_root(d_root, at.root, at.root_mm)
    return Point(point.x + dx, _first(at.y), _first(at.root), _first(at.root_mm))


def pose(problem: Problem, point: Point, steps: int = 40) -> Point:
    """Fit each frame's states and root with x fixed, by Levenberg-Marquardt (section 11).

    Parameters
    ----------
    problem : Problem
        F frames.
    point : Point
        Start; its x is kept.
    steps : int
        Most steps; a frame ends earlier when a step lowers its cost by less than a 10,000th.

    Returns
    -------
    Point
        States (F, S), rad, and roots (F, 3, 3), (F, 3).

    """
    chains, objective, x = _chains(problem), _objective(problem), point.x
    amounts = _amounts(chains, x)
    plan, buffers = forward.condense(chains, amounts), {}
    posed = Point(x, point.y.copy(), point.root.copy(), point.root_mm.copy())
    damping = np.full(len(point.y), _FIRST_DAMPING)
    left, few = np.arange(len(point.y)), min(steps, _FEW_STEPS)
    for most in (few, steps - few):  # the frames that need more steps are gathered, so that no block waits
        going = [left[:0]]
        n_blocks = -(-len(left) // BLOCK_FRAMES) if most else 0
        for rows in np.array_split(left, n_blocks) if n_blocks else ():
            n = len(rows)
            if n not in buffers:
                reached, current = _reached_buffers(problem.branches, n), _residual_buffers(problem, n)
                buffers[n] = reached, current, _posing_buffers(problem, n)
            reached, current, of_block = buffers[n]
            seen = _measured_poses(replace(problem, frames=problem.frames.take(rows)), x, free_x=False)
            at = _poses(posed.take(rows))
            now = derivatives.Evaluation(chains, amounts, at, seen, objective, reached, current)
            dampings = damping[rows]
            going.append(rows[posing.pose(now, plan, most, _LEAST_GAIN, dampings, of_block)])
            posed.y[rows], posed.root[rows], posed.root_mm[rows] = map(_first, at)
            damping[rows] = dampings
        left = np.concatenate(going)
    return posed


@lru_cache(maxsize=64)
def _flat_chains(
    branches: tuple[Branch, ...],
    receivers: tuple[tuple[tuple[int, int], ...], ...],
    shared: tuple[int, ...] = (),
) -> forward.FlatChains:
    """Flatten branches to arrays, with their receivers as pairs (mark in the branch, receiver in frames).

    shared : unknowns that move no chain but affect every receiver, appended to the unknowns of each branch.
    """
    operations = [operation for branch in branches for operation in branch.operations]
    terms = [  # coefficient, unknown, state; -1 for a factor that is omitted
        [(t.coefficient, *(-1 if f is None else f for f in (t.unknown, t.state))) for t in operation.terms]
        for operation in operations
    ]
    first_operation = _from(len(branch.operations) for branch in branches)
    first_mark = _from(len(branch.marks) for branch in branches)
    in_branch = np.repeat(np.arange(len(branches)), np.diff(first_operation))
    flat = np.array([term for parts in terms for term in parts], float).reshape(-1, 3)
    coefficient, (unknown, state) = flat[:, 0].copy(), flat[:, 1:].T.astype(int)
    of_branch = np.repeat(in_branch, [len(parts) for parts in terms])
    measured = [(b, mark, s) for b, parts in enumerate(receivers) for mark, s in parts]
    upstream = [first_operation[b] + np.flatnonzero(branches[b].upstream[mark]) for b, mark, _ in measured]
    terms_from = _from(map(len, terms))
    x_column = _columns(of_branch, unknown, [branch.unknowns for branch in branches])
    y_column = _columns(of_branch, state, [branch.states for branch in branches])
    by_unknown = np.pad(_moves_receiver(upstream, terms_from, x_column), ((0, 0), (0, len(shared))))
    for row, (b, *_) in zip(by_unknown, measured, strict=True):
        row[len(branches[b].unknowns) :][: len(shared)] = True
    return forward.FlatChains(
        plan=_plan(branches, first_operation, first_mark),
        depth=1 + sum(kind == "leave" for branch in branches for kind, *_ in branch.plan),
        rotates=np.array([operation.rotates for operation in operations], bool),
        moves=np.array([any(s >= 0 for *_, s in parts) for parts in terms], bool),
        constant=np.array([operation.constant for operation in operations], float),
        terms=forward.Terms(
            start=terms_from,
            coefficient=coefficient,
            unknown=unknown.copy(),
            state=state.copy(),
            x_column=x_column,
            y_column=y_column,
        ),
        receivers=forward.Receivers(
            mark=np.array([first_mark[b] + mark for b, mark, _ in measured], int),
            number=np.array([s for *_, s in measured], int),
            start=_from(map(len, upstream)),
            operation=np.concatenate([np.zeros(0, int), *upstream]),
            by_state=_moves_receiver(upstream, terms_from, y_column),
            by_unknown=by_unknown,
        ),
        ranges=forward.Ranges(
            receiver_start=_from(map(len, receivers)),
            state_start=_from(len(branch.states) for branch in branches),
            state=np.concatenate([branch.states for branch in branches]).astype(int),
            unknown_start=_from(len(branch.unknowns) + len(shared) for branch in branches),
            unknown=np.concatenate([np.append(branch.unknowns, shared) for branch in branches]).astype(int),
        ),
    )


def _from(lengths: Iterable[int]) -> Index:
    """Return the start of each part, and the end of the last, when parts are concatenated."""
    return np.cumsum([0, *lengths])


def _plan(branches: Sequence[Branch], first_operation: Index, first_mark: Index) -> forward.Plan:
    """Concatenate the plans of all branches, each beginning and ending at the root."""
    steps: list[tuple[int, int, Array]] = []
    for branch, operation, mark in zip(branches, first_operation, first_mark, strict=False):
        steps.append((forward.LEAVE, 0, np.zeros(12)))
        for kind, index, values in branch.plan:
            first = operation if kind in ("rotate", "translate") else mark if kind == "mark" else 0
            constant = np.zeros(12)
            constant[: values.size] = values.ravel()
            steps.append((_KINDS[kind], int(first) + index, constant))
        steps.append((forward.RETURN, 0, np.zeros(12)))
    kinds, places, constants = zip(*steps, strict=True)
    return forward.Plan(np.array(kinds, int), np.array(places, int), np.array(constants))


def _columns(of_branch: Index, index: Index, of_branches: Sequence[Index]) -> Index:
    """Return the column (K,) of each term's factor within its branch, -1 for terms without one."""
    places = [{int(i): column for column, i in enumerate(indices)} for indices in of_branches]
    return np.array([places[b].get(int(i), -1) for b, i in zip(of_branch, index, strict=True)], int)


def _moves_receiver(upstream: Sequence[Index], terms_from: Index, column: Index) -> npt.NDArray[np.bool_]:
    """Return whether each receiver depends on the factor in each column, shape (N, columns)."""
    out = np.zeros((len(upstream), int(column.max(initial=-1)) + 1), bool)
    for row, operations in zip(out, upstream, strict=True):
        for o in operations:
            columns = column[terms_from[o] : terms_from[o + 1]]
            row[columns[columns >= 0]] = True
    return out
