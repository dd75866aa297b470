"""Levenberg-Marquardt fit of states and roots of many frames at once, with the hand's unknowns fixed.

On paper: docs/whole-hand.md, sections 6 and 11.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array
from shukotsu.fit.kernel.compiled import compiled, copy, copy_matrices, fill, inlined
from shukotsu.fit.kernel.derivatives import Derivatives, Evaluation, jacobian, residuals
from shukotsu.fit.kernel.elimination import (
    EliminatedStates,
    RootEquations,
    add_to_root,
    by_upper,
    eliminate,
    solve_root,
    step_root,
    step_states,
)
from shukotsu.fit.kernel.forward import BranchPoses, Plan, reach

_DAMPING_STEP = 10.0


class PosingBuffers(NamedTuple):
    """Working memory for posing a block of frames.

    tried : point after a step. derivatives : of one branch at a time. states : of all branches. root_inverse
    (6, 6, F), root_rhs (6, F) : as in `Reduced`. d_root : (6, F) step of the roots.
    """

    tried: BranchPoses
    derivatives: Derivatives
    states: EliminatedStates
    root: RootEquations
    root_inverse: Array
    root_rhs: Array
    d_root: Array


@inlined
def _step(now: Evaluation, damping: Array, buffers: PosingBuffers) -> None:
    """Compute the point after a step with x fixed, from one at which residuals were computed."""
    ranges, root = now.chains.ranges, buffers.root
    for i in range(6):
        fill(0.0, root.H_rr[i])
    fill(0.0, root.g_r)
    for b in range(len(ranges.state_start) - 1):
        n_states = ranges.state_start[b + 1] - ranges.state_start[b]
        states = _of_branch(buffers.states, b, n_states)
        derivatives = Derivatives(buffers.derivatives.by_states[:n_states], buffers.derivatives.by_rest)
        jacobian(now, b, derivatives)
        r = eliminate(now, b, derivatives, damping, states)
        add_to_root(now.chains, b, derivatives.by_rest, r, states, root)
    solve_root(root, damping, buffers.root_inverse, buffers.root_rhs)
    by_upper(buffers.root_inverse, buffers.root_rhs, buffers.d_root)
    for i in range(6):
        for f in range(len(damping)):
            buffers.d_root[i, f] = -buffers.d_root[i, f]
    copy(now.at.y, buffers.tried.y)
    copy_matrices(now.at.root, buffers.tried.root)
    copy(now.at.root_mm, buffers.tried.root_mm)
    for b in range(len(ranges.state_start) - 1):
        states_of_b = ranges.state[ranges.state_start[b] : ranges.state_start[b + 1]]
        step_states(
            states_of_b, _of_branch(buffers.states, b, len(states_of_b)), buffers.d_root, buffers.tried.y
        )
    step_root(buffers.d_root, buffers.tried.root, buffers.tried.root_mm)


@inlined
def _of_branch(states: EliminatedStates, b: int, n_states: int) -> EliminatedStates:
    """Select one branch's part of the buffers for all branches."""
    return EliminatedStates(states.inverse[b, :n_states], states.by_rest[b], states.rhs[b, :n_states])


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
def _evaluate(evaluation: Evaluation, plan: Plan) -> None:
    reach(evaluation.chains, plan, evaluation.amounts, evaluation.at, evaluation.reached)
    residuals(evaluation)


@compiled
def pose(
    now: Evaluation, plan: Plan, steps: int, least_gain: float, damping: Array, buffers: PosingBuffers
) -> npt.NDArray[np.bool_]:
    """Fit states and roots with the hand fixed, by Levenberg-Marquardt (docs/whole-hand.md, section 11).

    Parameters
    ----------
    now : Evaluation
        Chains at the start; its states and roots are changed in place.
    plan : Plan
        Condensed plan of the chains (`condense`).
    steps : int
        Largest number of steps.
    least_gain : float
        Relative decrease of a frame's cost below which its iteration ends.
    damping : array, shape (F,)
        Share of the diagonal that is added to it in each frame (Marquardt); changed in place.
    buffers : PosingBuffers
        Working memory for these frames.

    Returns
    -------
    array of bool, shape (F,)
        Frames whose iteration has not ended after these steps.

    """
    current, tried = now.current, buffers.tried
    then = Evaluation(now.chains, now.amounts, tried, now.seen, now.objective, now.reached, now.current)
    n_going = n = len(current.cost)
    goes_on, cost = np.ones(n, np.bool_), np.empty(n)
    _evaluate(now, plan)
    for f in range(n):
        cost[f] = current.cost[f]
    for _ in range(steps):
        _step(now, damping, buffers)
        _evaluate(then, plan)
        back = False
        for f in range(n):
            if goes_on[f] and current.cost[f] <= cost[f]:
                goes_on[f] = cost[f] - current.cost[f] > least_gain * cost[f]
                n_going -= not goes_on[f]
                cost[f] = current.cost[f]
                damping[f] /= _DAMPING_STEP
                _take(f, tried, now.at)
            elif goes_on[f]:
                damping[f] *= _DAMPING_STEP
                back = True
        if not n_going:
            break
        if back:
            _evaluate(now, plan)
    return goes_on
