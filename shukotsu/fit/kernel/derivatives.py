"""Residuals of receivers, and their derivatives by states, root and unknowns.

On paper: docs/whole-hand.md, sections 2, 4 and 5.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array
from shukotsu.fit.kernel.compiled import compiled, copy, fill, inner
from shukotsu.fit.kernel.forward import Amounts, BranchPoses, FlatChains, ReachedFrames, Terms

_SMALL = 1e-3

_NO_TURN = 1e-9


class MeasuredPoses(NamedTuple):
    """Measured poses of S receivers, valid (S, F), and their sd (S, 2).

    turned : (S, K, 3, F) derivative of their rotation vectors by the K unknowns of the field.
    """

    rotation: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]
    sd: Array
    turned: Array


class Objective(NamedTuple):
    """Mean (S,) and tempered precision (B, most s, most s) of states; temper and Huber limit of residuals."""

    mean: Array
    precision: Array
    temper: float
    huber: float


class ResidualArrays(NamedTuple):
    """Residuals r (N, 6, F), their robust weights (N, F), and the cost (F,) of residuals and state priors."""

    r: Array
    weight: Array
    cost: Array


class Evaluation(NamedTuple):
    """Chains and measured poses at a point, and the arrays to which `reach` and `residuals` write."""

    chains: FlatChains
    amounts: Amounts
    at: BranchPoses
    seen: MeasuredPoses
    objective: Objective
    reached: ReachedFrames
    current: ResidualArrays


class Derivatives(NamedTuple):
    """Derivatives of a branch's m residuals: by_states (s, m, F), by_rest (6 + g, m, F), root then unknowns.

    With the unknowns fixed, by_rest is (6, m, F), by the root alone.
    """

    by_states: Array
    by_rest: Array


@inner
def _residual(
    rotation: Array, position_mm: Array, seen: Array, seen_mm: Array, sd: Array, f: int, r: Array
) -> None:
    """Write the residuals of one receiver in frame f to r (6, F).

    They are Q^T (p - q) / sd[0] and log(Q^T R) / sd[1] for the model's pose R, p and the measured one Q, q.
    """
    x = position_mm[0, f] - seen_mm[0, f]
    y = position_mm[1, f] - seen_mm[1, f]
    z = position_mm[2, f] - seen_mm[2, f]
    for i in range(3):
        r[i, f] = (seen[0, i, f] * x + seen[1, i, f] * y + seen[2, i, f] * z) / sd[0]
    a = b = c = trace = 0.0
    for k in range(3):
        s0, s1, s2 = seen[k, 0, f], seen[k, 1, f], seen[k, 2, f]
        r0, r1, r2 = rotation[k, 0, f], rotation[k, 1, f], rotation[k, 2, f]
        a += s2 * r1 - s1 * r2
        b += s0 * r2 - s2 * r0
        c += s1 * r0 - s0 * r1
        trace += s0 * r0 + s1 * r1 + s2 * r2
    a, b, c = a / 2, b / 2, c / 2
    sine = math.sqrt(a * a + b * b + c * c)
    factor = 1.0
    if sine > _NO_TURN:
        factor = math.atan2(sine, (trace - 1) / 2) / sine
    r[3, f], r[4, f], r[5, f] = a * factor / sd[1], b * factor / sd[1], c * factor / sd[1]


@compiled
def residuals(evaluation: Evaluation) -> None:
    """Compute residuals r of every receiver (zero if not valid), robust weights, and the cost of each frame.

    The cost is (y - mean)^T precision (y - mean) / 2 plus temper * rho(|r|) for every receiver, rho being
    Huber's loss.
    """
    chains, _, at, seen, objective, reached, out = evaluation
    receivers, ranges = chains.receivers, chains.ranges
    for f in range(len(out.cost)):
        out.cost[f] = 0.0
    for b in range(len(ranges.state_start) - 1):
        states = ranges.state[ranges.state_start[b] : ranges.state_start[b + 1]]
        for i in range(len(states)):
            for j in range(len(states)):
                precision = objective.precision[b, i, j]
                if precision != 0.0:
                    for f in range(len(out.cost)):
                        off = (at.y[states[i], f] - objective.mean[states[i]]) * (
                            at.y[states[j], f] - objective.mean[states[j]]
                        )
                        out.cost[f] += precision * off / 2
    for n in range(len(receivers.mark)):
        mark, s = receivers.mark[n], receivers.number[n]
        r, sd = out.r[n], seen.sd[s]
        for f in range(len(out.cost)):
            if not seen.valid[s, f]:
                for i in range(6):
                    r[i, f] = 0.0
                out.weight[n, f] = 1.0
                continue
            _residual(
                reached.rotation[mark],
                reached.position_mm[mark],
                seen.rotation[s],
                seen.position_mm[s],
                sd,
                f,
                r,
            )
            square = 0.0
            for i in range(6):
                square += r[i, f] * r[i, f]
            norm = math.sqrt(square)
            out.weight[n, f] = min(1.0, objective.huber / max(norm, objective.huber))
            rho = objective.huber * (norm - objective.huber / 2) if norm > objective.huber else square / 2
            out.cost[f] += objective.temper * rho


@inner
def _to_residuals(
    seen: Array, valid: npt.NDArray[np.bool_], r: Array, weight: Array, sd: Array, temper: float
) -> tuple[Array, Array]:
    """Map a receiver's velocity and angular velocity to its weighted residuals, (3, 3, F) each."""
    n = len(weight)
    by_velocity, by_turn = np.empty((3, 3, n)), np.empty((3, 3, n))
    J = np.empty((3, 3))
    for f in range(n):
        scale = math.sqrt(temper * weight[f]) if valid[f] else 0.0
        x, y, z = r[3, f] * sd[1], r[4, f] * sd[1], r[5, f] * sd[1]
        square = x * x + y * y + z * z
        factor = 1 / 12
        if square >= _SMALL**2:
            angle = math.sqrt(square)
            factor = 1 / square - (1 + math.cos(angle)) / (2 * angle * math.sin(angle))
        J[0, 0] = 1 - factor * (y * y + z * z)
        J[0, 1] = z / 2 + factor * x * y
        J[0, 2] = factor * x * z - y / 2
        J[1, 0] = factor * x * y - z / 2
        J[1, 1] = 1 - factor * (x * x + z * z)
        J[1, 2] = x / 2 + factor * y * z
        J[2, 0] = y / 2 + factor * x * z
        J[2, 1] = factor * y * z - x / 2
        J[2, 2] = 1 - factor * (x * x + y * y)
        for i in range(3):
            for j in range(3):
                by_velocity[i, j, f] = seen[j, i, f] * scale / sd[0]
                turn = J[i, 0] * seen[j, 0, f] + J[i, 1] * seen[j, 1, f] + J[i, 2] * seen[j, 2, f]
                by_turn[i, j, f] = turn * scale / sd[1]
    return by_velocity, by_turn


@inner
def _transform(matrix: Array, vector: Array) -> None:
    """Multiply vectors (3, F) by matrices (3, 3, F) in place."""
    for f in range(vector.shape[1]):
        x, y, z = vector[0, f], vector[1, f], vector[2, f]
        vector[0, f] = matrix[0, 0, f] * x + matrix[0, 1, f] * y + matrix[0, 2, f] * z
        vector[1, f] = matrix[1, 0, f] * x + matrix[1, 1, f] * y + matrix[1, 2, f] * z
        vector[2, f] = matrix[2, 0, f] * x + matrix[2, 1, f] * y + matrix[2, 2, f] * z


@inner
def _cross(a: Array, b: Array, c: Array, out: Array) -> None:
    """Compute the cross product a x (b - c) of vectors (3, F)."""
    for f in range(out.shape[1]):
        x, y, z = b[0, f] - c[0, f], b[1, f] - c[1, f], b[2, f] - c[2, f]
        out[0, f] = a[1, f] * z - a[2, f] * y
        out[1, f] = a[2, f] * x - a[0, f] * z
        out[2, f] = a[0, f] * y - a[1, f] * x


@inner
def _add(values: Array, factor: float, out: Array) -> None:
    """Add factor * values, (3, F), to out."""
    for i in range(3):
        for f in range(out.shape[1]):
            out[i, f] += factor * values[i, f]


@inner
def _add_each(values: Array, factor: float, times: Array, out: Array) -> None:
    """Add factor * times * values to out: values (3, F), times (F,)."""
    for i in range(3):
        for f in range(out.shape[1]):
            out[i, f] += factor * times[f] * values[i, f]


@inner
def _by_terms(
    terms: Terms, slope: Array, o: int, y: Array, by: Array, row: int, derivatives: Derivatives
) -> None:
    """Add three rows of derivatives by the amount of operation o, by (3, F), to those by states and unknowns.

    slope : (K,) as in `Amounts`.
    """
    J_y, J = derivatives
    for k in range(terms.start[o], terms.start[o + 1]):
        state, unknown = terms.state[k], terms.unknown[k]
        if state >= 0:
            _add(by, slope[k], J_y[terms.y_column[k], row : row + 3])
        if len(J) > 6 and unknown >= 0:
            out = J[6 + terms.x_column[k], row : row + 3]
            if state >= 0:
                _add_each(by, terms.coefficient[k], y[state], out)
            else:
                _add(by, terms.coefficient[k], out)


@compiled
def jacobian(evaluation: Evaluation, b: int, out: Derivatives) -> None:
    """Compute the derivatives of branch b's residuals, with robust weights and tempering applied.

    A rotation with axis w at o moves a later point p by w x (p - o) and turns its frame by w; a translation
    moves it by w (docs/whole-hand.md, section 2). by_velocity and by_turn convert both to residuals (section
    4).

    Parameters
    ----------
    evaluation : Evaluation
        Chains at a point, with poses and residuals computed.
    b : int
        Index of the branch.
    out : Derivatives
        Output: derivatives of m residuals by s states (s, m, F), and by root and g unknowns (6 + g, m, F).

    """
    chains, amounts, at, seen, objective, reached, current = evaluation
    receivers, start = chains.receivers, chains.ranges.receiver_start
    J_y, J = out
    first, n_receivers = start[b], start[b + 1] - start[b]
    free_x = len(J) > 6
    velocity = np.empty(at.root_mm.shape)
    for column in range(len(J_y)):
        fill(0.0, J_y[column])
    for column in range(len(J)):
        fill(0.0, J[column])
    for i in range(n_receivers):
        n, row = first + i, 6 * i
        top, low = slice(row, row + 3), slice(row + 3, row + 6)
        position_mm = reached.position_mm[receivers.mark[n]]
        for u in range(receivers.start[n], receivers.start[n + 1]):
            o = receivers.operation[u]
            if not (free_x or chains.moves[o]):
                continue
            axis = reached.axis[o]
            if chains.rotates[o]:
                _cross(axis, position_mm, reached.origin_mm[o], velocity)
                _by_terms(chains.terms, amounts.slope, o, at.y, velocity, row, out)
                _by_terms(chains.terms, amounts.slope, o, at.y, axis, row + 3, out)
            else:
                _by_terms(chains.terms, amounts.slope, o, at.y, axis, row, out)
        for k in range(3):
            for j in range(3):
                for f in range(J.shape[2]):
                    J[k, row + j, f] = J[3 + k, row + 3 + j, f] = at.root[j, k, f]
            _cross(J[k, top], position_mm, at.root_mm, J[3 + k, top])
        s = receivers.number[n]
        if free_x:
            n_turned = seen.turned.shape[1]
            for k in range(n_turned):
                copy(seen.turned[s, k], J[len(J) - n_turned + k, low])
        by_velocity, by_turn = _to_residuals(
            seen.rotation[s], seen.valid[s], current.r[n], current.weight[n], seen.sd[s], objective.temper
        )
        for column in range(len(J_y)):
            if receivers.by_state[n, column]:
                _transform(by_velocity, J_y[column, top])
                _transform(by_turn, J_y[column, low])
        for column in range(len(J)):
            if column < 6 or receivers.by_unknown[n, column - 6]:
                _transform(by_velocity, J[column, top])
                _transform(by_turn, J[column, low])
