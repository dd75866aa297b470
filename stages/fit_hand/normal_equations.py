"""Least squares over a whole hand: residuals, robust weights, steps with every frame's unknowns eliminated.

Unknowns of the hand (x, prior variance 1 over `precision`), states of every frame (y, weak priors) and its
root pose. A frame's states enter only the receivers of their own branch, so that branch by branch they are
eliminated first, then the root, then what is left is one dense system in x (Schur complement).

In NumPy, for whoever wants to read or to test; what runs is compiled (`compiled_equations`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from skeleton.rotations import Array, cross_matrix, exp_rotation
from stages.fit_hand.operations import Branch, Index, Reached, cross
from stages.fit_hand.room_field import RoomField

Rows = Index | npt.NDArray[np.bool_] | slice

HUBER = 3.55
"""Norm of a receiver's six residuals, over their sd, beyond which they count less: 95 % of normal ones."""


@dataclass(frozen=True)
class Frames:
    """Measured poses of S receivers: rotation (F, S, 3, 3), position_mm (F, S, 3), valid (F, S)."""

    rotation: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]

    def take(self, rows: Rows) -> Frames:
        """Give some of the frames."""
        return Frames(self.rotation[rows], self.position_mm[rows], self.valid[rows])


@dataclass(frozen=True)
class Point:
    """Values of all unknowns: x (G,), y (F, S), root (F, 3, 3), root_mm (F, 3)."""

    x: Array
    y: Array
    root: Array
    root_mm: Array

    def take(self, rows: Rows) -> Point:
        """Give some of the frames."""
        return Point(self.x, self.y[rows], self.root[rows], self.root_mm[rows])


@dataclass(frozen=True)
class Observations:
    """Measured linear combinations of x: rows @ x = values, in units of their sd; (K, G), (K,)."""

    rows: Array
    values: Array

    @classmethod
    def of(cls, rows: Sequence[Array], values: Sequence[float], n_unknowns: int) -> Observations:
        """Give observations of one row (G,) each."""
        return cls(np.array(rows).reshape(-1, n_unknowns), np.array(values))

    def and_also(self, others: Observations) -> Observations:
        """Give these observations and others."""
        return Observations(
            np.concatenate([self.rows, others.rows]), np.concatenate([self.values, others.values])
        )


@dataclass(frozen=True)
class Problem:
    """What is fitted to what.

    receivers : per branch, pairs (mark in the branch, receiver in frames). sd : (S, 2) of a receiver's
    position (mm) and rotation (rad) per component. temper : independent samples per frame.
    state_mean, state_sd : (S,) in rad. precision : (G,) of the prior of x. state_link : (S, S) that takes
    states less their means to what has that sd, where one is expected to follow another in its branch.
    field : what turns receivers in the room, if that is fitted.
    """

    branches: tuple[Branch, ...]
    receivers: tuple[tuple[tuple[int, int], ...], ...]
    frames: Frames
    sd: Array
    temper: float
    state_mean: Array
    state_sd: Array
    precision: Array
    observations: Observations
    state_link: Array | None = None
    field: RoomField | None = None

    def unknowns_of(self, index: int) -> Index:
        """Indices into x of what moves the receivers of a branch, or how they are measured."""
        own = self.branches[index].unknowns
        return own if self.field is None else np.concatenate([own, self.field.unknowns])

    def rotation(self, x: Array) -> Array:
        """Rotations (F, S, 3, 3) of the receivers, the field's turn undone."""
        if self.field is None:
            return self.frames.rotation
        return self.field.undone(self.frames.rotation, self.frames.position_mm, x)

    def back_to(self, s: int, x: Array) -> Array:
        """Rotations (F, 3, 3) from the transmitter's frame to a receiver's own, the field's turn undone."""
        return np.swapaxes(self.rotation(x)[:, s], -1, -2)

    def state_prior(self, states: Index | slice = slice(None)) -> Array:
        """Square root (s, s) of the precision of those states' priors."""
        link = np.eye(len(self.state_sd)) if self.state_link is None else self.state_link
        return np.asarray((link / self.state_sd[:, None])[states][:, states])


class BranchResiduals(NamedTuple):
    """One branch's residuals (receivers, F, 6) over their sd, position before rotation and zero where not
    valid; their robust weights (receivers, F); and where the chain reached.
    """

    r: Array
    weight: Array
    reached: Reached


@dataclass(frozen=True)
class Residuals:
    """Residuals at a point, by branch; the cost, and each frame's part (F,) of it.

    Residuals are in the measured receiver's own frame, wherever the transmitter is.
    """

    branches: tuple[BranchResiduals, ...]
    cost: float
    frame_cost: Array


def axial_vector(rotation: Array) -> Array:
    """Twice the axis times the sine of the angle, (..., 3), of rotation matrices (..., 3, 3)."""
    return np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ],
        -1,
    )


def log_rotation(rotation: Array) -> Array:
    """Rotation vectors (..., 3) of rotation matrices, accurate for small ones, fit up to nearly pi."""
    v = axial_vector(rotation) / 2
    sine = np.linalg.norm(v, axis=-1)
    cosine = (np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    return np.asarray(v * factor[..., None])


def _inverse_left_jacobian(vector: Array) -> Array:
    """How a rotation vector changes with a small turn applied on the left, (..., 3, 3)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    K = cross_matrix(vector)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    factor = np.where(small, 1 / 12, 1 / safe**2 - (1 + np.cos(safe)) / (2 * safe * np.sin(safe)))
    return np.asarray(np.eye(3) - K / 2 + factor * (K @ K))


def residuals(problem: Problem, point: Point) -> Residuals:
    """Residuals of every receiver and the cost: half the tempered robust squares, the priors' included."""
    parts, rotation = [], problem.rotation(point.x)
    y_off = (point.y - problem.state_mean) @ problem.state_prior().T
    frame_cost = problem.temper * (y_off**2).sum(1) / 2
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        reached = branch.reach(point.x, point.y, point.root, point.root_mm)
        r = np.zeros((len(receivers), len(point.y), 6))
        for i, (mark, s) in enumerate(receivers):
            ok = problem.frames.valid[:, s]
            off = reached.position_mm[mark] - problem.frames.position_mm[:, s]
            back = np.swapaxes(rotation[:, s], -1, -2)
            off, turn = (back @ off[..., None])[..., 0], back @ reached.rotation[mark]
            r[i, :, :3] = np.where(ok[:, None], off / problem.sd[s, 0], 0.0)
            r[i, :, 3:] = np.where(ok[:, None], log_rotation(turn) / problem.sd[s, 1], 0.0)
        norm = np.linalg.norm(r, axis=-1)
        weight = np.minimum(1.0, HUBER / np.maximum(norm, HUBER))
        rho = np.where(norm > HUBER, HUBER * norm - HUBER**2 / 2, norm**2 / 2)
        frame_cost = frame_cost + problem.temper * rho.sum(0)
        parts.append(BranchResiduals(r, weight, reached))
    off_rows = problem.observations.rows @ point.x - problem.observations.values
    cost = frame_cost.sum() + (problem.precision * point.x**2).sum() / 2 + (off_rows**2).sum() / 2
    return Residuals(tuple(parts), float(cost), frame_cost)


def weighted_jacobian(
    problem: Problem,
    index: int,
    part: BranchResiduals,
    point: Point,
    which: Index | None = None,
) -> tuple[Array, Array, Array]:
    """One branch's residuals (F, m) with robust weights and tempering in, and their derivatives by the
    operations' amounts (F, m, O) and by the root (F, m, 6); which : operations, all where None.
    """
    r, weight, reached = part
    receivers = problem.receivers[index]
    raw = problem.branches[index].by_operation(reached, [mark for mark, _ in receivers], which)
    root = np.zeros((len(receivers), len(point.y), 6, 6))
    for i, (mark, s) in enumerate(receivers):
        arm = reached.position_mm[mark] - point.root_mm
        root[i, :, :3, :3] = point.root
        root[i, :, :3, 3:] = cross(point.root.swapaxes(-1, -2), arm[:, None]).swapaxes(-1, -2)
        root[i, :, 3:, 3:] = point.root
        back = problem.back_to(s, point.x)
        spin = _inverse_left_jacobian(r[i, :, 3:] * problem.sd[s, 1]) @ back
        scale = np.sqrt(problem.temper * weight[i]) * problem.frames.valid[:, s]
        for block in (raw[i], root[i]):
            block[:, :3] = (back @ block[:, :3]) * (scale / problem.sd[s, 0])[:, None, None]
            block[:, 3:] = (spin @ block[:, 3:]) * (scale / problem.sd[s, 1])[:, None, None]
    weighted = r * np.sqrt(problem.temper * weight)[..., None]
    n_frames = len(point.y)
    rows = 6 * len(receivers)
    return (
        weighted.transpose(1, 0, 2).reshape(n_frames, rows),
        raw.transpose(1, 0, 2, 3).reshape(n_frames, rows, raw.shape[-1]),
        root.transpose(1, 0, 2, 3).reshape(n_frames, rows, 6),
    )


def by_unknowns(
    problem: Problem, index: int, part: BranchResiduals, point: Point, by_operation: Array
) -> Array:
    """Derivative (F, m, g) of one branch's weighted residuals by the unknowns `Problem.unknowns_of` it."""
    by_chain = problem.branches[index].by_unknown(by_operation, point.y)
    if problem.field is None:
        return by_chain
    receivers = problem.receivers[index]
    by_field = np.zeros((len(point.y), len(receivers), 6, len(problem.field.unknowns)))
    for i, (_, s) in enumerate(receivers):
        spin = _inverse_left_jacobian(part.r[i, :, 3:] * problem.sd[s, 1]) @ problem.back_to(s, point.x)
        scale = np.sqrt(problem.temper * part.weight[i]) * problem.frames.valid[:, s] / problem.sd[s, 1]
        turned = problem.field.by_unknown(problem.frames.position_mm[:, s])
        by_field[:, i, 3:] = (spin @ turned) * scale[:, None, None]
    return np.concatenate([by_chain, by_field.reshape(*by_chain.shape[:2], -1)], -1)


@dataclass(frozen=True)
class Elimination:
    """One branch's states eliminated: y = -inverse_root^T (rhs + by_rest @ (root, x)).

    inverse : (F, s, s) inverse Cholesky factor L^-1; by_rest : (F, s, 6 + g) L^-1 B; rhs : (F, s) L^-1 b;
    unknowns : (g,) indices into x.
    """

    inverse: Array
    by_rest: Array
    rhs: Array
    unknowns: Index


@dataclass(frozen=True)
class Reduced:
    """Normal equations with all states and roots eliminated.

    matrix : (G, G), gradient : (G,). root_inverse : (F, 6, 6), root_by_x : (F, 6, G), root_rhs : (F, 6).
    """

    matrix: Array
    gradient: Array
    root_inverse: Array
    root_by_x: Array
    root_rhs: Array
    eliminated: tuple[Elimination, ...]


def _inverse_cholesky(matrix: Array) -> Array:
    lower = np.linalg.cholesky(matrix)
    return np.asarray(np.linalg.solve(lower, np.broadcast_to(np.eye(matrix.shape[-1]), matrix.shape)))


def _eliminate(
    problem: Problem,
    index: int,
    part: BranchResiduals,
    point: Point,
    damping: Array,
    *,
    fixed_x: bool,
) -> tuple[Elimination, Array, Array]:
    """Eliminate one branch's states; give also its derivatives by root and x (F, m, 6 + g) and its residuals
    (F, m).
    """
    branch = problem.branches[index]
    which = branch.moving if fixed_x else None
    r, by_operation, by_root = weighted_jacobian(problem, index, part, point, which)
    states, per_state = branch.states, branch.per_state(point.x)
    J_y = by_operation @ (per_state if which is None else per_state[which])
    J = by_root
    if not fixed_x:
        J = np.concatenate([by_root, by_unknowns(problem, index, part, point, by_operation)], -1)
    root = problem.state_prior(states)
    prior = problem.temper * root.T @ root
    A = J_y.swapaxes(-1, -2) @ J_y + prior
    A[:, range(len(states)), range(len(states))] *= 1 + damping[:, None]
    b = (J_y * r[..., None]).sum(1) + (point.y[:, states] - problem.state_mean[states]) @ prior
    inverse = _inverse_cholesky(A)
    Z = inverse @ (J_y.swapaxes(-1, -2) @ J)
    gone = Elimination(inverse, Z, (inverse @ b[..., None])[..., 0], problem.unknowns_of(index))
    return gone, J, r


def reduce(
    problem: Problem, point: Point, current: Residuals, damping: Array, *, fixed_x: bool = False
) -> Reduced:
    """Set up the normal equations and eliminate states and roots.

    current : the residuals at the point. damping : (F,) Marquardt's, relative to the diagonal. fixed_x :
    leave x out (posing).
    """
    n_frames, G = len(point.y), 0 if fixed_x else len(point.x)
    matrix, gradient = np.zeros((G, G)), np.zeros(G)
    H_rr = np.zeros((n_frames, 6, 6))
    H_rx = np.zeros((n_frames, 6, G))
    g_r = np.zeros((n_frames, 6))
    eliminated = []
    for index, part in enumerate(current.branches):
        part_of_branch, J, r = _eliminate(problem, index, part, point, damping, fixed_x=fixed_x)
        eliminated.append(part_of_branch)
        Z, z = part_of_branch.by_rest, part_of_branch.rhs
        J_r = J[..., :6]
        Z_r = Z[..., :6]
        H_rr += J_r.swapaxes(-1, -2) @ J_r - Z_r.swapaxes(-1, -2) @ Z_r
        g_r += (J_r * r[..., None]).sum(1) - (Z_r * z[..., None]).sum(1)
        if not fixed_x:
            own = part_of_branch.unknowns
            J_x, Z_x = J[..., 6:], Z[..., 6:]
            H_rx[:, :, own] += J_r.swapaxes(-1, -2) @ J_x - Z_r.swapaxes(-1, -2) @ Z_x
            flat = J_x.reshape(n_frames * J_x.shape[1], len(own))
            flat_z = Z_x.reshape(n_frames * Z_x.shape[1], len(own))
            matrix[np.ix_(own, own)] += flat.T @ flat - flat_z.T @ flat_z
            gradient[own] += flat.T @ r.ravel() - flat_z.T @ z.ravel()
    H_rr[:, range(6), range(6)] = H_rr[:, range(6), range(6)] * (1 + damping[:, None]) + 1e-9
    inverse = _inverse_cholesky(H_rr)
    Z = inverse @ H_rx
    z = (inverse @ g_r[..., None])[..., 0]
    if not fixed_x:
        flat = Z.reshape(-1, G)
        rows = problem.observations.rows
        matrix += np.diag(problem.precision) + rows.T @ rows - flat.T @ flat
        gradient += problem.precision * point.x + rows.T @ (rows @ point.x - problem.observations.values)
        gradient -= flat.T @ z.ravel()
    return Reduced(matrix, gradient, inverse, Z, z, tuple(eliminated))


def back_substitute(problem: Problem, point: Point, reduced: Reduced, dx: Array | None) -> Point:
    """The point after a step dx (None: x stays) and the steps of roots and states that go with it."""
    rhs = reduced.root_rhs if dx is None else reduced.root_rhs + reduced.root_by_x @ dx
    d_root = -(reduced.root_inverse.swapaxes(-1, -2) @ rhs[..., None])[..., 0]
    y = point.y.copy()
    for branch, part in zip(problem.branches, reduced.eliminated, strict=True):
        own = d_root
        if dx is not None:
            of_branch = np.broadcast_to(dx[part.unknowns], (len(y), len(part.unknowns)))
            own = np.concatenate([d_root, of_branch], -1)
        inner = part.rhs + (part.by_rest @ own[..., None])[..., 0]
        y[:, branch.states] -= (part.inverse.swapaxes(-1, -2) @ inner[..., None])[..., 0]
    return Point(
        point.x if dx is None else point.x + dx,
        y,
        point.root @ exp_rotation(d_root[:, 3:]),
        point.root_mm + (point.root @ d_root[:, :3, None])[..., 0],
    )


def states_by_unknowns(problem: Problem, reduced: Reduced, weights: Array) -> Array:
    """Derivative (S, G) of the weighted mean of the states over frames, as the unknowns of the hand move."""
    G = reduced.matrix.shape[0]
    d_root = -(reduced.root_inverse.swapaxes(-1, -2) @ reduced.root_by_x)
    out = np.zeros((len(problem.state_mean), G))
    for branch, part in zip(problem.branches, reduced.eliminated, strict=True):
        back = part.inverse.swapaxes(-1, -2) * weights[:, None, None]
        by_root = part.by_rest[..., :6]
        out[branch.states] -= np.einsum("fst,ftg->sg", back @ by_root, d_root, optimize=True)
        out[np.ix_(branch.states, part.unknowns)] -= (back @ part.by_rest[..., 6:]).sum(0)
    return out


def pairs(branches: Sequence[Branch], names: Sequence[str]) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Per branch the marks that are receivers, with their places in `names`."""
    known = {f"receiver {name}": i for i, name in enumerate(names)}
    return tuple(
        tuple((mark, known[name]) for mark, name in enumerate(branch.marks) if name in known)
        for branch in branches
    )
