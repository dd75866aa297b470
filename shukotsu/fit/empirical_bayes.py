"""Estimate how large residuals, misplacements and skin motion are in this hand: scales of the priors from the
data.

Each scale is the value that makes the unknowns of its group as large as its prior says, as far as the data
determine them (the fixed point of the evidence; MacKay 1992). It is held to the literature's by very little:
skin that does not move, or a tracker without noise, must not be believed to be there because it usually is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shukotsu.fit.compiled_equations import Jacobian
from shukotsu.fit.normal_equations import Problem, Reduced, Residuals
from shukotsu.hand.rotations import Array
from shukotsu.hand.series import effective_samples

FAMILIES: Mapping[str, tuple[str, ...]] = {
    "mount": ("mount",),
    "mount turn": ("mount turn",),
    "slide": ("slide x", "slide y", "slide z"),
    "tilt": ("tilt x", "tilt y", "tilt z"),
    "joint slide": ("joint slide",),
}
"""Groups of unknowns that share a scale; the sizes of bones and joints are left as published."""

PSEUDO_UNKNOWNS = 2.0
PSEUDO_RESIDUALS = 0.2
"""Weight of the published scale: as of so many unknowns that are known, and of so many residuals. Two
unknowns are what a scale has whose logarithm differs by a half between people."""

LEAST_SAMPLES = 5.0
_NO_MOTION = 1e-12

PSEUDO_TURNS = 100.0
"""Weight of a receiver's residual in position in that of its rotation, as of so many residuals: both grow
together, and joints that turn about three axes leave next to nothing of a rotation unexplained."""

SD_LIMITS = (0.02, 6.0)
"""No receiver's residual is trusted to be smaller or larger than so many times the published one: 0.01 mm are
less than any tracker's noise."""


def prior_precision(groups: Sequence[str], x: Array, covariance: Array, before: Array) -> Array:
    """Precision (G,) of the unknowns' priors (1: as published), one for each family.

    x (G,), covariance (G, G) : of the unknowns, solved with the precision `before` (G,).
    """
    group = np.array(groups)
    precision = np.ones(len(group))
    for members in FAMILIES.values():
        of_family = np.isin(group, members)
        if of_family.any():
            squares = float((x[of_family] ** 2).sum())
            determined = float((1.0 - np.diag(covariance)[of_family] * before[of_family]).sum())
            precision[of_family] = (determined + PSEUDO_UNKNOWNS) / (squares + PSEUDO_UNKNOWNS)
    return precision


def independent_samples(problem: Problem, current: Residuals) -> float:
    """Number of independent samples in frames that follow each other evenly.

    From the autocorrelation of every receiver's residuals; that which three quarters of them exceed, at
    least LEAST_SAMPLES.
    """
    counts = []
    for receivers, (r, _, _) in zip(problem.receivers, current.branches, strict=True):
        for i, (_, s) in enumerate(receivers):
            seen = r[i, problem.frames.valid[:, s]]
            if len(seen) < 5:
                continue
            for part in (seen[:, :3], seen[:, 3:]):
                variance = float(part.var(0).sum())
                if variance > _NO_MOTION:
                    counts.append(effective_samples(part, variance, len(part)))
    return max(LEAST_SAMPLES, float(np.percentile(counts, 25))) if counts else LEAST_SAMPLES


def residual_sd(
    problem: Problem, current: Residuals, jacobians: Sequence[Jacobian], reduced: Reduced, published: Array
) -> Array:
    """Sd (S, 2) of every receiver's residuals, position in mm and rotation in rad.

    The squares are divided by the degrees of freedom that the frame's own unknowns leave, as their leverage
    says. jacobians : every branch's. published : (S, 2) the published ones.
    """
    out = published.copy()
    for index, ((r, weight, _), jacobian) in enumerate(zip(current.branches, jacobians, strict=True)):
        eliminated = reduced.eliminated[index]
        states = jacobian.by_states @ eliminated.inverse.swapaxes(-1, -2)
        rest = jacobian.by_root - states @ eliminated.by_rest[..., :6]
        leverage = (states**2).sum(-1) + ((rest @ reduced.root_inverse.swapaxes(-1, -2)) ** 2).sum(-1)
        for i, (_, s) in enumerate(problem.receivers[index]):
            ok = problem.frames.valid[:, s]
            if not ok.any():
                continue
            expected, pseudo = 1.0, PSEUDO_RESIDUALS  # share of the published variance, and its weight
            for kind in (0, 1):  # position, then rotation
                rows = slice(3 * kind, 3 * kind + 3)
                squares = float((weight[i, :, None] * r[i, :, rows] ** 2)[ok].sum())
                squares *= (problem.sd[s, kind] / published[s, kind]) ** 2
                left = max(0.0, float((1 - leverage.reshape(len(ok), -1, 6)[:, i, rows])[ok].sum()))
                share = (squares + pseudo * expected) / (left + pseudo)
                out[s, kind] = published[s, kind] * np.clip(np.sqrt(share), *SD_LIMITS)
                expected, pseudo = share, PSEUDO_TURNS
    return out
