"""Damped Gauss-Newton over the hand and all frames, and the first guess of joint angles and roots.

On paper: docs/whole-hand.md, section 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import numpy.typing as npt

from shukotsu.fit.chain import HandModel
from shukotsu.fit.chain_builder import KINDS
from shukotsu.fit.compiled_equations import back_substitute, reach, reduce, residuals
from shukotsu.fit.normal_equations import Point, Problem, Residuals, axial_vector
from shukotsu.hand.rotations import Array

CLOSE = 1e-3
"""Newton decrement (expected gain in log posterior of the next step) below which the fit has converged."""

NEARLY = 0.1
"""The same, while the scales of priors and residuals are still being estimated."""

_FULL_STEP = 1e-3
"""Damping below which a step is practically an undamped Gauss-Newton step."""

_LEAST_DAMPING, _MOST_DAMPING = 1e-8, 1e4

_BENDS_RAD = tuple(np.radians([5.0, 40.0, 75.0]))
"""Flexions that are tried for joints that no two receivers show."""

_LEAST_BEND_SD_RAD = float(np.radians(12.0))
"""Least prior sd of a flexion for which these are tried: true of joints of digits, not of the palm."""


def first_guess(problem: Problem, model: HandModel, x: Array) -> Point:
    """Guess joint angles and roots of all frames, from which `solve` and `pose` start (section 6).

    Parameters
    ----------
    problem : Problem
        F frames.
    model : HandModel
        How a flexion shows between two receivers (`FirstGuess`).
    x : array, shape (G,)
        The hand's unknowns.

    Returns
    -------
    Point
        Angles (F, S), rad, as if receivers were aligned with their bones; the likeliest of a few flexions for
        joints that no two receivers show. Roots follow from each frame's first valid receiver.

    """
    frames = problem.frames
    n_frames = len(frames.valid)
    y = np.tile(problem.state_mean, (n_frames, 1))
    shown = np.zeros(y.shape, bool)
    for guess in model.guesses:
        a, b = model.receivers.index(guess.parent), model.receivers.index(guess.child)
        relative = np.swapaxes(frames.rotation[:, a] @ guess.before, -1, -2) @ (
            frames.rotation[:, b] @ guess.after.T
        )
        # tangent of half the twist: (q_v . u) / q_w, both times 4 q_w
        angle = 2 * np.arctan2(axial_vector(relative) @ guess.axis, 1 + np.trace(relative, axis1=1, axis2=2))
        shown[:, guess.state] = frames.valid[:, a] & frames.valid[:, b]
        y[:, guess.state] = np.where(shown[:, guess.state], angle, y[:, guess.state])
    root, root_mm = np.tile(np.eye(3), (n_frames, 1, 1)), np.zeros((n_frames, 3))
    placed = np.zeros(n_frames, bool)
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        rows = np.flatnonzero(~placed)
        if not len(rows):
            break
        reached = reach(branch, x, y[rows], np.tile(np.eye(3), (len(rows), 1, 1)), np.zeros((len(rows), 3)))
        for mark, s in receivers:
            seen = frames.valid[rows, s] & ~placed[rows]
            now = rows[seen]
            root[now] = frames.rotation[now, s] @ reached.rotation[mark, seen].swapaxes(-1, -2)
            arm = (root[now] @ reached.position_mm[mark, seen, :, None])[..., 0]
            root_mm[now] = frames.position_mm[now, s] - arm
            placed[now] = True
    bends = [
        state
        for state, (_, kind) in enumerate(model.states.names)
        if kind == KINDS[0] and problem.state_sd[state] > _LEAST_BEND_SD_RAD
    ]
    return _with_likeliest_bends(problem, Point(x, y, root, root_mm), shown, bends)


def _with_likeliest_bends(
    problem: Problem, point: Point, shown: npt.NDArray[np.bool_], may_bend: Sequence[int]
) -> Point:
    """Choose flexions of joints that no two receivers show so that the digit's receivers fit best.

    A finger of which only the tip is seen can be bent in two ways, knuckle up or knuckle down, and the
    solution keeps the one that it starts with. Only forward bends are tried, so that no finger starts
    hyperextended.

    Parameters
    ----------
    problem : Problem
        F frames.
    point : Point
        First guess.
    shown : array of bool, shape (F, S)
        Whether two receivers show a state.
    may_bend : sequence of int
        States that are tried in frames in which they are not shown.

    Returns
    -------
    Point
        The guess with the likeliest flexions.

    """
    y = point.y.copy()
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        bends = [state for state in may_bend if state in branch.states]
        seen = problem.frames.valid[:, [s for _, s in receivers]].any(1)
        rows = np.flatnonzero(seen & ~shown[:, bends].all(1))
        if not bends or not len(rows):
            continue
        alone = replace(problem, branches=(branch,), receivers=(receivers,), frames=problem.frames.take(rows))
        start = point.take(rows)
        least, best = residuals(alone, start).frame_cost, start.y
        for tried in product(_BENDS_RAD, repeat=len(bends)):
            bent = start.y.copy()
            bent[:, bends] = np.where(shown[rows][:, bends], bent[:, bends], tried)
            cost = residuals(alone, replace(start, y=bent)).frame_cost
            best = np.where((cost < least)[:, None], bent, best)
            least = np.minimum(cost, least)
        y[rows] = np.where(np.isin(np.arange(y.shape[1]), bends), best, y[rows])
    return replace(point, y=y)


@dataclass(frozen=True)
class Solution:
    """Result of a minimisation; converged : whether the last step was negligible."""

    point: Point
    residuals: Residuals
    converged: bool


def solve(problem: Problem, point: Point, most_steps: int, close: float = CLOSE) -> Solution:
    """Minimise the cost over hand, roots and states by damped Gauss-Newton steps (section 6).

    Parameters
    ----------
    problem : Problem
        Chains, measured frames and priors.
    point : Point
        Start.
    most_steps : int
        Largest number of steps.
    close : float
        Gain in log posterior below which a step is the last.

    Returns
    -------
    Solution
        The last accepted point, its residuals, and whether the minimisation converged.

    """
    current = residuals(problem, point)
    damping = 1e-4
    for _ in range(most_steps):
        reduced = reduce(problem, point, damping)
        diagonal = np.diag(np.diag(reduced.matrix)) * damping
        dx = np.asarray(-np.linalg.solve(reduced.matrix + diagonal, reduced.gradient), float)
        tried = back_substitute(problem, point, reduced, dx)
        new = residuals(problem, tried)
        promised = -float(reduced.gradient @ dx) / 2
        done = max(promised, abs(current.cost - new.cost)) < close and damping <= _FULL_STEP
        if new.cost <= current.cost:
            point, current, damping = tried, new, max(damping / 10, _LEAST_DAMPING)
        else:
            damping *= 30
        if done:
            return Solution(point, current, converged=True)
        if damping > _MOST_DAMPING:
            break
    return Solution(point, current, converged=False)
