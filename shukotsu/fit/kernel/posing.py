"""Levenberg-Marquardt steps of states and roots of many frames at once, the unknowns being fixed.

On paper: docs/whole-hand.md, section 6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shukotsu.arrays import Array
from shukotsu.fit.kernel.compiled import compiled, copy, copy_matrices, fill, inlined
from shukotsu.fit.kernel.derivatives import MeasuredPoses, Objective, ResidualArrays, jacobian, residuals
from shukotsu.fit.kernel.elimination import (
    EliminatedStates,
    add_to_root,
    by_upper,
    eliminate,
    solve_root,
    step_root,
    step_states,
)
from shukotsu.fit.kernel.forward import Amounts, BranchPoses, FlatChains, Plan, ReachedFrames, reach

_FIRST_DAMPING, _DAMPING_STEP = 1e-3, 10.0


class PosingBuffers(NamedTuple):
    """Buffers in which a block of frames is posed: the point tried, residuals at the current one, the step of
    roots.
    """

    tried: BranchPoses
    reached: ReachedFrames
    current: ResidualArrays
    J_y: Array
    J: Array
    inverse: Array
    by_rest: Array
    rhs: Array
    H_rr: Array
    H_xr: Array
    g_r: Array
    root_inverse: Array
    root_rhs: Array
    d_root: Array


@inlined
def _step(
    chains: FlatChains,
    amounts: Amounts,
    seen: MeasuredPoses,
    objective: Objective,
    damping: Array,
    at: BranchPoses,
    buffers: PosingBuffers,
) -> None:
    """Try the step from a point where `reach` and `residuals` were, x being fixed."""
    for i in range(6):
        fill(0.0, buffers.H_rr[i])
    fill(0.0, buffers.g_r)
    for b in range(len(chains.states_from) - 1):
        n_states = chains.states_from[b + 1] - chains.states_from[b]
        part = EliminatedStates(buffers.inverse[b, :n_states], buffers.by_rest[b], buffers.rhs[b, :n_states])
        J_y = buffers.J_y[:n_states]
        jacobian(
            chains, amounts, buffers.reached, at, seen, buffers.current, objective.temper, b, J_y, buffers.J
        )
        r = eliminate(chains, buffers.current, at, objective, damping, b, J_y, buffers.J, part)
        add_to_root(chains, b, buffers.J, r, part, buffers.H_rr, buffers.H_xr, buffers.g_r)
    solve_root(buffers.H_rr, buffers.g_r, damping, buffers.root_inverse, buffers.root_rhs)
    by_upper(buffers.root_inverse, buffers.root_rhs, buffers.d_root)
    for i in range(6):
        for f in range(len(damping)):
            buffers.d_root[i, f] = -buffers.d_root[i, f]
    copy(at.y, buffers.tried.y)
    copy_matrices(at.root, buffers.tried.root)
    copy(at.root_mm, buffers.tried.root_mm)
    for b in range(len(chains.states_from) - 1):
        states = chains.states[chains.states_from[b] : chains.states_from[b + 1]]
        part = EliminatedStates(
            buffers.inverse[b, : len(states)], buffers.by_rest[b], buffers.rhs[b, : len(states)]
        )
        step_states(states, part, buffers.d_root, buffers.tried.y)
    step_root(buffers.d_root, buffers.tried.root, buffers.tried.root_mm)


@inlined
def _take(f: int, tried: BranchPoses, at: BranchPoses) -> None:
    """Copy one frame of poses."""
    for i in range(len(at.y)):
        at.y[i, f] = tried.y[i, f]
    for i in range(3):
        at.root_mm[i, f] = tried.root_mm[i, f]
        for j in range(3):
            at.root[i, j, f] = tried.root[i, j, f]


@inlined
def _evaluate(
    chains: FlatChains,
    plan: Plan,
    amounts: Amounts,
    seen: MeasuredPoses,
    objective: Objective,
    at: BranchPoses,
    buffers: PosingBuffers,
) -> None:
    reach(chains, plan, amounts, at, buffers.reached)
    residuals(chains, buffers.reached, at, seen, objective, buffers.current)


@compiled
def pose(
    chains: FlatChains,
    plan: Plan,
    amounts: Amounts,
    seen: MeasuredPoses,
    objective: Objective,
    steps: int,
    least_gain: float,
    at: BranchPoses,
    buffers: PosingBuffers,
) -> None:
    """Fit states and roots in place, x being fixed, each frame while a step gains the share least_gain.

    plan : condensed (see `condense`).
    """
    n_going = n = len(buffers.current.cost)
    goes_on, damping, cost = np.ones(n, np.bool_), np.empty(n), np.empty(n)
    _evaluate(chains, plan, amounts, seen, objective, at, buffers)
    for f in range(n):
        cost[f], damping[f] = buffers.current.cost[f], _FIRST_DAMPING
    for _ in range(steps):
        _step(chains, amounts, seen, objective, damping, at, buffers)
        _evaluate(chains, plan, amounts, seen, objective, buffers.tried, buffers)
        back = False
        for f in range(n):
            if goes_on[f] and buffers.current.cost[f] <= cost[f]:
                goes_on[f] = cost[f] - buffers.current.cost[f] > least_gain * cost[f]
                n_going -= not goes_on[f]
                cost[f] = buffers.current.cost[f]
                damping[f] /= _DAMPING_STEP
                _take(f, buffers.tried, at)
            elif goes_on[f]:
                damping[f] *= _DAMPING_STEP
                back = True
        if not n_going:
            break
        if back:
            _evaluate(chains, plan, amounts, seen, objective, at, buffers)
