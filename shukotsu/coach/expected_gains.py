"""Compute what a movement would gain before it is done: the information of imagined frames, added to the
posterior's.

The hand as it is fitted goes through the movement's postures; what these frames would say of the hand's
unknowns is what frames that were measured say (`compiled_equations.reduce`), weighed as so many independent
samples. P' = (P^-1 + A)^-1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shukotsu.coach.movements import RELAXED_DEG, Movement, Posture
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.compiled_equations import reduce
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.normal_equations import Frames, Observations, Point

FRAMES = 9
"""Imagined, of each movement."""

SAMPLES_PER_S = 1.2
"""Independent samples that a second of movement adds, by which fits of half a minute are weighed too (our
choice; those found in simulated hands are 0.6 and more)."""


def imagined_states(fit: HandFit, movement: Movement, n_frames: int = FRAMES) -> Array:
    """Give joint angles (F, S) in rad of the movement as the fitted hand would do it, there and back once."""
    return _between([_states(fit, posture) for posture in movement.postures], n_frames)


def _states(fit: HandFit, posture: Posture) -> Array:
    names = fit.evidence.model.states.names
    y = fit.evidence.posterior.mean_states.copy()
    for index, (joint, kind) in enumerate(names):
        relaxed = RELAXED_DEG.get(joint.rsplit("_", 1)[-1])
        if kind == "flexion" and relaxed is not None:
            y[index] = np.radians(relaxed)
        if joint in posture and kind in ("flexion", "abduction"):
            y[index] = np.radians(posture[joint][kind == "abduction"])
    return y


def _between(keyframes: Sequence[Array], n_frames: int) -> Array:
    at = np.linspace(0, len(keyframes) - 1, n_frames)
    low = np.minimum(at.astype(int), len(keyframes) - 2)
    share = (at - low)[:, None]
    frames = np.array(keyframes)
    return np.asarray(frames[low] * (1 - share) + frames[low + 1] * share)


def information(fit: HandFit, states: Array, samples: float) -> Array:
    """Give what frames with these joint angles (F, S) would say of the unknowns, a precision (G, G)."""
    evidence = fit.evidence
    problem, x = evidence.problem, evidence.posterior.x
    n_frames, n_receivers = len(states), len(evidence.model.receivers)
    root, root_mm = (
        np.tile(np.eye(3), (n_frames, 1, 1)),
        np.tile(problem.frames.position_mm[0, 0], (n_frames, 1)),
    )
    rotation = np.tile(np.eye(3), (n_frames, n_receivers, 1, 1))
    position, valid = np.zeros((n_frames, n_receivers, 3)), np.zeros((n_frames, n_receivers), bool)
    worn = np.asarray(problem.frames.valid.any(0))
    for branch, receivers in zip(problem.branches, problem.receivers, strict=True):
        reached = branch.reach(x, states, root, root_mm)
        for mark, s in receivers:
            rotation[:, s], position[:, s] = reached.rotation[mark], reached.position_mm[mark]
            valid[:, s] = worn[s]
    imagined = replace(
        problem,
        frames=Frames(rotation, position, valid),
        temper=samples / n_frames,
        field=None,
        observations=Observations.of([], [], len(x)),
    )
    point = Point(x, states, root, root_mm)
    return np.asarray(reduce(imagined, point).matrix - np.diag(problem.precision))
