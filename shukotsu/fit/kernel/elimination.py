"""Block elimination of states and roots from the normal equations, and back substitution.

On paper: docs/whole-hand.md, section 6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array
from shukotsu.fit.kernel.compiled import compiled, fill, inner
from shukotsu.fit.kernel.derivatives import Derivatives, Evaluation
from shukotsu.fit.kernel.forward import FlatChains

_SOME_ROOT = 1e-9
"""Precision that keeps the equations of a root solvable in frames in which no receiver is valid."""


class EliminatedStates(NamedTuple):
    """A branch's `Elimination` with frames last: inverse (s, s, F), by_rest (6 + g, s, F), rhs (s, F)."""

    inverse: Array
    by_rest: Array
    rhs: Array


class RootEquations(NamedTuple):
    """Normal equations of roots: H_rr (6, 6, F), mixed part with x H_xr (G, 6, F), gradient g_r (6, F)."""

    H_rr: Array
    H_xr: Array
    g_r: Array


@inner
def _add_product(a: Array, b: Array, rows: slice, factor: float, out: Array) -> None:
    """Add factor * the sum of a[k] * b[k] over rows k to out (F,); a, b : (m, F)."""
    for k in range(rows.start, rows.stop):
        for f in range(len(out)):
            out[f] += factor * a[k, f] * b[k, f]


@inner
def _inverse_cholesky(A: Array, inverse: Array) -> None:
    """Compute inverses of the lower Cholesky factors of A (n, n, F); lower triangles of A are overwritten."""
    n, n_frames = len(A), A.shape[2]
    for j in range(n):
        fill(0.0, inverse[j])
        for i in range(j, n):
            for k in range(j):
                for f in range(n_frames):
                    A[i, j, f] -= A[i, k, f] * A[j, k, f]
            if i == j:
                for f in range(n_frames):
                    inverse[j, j, f] = 1.0 / math.sqrt(A[j, j, f])
            for f in range(n_frames):
                A[i, j, f] *= inverse[j, j, f]
    for i in range(n):
        for j in range(i):
            for k in range(j, i):
                for f in range(n_frames):
                    inverse[i, j, f] -= A[i, k, f] * inverse[k, j, f]
            for f in range(n_frames):
                inverse[i, j, f] *= inverse[i, i, f]


@inner
def by_lower(inverse: Array, B: Array, out: Array) -> None:
    """Multiply vectors by lower triangular matrices.

    Parameters
    ----------
    inverse : array, shape (n, n, F)
        Inverse Cholesky factors, lower triangular, of F frames.
    B : array, shape (n, F)
        Vectors.
    out : array, shape (n, F)
        Output.

    """
    fill(0.0, out)
    for i in range(len(inverse)):
        for j in range(i + 1):
            for f in range(out.shape[1]):
                out[i, f] += inverse[i, j, f] * B[j, f]


@compiled
def eliminate(
    evaluation: Evaluation, b: int, derivatives: Derivatives, damping: Array, out: EliminatedStates
) -> Array:
    """Eliminate branch b's states from its normal equations (section 6).

    The results are L^-1, L^-1 J_y^T J and L^-1 g_y, with L L^T = J_y^T J_y + precision, damped on the
    diagonal.

    Parameters
    ----------
    evaluation : Evaluation
        Chains at a point, with residuals computed.
    b : int
        Index of the branch.
    derivatives : Derivatives
        Derivatives of the branch, as `jacobian` writes them.
    damping : array, shape (F,)
        Share of the diagonal that is added to it in each frame (Marquardt).
    out : EliminatedStates
        Output: L^-1 (s, s, F), L^-1 J_y^T J (6 + g, s, F) and L^-1 g_y (s, F).

    Returns
    -------
    array, shape (m, F)
        Residuals of the branch, with robust weights and tempering applied.

    """
    chains, _, at, _, objective, _, current = evaluation
    receivers, ranges = chains.receivers, chains.ranges
    J_y, J = derivatives
    first, last = ranges.receiver_start[b], ranges.receiver_start[b + 1]
    states = ranges.state[ranges.state_start[b] : ranges.state_start[b + 1]]
    n_states, n_frames = len(J_y), J_y.shape[2]
    r = np.empty((6 * (last - first), n_frames))
    A, B = np.zeros((n_states, n_states, n_frames)), np.zeros((n_states, n_frames))
    for i in range(last - first):
        for k in range(6):
            for f in range(n_frames):
                r[6 * i + k, f] = current.r[first + i, k, f] * math.sqrt(
                    objective.temper * current.weight[first + i, f]
                )
    for i in range(n_states):
        for j in range(n_states):
            precision = objective.precision[b, i, j]
            if precision != 0.0:
                for f in range(n_frames):
                    A[i, j, f] = precision
                    B[i, f] += precision * (at.y[states[j], f] - objective.mean[states[j]])
        for n in range(first, last):
            rows = slice(6 * (n - first), 6 * (n - first) + 6)
            if receivers.by_state[n, i]:
                _add_product(J_y[i], r, rows, 1.0, B[i])
                for j in range(i + 1):
                    if receivers.by_state[n, j]:
                        _add_product(J_y[i], J_y[j], rows, 1.0, A[i, j])
        for f in range(n_frames):
            A[i, i, f] *= 1.0 + damping[f]
    _inverse_cholesky(A, out.inverse)
    by_lower(out.inverse, B, out.rhs)
    for column in range(len(J)):
        fill(0.0, B)
        for n in range(first, last):
            if column < 6 or receivers.by_unknown[n, column - 6]:
                rows = slice(6 * (n - first), 6 * (n - first) + 6)
                for i in range(n_states):
                    if receivers.by_state[n, i]:
                        _add_product(J_y[i], J[column], rows, 1.0, B[i])
        by_lower(out.inverse, B, out.by_rest[column])
    return r


@compiled
def add_to_root(
    chains: FlatChains, b: int, J: Array, r: Array, part: EliminatedStates, root: RootEquations
) -> None:
    """Add branch b to the normal equations of roots after eliminating its states.

    Parameters
    ----------
    chains : FlatChains
        All branches.
    b : int
        Index of the branch.
    J : array, shape (6 + g, m, F)
        Derivatives by root and unknowns.
    r : array, shape (m, F)
        Weighted residuals.
    part : EliminatedStates
        Elimination of the branch's states.
    root : RootEquations
        Normal equations of roots, changed in place.

    """
    H_rr, H_xr, g_r = root
    ranges, by_unknown = chains.ranges, chains.receivers.by_unknown
    first, last = ranges.receiver_start[b], ranges.receiver_start[b + 1]
    unknowns = ranges.unknown[ranges.unknown_start[b] : ranges.unknown_start[b + 1]]
    every, states = slice(0, len(r)), slice(0, len(part.rhs))
    for i in range(6):
        _add_product(J[i], r, every, 1.0, g_r[i])
        _add_product(part.by_rest[i], part.rhs, states, -1.0, g_r[i])
        for j in range(i + 1):
            _add_product(J[i], J[j], every, 1.0, H_rr[i, j])
            _add_product(part.by_rest[i], part.by_rest[j], states, -1.0, H_rr[i, j])
        for column in range(6, len(J)):
            out = H_xr[unknowns[column - 6], i]
            for n in range(first, last):
                if by_unknown[n, column - 6]:
                    _add_product(J[i], J[column], slice(6 * (n - first), 6 * (n - first) + 6), 1.0, out)
            _add_product(part.by_rest[i], part.by_rest[column], states, -1.0, out)


@inner
def solve_root(root: RootEquations, damping: Array, inverse: Array, rhs: Array) -> None:
    """Eliminate the roots of all frames from their normal equations (section 6).

    Parameters
    ----------
    root : RootEquations
        Normal equations; the diagonal of H_rr is damped in place.
    damping : array, shape (F,)
        Share of the diagonal that is added to it in each frame (Marquardt).
    inverse : array, shape (6, 6, F)
        Output: inverse Cholesky factors.
    rhs : array, shape (6, F)
        Output: the same times the gradient.

    """
    H_rr, _, g_r = root
    for i in range(6):
        for f in range(len(damping)):
            H_rr[i, i, f] = H_rr[i, i, f] * (1.0 + damping[f]) + _SOME_ROOT
    _inverse_cholesky(H_rr, inverse)
    by_lower(inverse, g_r, rhs)


@compiled
def reduce_roots(root: RootEquations, damping: Array, inverse: Array, rhs: Array, by_x: Array) -> None:
    """Eliminate the roots of all frames, including their coupling to the hand's unknowns (section 6).

    Parameters
    ----------
    root : RootEquations
        Normal equations; the diagonal of H_rr is damped in place.
    damping : array, shape (F,)
        Share of the diagonal that is added to it in each frame (Marquardt).
    inverse, rhs : array, shape (6, 6, F) and (6, F)
        Output of `solve_root`.
    by_x : array, shape (G, 6, F)
        Output: the inverse factors times H_xr.

    """
    solve_root(root, damping, inverse, rhs)
    for g in range(len(by_x)):
        by_lower(inverse, root.H_xr[g], by_x[g])


@inner
def by_upper(inverse: Array, B: Array, out: Array) -> None:
    """Multiply vectors by the transposes of lower triangular matrices.

    Parameters
    ----------
    inverse : array, shape (n, n, F)
        Inverse Cholesky factors, lower triangular, of F frames.
    B : array, shape (n, F)
        Vectors.
    out : array, shape (n, F)
        Output.

    """
    fill(0.0, out)
    for i in range(len(inverse)):
        for j in range(i, len(inverse)):
            for f in range(out.shape[1]):
                out[i, f] += inverse[j, i, f] * B[j, f]


@compiled
def step_states(states: npt.NDArray[np.int64], part: EliminatedStates, rest: Array, y: Array) -> None:
    """Take the step of a branch's states that follows from a step of root and unknowns.

    Parameters
    ----------
    states : array of int, shape (s,)
        Indices of the branch's states.
    part : EliminatedStates
        Elimination of the branch's states.
    rest : array, shape (6 + g, F)
        Step of the root, mm and rad, and of the unknowns.
    y : array, shape (S, F)
        Joint angles, rad, changed in place.

    """
    rhs, step = part.rhs.copy(), np.empty(part.rhs.shape)
    for column in range(len(rest)):
        for i in range(len(rhs)):
            for f in range(rhs.shape[1]):
                rhs[i, f] += part.by_rest[column, i, f] * rest[column, f]
    by_upper(part.inverse, rhs, step)
    for i in range(len(states)):
        for f in range(rhs.shape[1]):
            y[states[i], f] -= step[i, f]


@compiled
def step_root(d_root: Array, root: Array, root_mm: Array) -> None:
    """Move the roots of all frames: a translation, and a rotation by Rodrigues' formula.

    Parameters
    ----------
    d_root : array, shape (6, F)
        Step, mm and rotation vector (rad), in the root's own axes.
    root, root_mm : array, shape (3, 3, F) and (3, F)
        Poses of the root, changed in place.

    """
    E, row = np.empty((3, 3)), np.empty(3)
    for f in range(d_root.shape[1]):
        for i in range(3):
            for k in range(3):
                root_mm[i, f] += root[i, k, f] * d_root[k, f]
        x, y, z = d_root[3, f], d_root[4, f], d_root[5, f]
        square = x * x + y * y + z * z
        angle = math.sqrt(square)
        once, twice = 1.0, 0.5
        if angle > 0.0:
            once, twice = math.sin(angle) / angle, 2.0 * (math.sin(angle / 2) / angle) ** 2
        E[0, 0] = 1 - twice * (square - x * x)
        E[0, 1] = twice * x * y - once * z
        E[0, 2] = twice * x * z + once * y
        E[1, 0] = twice * x * y + once * z
        E[1, 1] = 1 - twice * (square - y * y)
        E[1, 2] = twice * y * z - once * x
        E[2, 0] = twice * x * z - once * y
        E[2, 1] = twice * y * z + once * x
        E[2, 2] = 1 - twice * (square - z * z)
        for i in range(3):
            for k in range(3):
                row[k] = root[i, 0, f] * E[0, k] + root[i, 1, f] * E[1, k] + root[i, 2, f] * E[2, k]
            for k in range(3):
                root[i, k, f] = row[k]
