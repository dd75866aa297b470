"""Inverse kinematics: joint angles and root of any frames, for a hand that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinematics.rotations import Array
from stages.fit_hand.chain import HandModel
from stages.fit_hand.normal_equations import Point, Problem, back_substitute, reduce, residuals

_STEPS = 12
_LEAST_GAIN = 1e-4


def first_guess(problem: Problem, model: HandModel, x: Array) -> Point:
    """Joint angles as receivers that sit straight on their bones would show them, and roots that fit."""
    frames = problem.frames
    n_frames = len(frames.valid)
    y = np.tile(problem.state_mean, (n_frames, 1))
    for guess in model.guesses:
        a, b = model.receivers.index(guess.parent), model.receivers.index(guess.child)
        relative = np.swapaxes(frames.rotation[:, a] @ guess.before, -1, -2) @ (
            frames.rotation[:, b] @ guess.after.T
        )
        u = guess.axis
        skew = np.stack(
            [
                relative[:, 2, 1] - relative[:, 1, 2],
                relative[:, 0, 2] - relative[:, 2, 0],
                relative[:, 1, 0] - relative[:, 0, 1],
            ],
            -1,
        )
        # tangent of half the twist: (q_v . u) / q_w, both times 4 q_w
        angle = 2 * np.arctan2(skew @ u, 1 + np.trace(relative, axis1=1, axis2=2))
        y[:, guess.state] = np.where(frames.valid[:, a] & frames.valid[:, b], angle, y[:, guess.state])
    return _first_roots(problem, Point(x, y, np.tile(np.eye(3), (n_frames, 1, 1)), np.zeros((n_frames, 3))))


def _first_roots(problem: Problem, point: Point) -> Point:
    """Put every frame's root where the first of its valid receivers says."""
    root, root_mm = point.root.copy(), point.root_mm.copy()
    done = np.zeros(len(root), bool)
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        reached = branch.reach(point.x, point.y, point.root, point.root_mm)
        for mark, s in receivers:
            now = problem.frames.valid[:, s] & ~done
            turn = problem.frames.rotation[now, s] @ reached.rotation[mark, now].swapaxes(-1, -2)
            root[now] = turn
            root_mm[now] = (
                problem.frames.position_mm[now, s] - (turn @ reached.position_mm[mark, now, :, None])[..., 0]
            )
            done |= now
    return replace(point, root=root, root_mm=root_mm)


def pose(problem: Problem, point: Point, steps: int = _STEPS) -> Point:
    """Fit states and roots of every frame with x as it is: Levenberg-Marquardt, each frame on its own and
    for no longer than it gains.
    """
    whole = Point(point.x, point.y.copy(), point.root.copy(), point.root_mm.copy())
    rows = np.arange(len(point.y))
    damping = np.full(len(rows), 1e-3)
    found = residuals(problem, point)
    for _ in range(steps):
        reduced = reduce(problem, point, found, damping, fixed_x=True)
        tried = back_substitute(problem, point, reduced, None)
        new = residuals(problem, tried)
        better = new.frame_cost <= found.frame_cost
        for values, of_tried in (
            (whole.y, tried.y),
            (whole.root, tried.root),
            (whole.root_mm, tried.root_mm),
        ):
            values[rows[better]] = of_tried[better]
        goes_on = ~better | (found.frame_cost - new.frame_cost > _LEAST_GAIN * found.frame_cost)
        if not goes_on.any():
            break
        rows, damping = rows[goes_on], np.where(better, damping / 10, damping * 10)[goes_on]
        problem = replace(problem, frames=problem.frames.take(goes_on))
        point = whole.take(rows)
        found = new.take(goes_on) if better[goes_on].all() else residuals(problem, point)
    return whole
