"""Reduce residuals to what joint angles, roots and the hand's own unknowns cannot explain.

With it, anything else that may have moved the measured poses can be tested to first order: receivers that sit
elsewhere on their bones, a field that is disturbed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.compiled_equations import Jacobian, reduce, residuals, weighted_jacobians
from shukotsu.stages.fit_hand.normal_equations import Point, Problem, Reduced


@dataclass(frozen=True)
class EliminatedBranch:
    """What the cost does if receivers of a branch, n of them, m = 6 n, are displaced in their own
    frames.

    receivers : their numbers. slope (F, m) and curvature (F, m, m) of the cost by their displacements in each
    frame, with its states and root eliminated; by_x (F, m, G) : how these displacements pull at the hand's
    unknowns. root (F, m, 6) : what the root takes of the curvature, already gone from it.
    """

    receivers: tuple[int, ...]
    slope: Array
    curvature: Array
    by_x: Array
    root: Array


@dataclass(frozen=True)
class Eliminated:
    """Every branch at a point; covariance (G, G) of the unknowns, gradient (G,) of the cost by them."""

    branches: tuple[EliminatedBranch, ...]
    covariance: Array
    gradient: Array

    @classmethod
    def of(cls, problem: Problem, point: Point) -> Eliminated:
        """Eliminate at a point."""
        reduced = reduce(problem, point).frames_first()
        branches = []
        parts = zip(residuals(problem, point).branches, weighted_jacobians(problem, point), strict=True)
        for index, (part, jacobian) in enumerate(parts):
            r, states, root, by_x = _left(reduced, index, jacobian)
            receivers = tuple(s for _, s in problem.receivers[index])
            seen = np.sqrt(problem.temper * part.weight.T * problem.frames.valid[:, receivers])  # (F, n)
            scale = (seen[..., None] / problem.sd[receivers, :].repeat(3, axis=1)).reshape(r.shape)
            free = np.eye(r.shape[1]) - states @ states.swapaxes(-1, -2) - root @ root.swapaxes(-1, -2)
            branches.append(
                EliminatedBranch(
                    receivers,
                    scale * r,
                    scale[:, :, None] * free * scale[:, None, :],
                    scale[..., None] * by_x,
                    scale[..., None] * root,
                )
            )
        return cls(tuple(branches), np.asarray(np.linalg.inv(reduced.matrix)), reduced.gradient)


def _left(reduced: Reduced, index: int, jacobian: Jacobian) -> tuple[Array, Array, Array, Array]:
    """A branch's residuals (F, m) and their derivatives by x (F, m, G), states and roots eliminated; between
    them orthonormal derivatives by states (F, m, s) and roots (F, m, 6).
    """
    gone = reduced.eliminated[index]
    states = jacobian.by_states @ gone.inverse.swapaxes(-1, -2)
    of_branch = jacobian.by_unknowns - states @ gone.by_rest[..., 6:]
    root = (jacobian.by_root - states @ gone.by_rest[..., :6]) @ reduced.root_inverse.swapaxes(-1, -2)
    by_x = -root @ reduced.root_by_x
    by_x[..., gone.unknowns] += of_branch
    r = jacobian.r - (states @ gone.rhs[..., None])[..., 0] - (root @ reduced.root_rhs[..., None])[..., 0]
    return r, states, root, by_x
