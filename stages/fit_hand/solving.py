"""Damped Gauss-Newton over the unknowns of a hand and of all its frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.fit_hand.normal_equations import (
    Point,
    Problem,
    Residuals,
    back_substitute,
    reduce,
    residuals,
)

CLOSE = 1e-3
"""Newton decrement, the drop in log posterior that a next step promises: statistically nothing is left."""

NEARLY = 0.1
"""The same, good enough to find the scales of priors and residuals."""

_FULL_STEP = 1e-3
"""Damping below which a step is as long as the normal equations say."""

_LEAST_DAMPING, _MOST_DAMPING = 1e-8, 1e4


@dataclass(frozen=True)
class Solution:
    """Where the fit ended; converged : whether because nothing moved any more."""

    point: Point
    residuals: Residuals
    converged: bool
    steps: int


def solve(problem: Problem, point: Point, most_steps: int, close: float = CLOSE) -> Solution:
    """Go downhill from a point until no step goes `close` further down, or the steps are used up."""
    found = residuals(problem, point)
    damping, step = 1e-4, 0
    for step in range(1, most_steps + 1):
        reduced = reduce(problem, point, found, np.full(len(point.y), damping))
        diagonal = np.diag(np.diag(reduced.matrix)) * damping
        dx = np.asarray(-np.linalg.solve(reduced.matrix + diagonal, reduced.gradient), float)
        tried = back_substitute(problem, point, reduced, dx)
        new = residuals(problem, tried)
        promised = -float(reduced.gradient @ dx) / 2
        done = max(promised, abs(found.cost - new.cost)) < close and damping <= _FULL_STEP
        if new.cost <= found.cost:
            point, found, damping = tried, new, max(damping / 10, _LEAST_DAMPING)
        else:
            damping *= 30
        if done:
            return Solution(point, found, True, step)
        if damping > _MOST_DAMPING:
            break
    return Solution(point, found, False, step)
