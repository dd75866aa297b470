"""Forward kinematics: from the root through all operations to the marks of bones and receivers.

On paper: docs/whole-hand.md, section 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Index
from shukotsu.fit.kernel.compiled import compiled, copy, copy_matrices, inner

ROTATE, TRANSLATE, MOVE, MARK, LEAVE, RETURN = range(6)
"""Kinds of a plan's steps."""


class Plan(NamedTuple):
    """P steps: kind (P,), index of the operation or mark (P,), and constant axis or pose (P, 12)."""

    kind: Index
    number: Index
    constant: Array


class Terms(NamedTuple):
    """K terms of O operations' amounts: coefficient * x[unknown] * y[state].

    start : (O + 1,) index at which an operation's terms begin. unknown, state : (K,) indices, -1 for a term
    without that factor. x_column, y_column : (K,) their columns in the derivatives of their branch.
    """

    start: Index
    coefficient: Array
    unknown: Index
    state: Index
    x_column: Index
    y_column: Index


class Receivers(NamedTuple):
    """N measured receivers: mark in the chains (N,) and index in the recording (N,).

    operation : indices of the operations that move the receivers; start : (N + 1,) index at which those of a
    receiver begin. by_state : (N, most s), by_unknown : (N, most g) whether it depends on that column's state
    or unknown.
    """

    mark: Index
    number: Index
    start: Index
    operation: Index
    by_state: npt.NDArray[np.bool_]
    by_unknown: npt.NDArray[np.bool_]


class Ranges(NamedTuple):
    """Receivers, states and unknowns of all B branches, concatenated.

    receiver_start, state_start, unknown_start : (B + 1,) where each branch's part begins. state : indices
    into y. unknown : indices into x.
    """

    receiver_start: Index
    state_start: Index
    state: Index
    unknown_start: Index
    unknown: Index


class FlatChains(NamedTuple):
    """All branches, with O operations and M marks that are numbered consecutively.

    depth : greatest nesting of side branches. rotates, moves : (O,) whether an operation rotates, and whether
    it depends on states. constant : (O,) constant part of its amount.
    """

    plan: Plan
    depth: int
    rotates: npt.NDArray[np.bool_]
    moves: npt.NDArray[np.bool_]
    constant: Array
    terms: Terms
    receivers: Receivers
    ranges: Ranges


class Amounts(NamedTuple):
    """Amounts of operations at a given x: steady part (O,), and slope (K,) of each term by its state."""

    steady: Array
    slope: Array


class BranchPoses(NamedTuple):
    """Joint angles y (S, F) and root poses: root (3, 3, F), root_mm (3, F)."""

    y: Array
    root: Array
    root_mm: Array


class ReachedFrames(NamedTuple):
    """Results of `reach`: axis, origin_mm (O, 3, F), rotation (M, 3, 3, F), position_mm (M, 3, F)."""

    axis: Array
    origin_mm: Array
    rotation: Array
    position_mm: Array


@inner
def _rotate(R: Array, constant: Array, angle: Array, axis: Array) -> None:
    """Rotate R about a constant axis, and write that axis in the root's frame to axis (3, F)."""
    a, b, c = constant[0], constant[1], constant[2]
    n = R.shape[2]
    sine, versine = np.empty(n), np.empty(n)
    for f in range(n):
        sine[f] = math.sin(angle[f])
        versine[f] = 1.0 - math.cos(angle[f])
    for i in range(3):
        for f in range(n):
            x, y, z = R[i, 0, f], R[i, 1, f], R[i, 2, f]
            along = a * x + b * y + c * z
            s, v = sine[f], versine[f]
            axis[i, f] = along
            R[i, 0, f] = x - s * (b * z - c * y) + v * (along * a - x)
            R[i, 1, f] = y - s * (c * x - a * z) + v * (along * b - y)
            R[i, 2, f] = z - s * (a * y - b * x) + v * (along * c - z)


@inner
def _translate(R: Array, t: Array, constant: Array, distance: Array, axis: Array) -> None:
    """Translate t along a constant axis, and write that axis in the root's frame to axis (3, F)."""
    a, b, c = constant[0], constant[1], constant[2]
    for i in range(3):
        for f in range(R.shape[2]):
            along = a * R[i, 0, f] + b * R[i, 1, f] + c * R[i, 2, f]
            axis[i, f] = along
            t[i, f] += along * distance[f]


@inner
def _move(R: Array, t: Array, constant: Array) -> None:
    """Move by a constant pose (12,): rotation row by row, translation."""
    p, q, r = constant[9], constant[10], constant[11]
    for i in range(3):
        for f in range(R.shape[2]):
            x, y, z = R[i, 0, f], R[i, 1, f], R[i, 2, f]
            t[i, f] += x * p + y * q + z * r
            R[i, 0, f] = x * constant[0] + y * constant[3] + z * constant[6]
            R[i, 1, f] = x * constant[1] + y * constant[4] + z * constant[7]
            R[i, 2, f] = x * constant[2] + y * constant[5] + z * constant[8]


@inner
def _amount(terms: Terms, amounts: Amounts, o: int, y: Array, out: Array) -> None:
    """Compute the amount (F,) of operation o."""
    for f in range(len(out)):
        out[f] = amounts.steady[o]
    for k in range(terms.start[o], terms.start[o + 1]):
        state = terms.state[k]
        if state >= 0:
            for f in range(len(out)):
                out[f] += amounts.slope[k] * y[state, f]


@compiled
def reach(chains: FlatChains, plan: Plan, amounts: Amounts, at: BranchPoses, reached: ReachedFrames) -> None:
    """Compute the pose of every mark, and the axis and origin of every operation."""
    R, t = at.root.copy(), at.root_mm.copy()
    left_R = np.empty((chains.depth, *R.shape))
    left_t = np.empty((chains.depth, *t.shape))
    amount = np.empty(R.shape[2])
    depth = 0
    for step in range(len(plan.kind)):
        kind, number, constant = plan.kind[step], plan.number[step], plan.constant[step]
        if kind == ROTATE:
            _amount(chains.terms, amounts, number, at.y, amount)
            copy(t, reached.origin_mm[number])
            _rotate(R, constant, amount, reached.axis[number])
        elif kind == TRANSLATE:
            _amount(chains.terms, amounts, number, at.y, amount)
            copy(t, reached.origin_mm[number])
            _translate(R, t, constant, amount, reached.axis[number])
        elif kind == MOVE:
            _move(R, t, constant)
        elif kind == MARK:
            copy_matrices(R, reached.rotation[number])
            copy(t, reached.position_mm[number])
        elif kind == LEAVE:
            copy_matrices(R, left_R[depth])
            copy(t, left_t[depth])
            depth += 1
        else:
            depth -= 1
            copy_matrices(left_R[depth], R)
            copy(left_t[depth], t)


@inner
def _stay(R: Array, t: Array) -> None:
    """Set a pose (3, 3, 1), (3, 1) to the identity."""
    for i in range(3):
        t[i, 0] = 0.0
        for j in range(3):
            R[i, j, 0] = 1.0 if i == j else 0.0


@compiled
def condense(chains: FlatChains, amounts: Amounts) -> Plan:
    """Return the plan with operations that depend on no state merged into constant moves."""
    plan = chains.plan
    kind, number = np.empty_like(plan.kind), np.empty_like(plan.number)
    constant = np.empty_like(plan.constant)
    R, t, amount, no_axis = np.empty((3, 3, 1)), np.empty((3, 1)), np.empty(1), np.empty((3, 1))
    n, pending = 0, False
    _stay(R, t)
    for step in range(len(plan.kind)):
        what, o = plan.kind[step], plan.number[step]
        if what == MOVE or (what in (ROTATE, TRANSLATE) and not chains.moves[o]):
            amount[0] = amounts.steady[o]
            if what == MOVE:
                _move(R, t, plan.constant[step])
            elif what == ROTATE:
                _rotate(R, plan.constant[step], amount, no_axis)
            else:
                _translate(R, t, plan.constant[step], amount, no_axis)
            pending = True
            continue
        if pending:
            kind[n], number[n] = MOVE, 0
            for i in range(3):
                constant[n, 9 + i] = t[i, 0]
                for j in range(3):
                    constant[n, 3 * i + j] = R[i, j, 0]
            _stay(R, t)
            n, pending = n + 1, False
        kind[n], number[n] = what, o
        for i in range(12):
            constant[n, i] = plan.constant[step, i]
        n += 1
    return Plan(kind[:n], number[:n], constant[:n])
