"""The error that noise puts into all hands alike, found by fitting the fitted hand again, and taken off.

The hand that is likeliest together with the angles of every frame is too large: what is noise looks like
motion, and on longer bones smaller angles, which are likelier, reach as far (Neyman & Scott 1948). Bones
without a receiver leave room for that. So the fitted hand is measured again as it stands, with the noise that
it leaves and with that noise reversed, so that only what all noise has in common is left, and fitted again
without any other expectation than itself (the parametric bootstrap, Efron 1979).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.skeleton.rotations import Array, exp_rotation
from shukotsu.stages.fit_hand.compiled_equations import pose, residuals
from shukotsu.stages.fit_hand.gauss_newton import NEARLY, solve
from shukotsu.stages.fit_hand.normal_equations import Frames, Observations, Point, Problem

_STEPS = 8
_NOTHING = 1e-9
"""Precision of an expectation that has been replaced."""


def without_noise_bias(problem: Problem, point: Point) -> Point:
    """Return the hand less what noise makes of it, its frames posed with it."""
    rng, shape = np.random.default_rng(0), (*problem.frames.valid.shape, 3)
    noise = rng.normal(size=(2, *shape))
    root = np.sqrt(problem.precision)
    rows = problem.observations.rows
    held = Observations(
        np.concatenate([rows, np.diag(root)]), np.concatenate([rows @ point.x, root * point.x])
    )
    again = replace(problem, observations=held, precision=np.full(len(root), _NOTHING))
    solved_x = []
    for sign in (1.0, -1.0):
        frames = _measured_again(problem, point, sign * noise)
        solved_x.append(solve(replace(again, frames=frames), point, _STEPS, NEARLY).point.x)
    x = 2 * point.x - np.mean(solved_x, axis=0)
    return pose(problem, replace(point, x=x))


def _measured_again(problem: Problem, point: Point, noise: Array) -> Frames:
    """The frames as the hand would have them, off by noise (2, F, S, 3) times the sd of what is left."""
    rotation, position = problem.frames.rotation.copy(), problem.frames.position_mm.copy()
    for receivers, (_, _, reached) in zip(problem.receivers, residuals(problem, point).branches, strict=True):
        for mark, s in receivers:
            turned = problem.sd[s, 1] * noise[1, :, s]
            rotation[:, s] = reached.rotation[mark] @ exp_rotation(turned)
            position[:, s] = reached.position_mm[mark] + problem.sd[s, 0] * noise[0, :, s]
    if problem.field is not None:
        rotation = problem.field.turn(position, point.x) @ rotation
    return Frames(rotation, position, problem.frames.valid)
