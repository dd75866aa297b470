"""Whether a hand fits better if a receiver sits elsewhere on its bone from some moment on (Rao's score test).

To first order the answer needs no second fit: the six numbers of such a displacement are six more unknowns of
the same least squares, from which the hand's own unknowns, the joint angles and the roots are eliminated. So
what the fit has already bent to the displacement counts for it, and what joint angles or neighbours can
explain as well does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skeleton.rotations import Array
from stages.fit_hand.normal_equations import (
    Point,
    Problem,
    Reduced,
    Residuals,
    reduce,
    residuals,
    weighted_jacobian,
)
from stages.fit_hand.operations import Index

MOMENTS = 40
"""At so many of them a receiver may have come loose; the exact frame is then looked for."""

SHORTEST = 2
"""Intervals between moments that a receiver must have sat in its first and in its second place."""

NORMAL_SD = (2.5, 3.0)
LEAST_NORMAL = (0.5, float(np.radians(1.5)))
"""In units of the sd of a receiver's momentary residuals, and at least so many mm and rad: half a recording
may differ so much from the other half without anything being loose, as skin does not quite follow its law and
the postures are others."""

DISPLACEMENT_SD = (6.0, float(np.radians(10.0)))
"""mm and rad per component, of a receiver that came loose."""

LEAST_GAIN = 7.0
"""Log likelihood that a loose receiver must explain beyond a normal displacement; 6.0 is the most in 40
simulated hands with nothing loose, half of them with twice the usual skin artefact."""

MOST_RIVALS, RIVAL_SHARE = 3, 0.4
"""Receivers of which one is loose, by what their displacements explain to first order."""

PRIOR = np.diag(np.repeat(DISPLACEMENT_SD, 3) ** -2.0)


@dataclass(frozen=True)
class Displacement:
    """A receiver, by number, displaced by step (6,), mm and rad in its own frame, from frame `at` on."""

    receiver: int
    at: int
    step: Array

    @property
    def cost(self) -> float:
        """Minus its log prior."""
        return float(self.step @ PRIOR @ self.step) / 2


@dataclass(frozen=True)
class ScoreTest:
    """Slope (S, K, 6) and curvature (S, K, 6, 6) of the cost by a displacement of each receiver from each
    moment at (K,) on.

    gain : (S, K) log posterior that the best displacement, step (S, K, 6), adds. radii : (S, 6) of a normal
    one.
    """

    at: Index
    slope: Array
    curvature: Array
    step: Array
    gain: Array
    radii: Array

    @classmethod
    def of(cls, problem: Problem, point: Point, receivers: Sequence[int]) -> ScoreTest:
        """Test some of the receivers; the others gain nothing."""
        current = residuals(problem, point)
        reduced = reduce(problem, point, current, np.zeros(len(point.y)))
        cuts = np.unique(np.linspace(0, len(point.y), MOMENTS + 1).round().astype(int))[:-1]
        slope = np.zeros((len(problem.sd), len(cuts) - 1, 6))
        curvature = np.zeros((*slope.shape, 6))
        for index, of_branch in enumerate(problem.receivers):
            own = [(i, s) for i, (_, s) in enumerate(of_branch) if s in receivers]
            if own:
                by_each = _by_displacements(problem, index, own, point, current, reduced, cuts)
                for (_, s), by_displacement in zip(own, by_each, strict=True):
                    slope[s], curvature[s] = by_displacement
        long_enough = slice(SHORTEST - 1, len(cuts) - SHORTEST)
        slope, curvature = slope[:, long_enough], curvature[:, long_enough]
        radii = np.maximum(NORMAL_SD * problem.sd, LEAST_NORMAL).repeat(3, axis=1)
        step = np.asarray(-np.linalg.solve(curvature + PRIOR, slope[..., None])[..., 0], float)
        return cls(cuts[1:][long_enough], slope, curvature, step, -(slope * step).sum(-1) / 2, radii)

    def likeliest(self, receiver: int | None = None) -> Displacement | None:
        """The displacement (of one receiver, where given) that is most abnormal; None where none is.

        What one receiver's large displacement explains may be the small one of its neighbour: at each moment
        only the receiver whose displacement explains most is a candidate.
        """
        moments = np.arange(len(self.at))
        best = np.argmax(self.gain, axis=0) if receiver is None else np.full(len(self.at), receiver)
        abnormal = self.gain[best, moments] - _most_within(
            self.radii[best], self.slope[best, moments], self.curvature[best, moments]
        )
        if not len(moments) or abnormal.max() <= LEAST_GAIN:
            return None
        k = int(np.argmax(abnormal))
        return Displacement(int(best[k]), int(self.at[k]), self.step[best[k], k])

    def rivals(self) -> list[Displacement]:
        """The likeliest displacement and those of other receivers, at the same moment, that explain nearly as
        much.

        Which of them it is, only the fits with them can tell: to first order a turned receiver on the middle
        of a finger is much like one on its tip that slid.
        """
        first = self.likeliest()
        if first is None:
            return []
        k = int(np.searchsorted(self.at, first.at))
        return [
            Displacement(int(s), first.at, self.step[s, k])
            for s in np.argsort(-self.gain[:, k])[:MOST_RIVALS]
            if self.gain[s, k] >= RIVAL_SHARE * self.gain[first.receiver, k]
        ]

    def refined(self, known: Displacement) -> Displacement:
        """A displacement that frames were already corrected for, gone as far as is likeliest."""
        k = int(np.searchsorted(self.at, known.at))
        slope = self.slope[known.receiver, k] + PRIOR @ known.step
        return replace(
            known, step=known.step - np.linalg.solve(self.curvature[known.receiver, k] + PRIOR, slope)
        )


def _by_displacements(
    problem: Problem,
    index: int,
    own: Sequence[tuple[int, int]],
    point: Point,
    current: Residuals,
    reduced: Reduced,
    cuts: Index,
) -> Iterator[tuple[Array, Array]]:
    """Slope (K, 6) and curvature (K, 6, 6) of the cost by a displacement, from each cut but the first on, of
    some receivers of a branch; the states and root of every frame and the hand's unknowns eliminated.
    """
    part, branch, gone = current.branches[index], problem.branches[index], reduced.eliminated[index]
    r, by_operation, by_root = weighted_jacobian(problem, index, part, point)
    states = by_operation @ branch.per_state(point.x) @ gone.inverse.swapaxes(-1, -2)
    of_branch = branch.by_unknown(by_operation, point.y) - states @ gone.by_rest[..., 6:]
    root = (by_root - states @ gone.by_rest[..., :6]) @ reduced.root_inverse.swapaxes(-1, -2)
    by_x = -root @ reduced.root_by_x
    by_x[..., branch.unknowns] += of_branch
    r = r - (states @ gone.rhs[..., None])[..., 0] - (root @ reduced.root_rhs[..., None])[..., 0]
    for i, s in own:
        rows = slice(6 * i, 6 * i + 6)
        seen = np.sqrt(problem.temper * part.weight[i] * problem.frames.valid[:, s])
        scale = seen[:, None] / np.repeat(problem.sd[s], 3)
        by_y, by_root = states[:, rows], root[:, rows]  # squared: the leverage of the frame's own unknowns
        free = np.eye(6) - by_y @ by_y.swapaxes(-1, -2) - by_root @ by_root.swapaxes(-1, -2)
        slope = _from_each(cuts, scale * r[:, rows])
        curvature = _from_each(cuts, scale[:, :, None] * free * scale[:, None, :])
        with_x = _from_each(cuts, scale[:, :, None] * by_x[:, rows])
        flat = with_x.reshape(-1, with_x.shape[-1])
        solved = np.linalg.solve(reduced.matrix, np.concatenate([flat, reduced.gradient[None]]).T).T
        eliminated = with_x @ solved[:-1].reshape(with_x.shape).swapaxes(-1, -2)
        yield slope - with_x @ solved[-1], curvature - eliminated


def _from_each(cuts: Index, of_frames: Array) -> Array:
    """Sums over the frames from each cut but the first to the end."""
    return np.asarray(np.cumsum(np.add.reduceat(of_frames, cuts, axis=0)[::-1], 0)[::-1][1:])


def _most_within(radii: Array, slope: Array, curvature: Array) -> Array:
    """Most (K,) that a step within an ellipsoid of these radii (K, 6) gains; trust region, by bisection."""
    values, vectors = np.linalg.eigh(radii[:, :, None] * curvature * radii[:, None])
    values = np.maximum(values, 0.0)
    b = (vectors.swapaxes(-1, -2) @ (radii * slope)[..., None])[..., 0]
    low, high = np.zeros(len(b)), np.linalg.norm(b, axis=-1) + 1e-9
    for _ in range(50):
        middle = (low + high) / 2
        outside = ((b / (values + middle[:, None])) ** 2).sum(-1) > 1
        low, high = np.where(outside, middle, low), np.where(outside, high, middle)
    z = b / (values + high[:, None])
    return np.asarray((b * z - values * z**2 / 2).sum(-1))
