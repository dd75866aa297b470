"""Both hands of a person: bones of the same length, left and right, though fitted apart.

Each fit's posterior is normal (Laplace), and the lengths are linear in its unknowns. So what the other hand
knows about them comes in exactly as in one fit of both hands: by conditioning on their difference.
"""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.posterior import Evidence

SIDE_SD = 0.0025
"""Sd of the difference between left and right, relative: lengths differ by less than 0.5 %
(Buryanov & Kotiuk 2010)."""


def share_lengths(one: HandFit, other: HandFit) -> tuple[HandFit, HandFit]:
    """Both fits of a person's hands, each with what the other says about its bones' lengths."""
    bones = [name for name in one.bones if name in other.bones]
    first, second = _lengths(one.evidence, bones), _lengths(other.evidence, bones)
    difference = first[0] - second[0]
    spread = first[2] + second[2] + np.diag((SIDE_SD * first[0]) ** 2)
    pull = np.linalg.solve(spread, np.concatenate([difference[:, None], first[1], second[1]], 1))
    n_one = first[1].shape[1]
    steps = -first[1].T @ pull[:, 0], second[1].T @ pull[:, 0]
    shrinks = first[1].T @ pull[:, 1 : 1 + n_one], second[1].T @ pull[:, 1 + n_one :]
    one, other = (
        fit.moved_to(fit.evidence.posterior.x + step, fit.evidence.posterior.covariance - shrink)
        for fit, step, shrink in zip((one, other), steps, shrinks, strict=True)
    )
    return one, other


def _lengths(evidence: Evidence, bones: list[str]) -> tuple[Array, Array, Array]:
    """Lengths (B,), their covariance with the unknowns (B, G) and with each other (B, B)."""
    posterior, amounts = evidence.posterior, [evidence.model.length[name] for name in bones]
    rows = np.array([amount.row(len(posterior.x)) for amount in amounts]).reshape(-1, len(posterior.x))
    lengths = np.array([posterior.of_amount(amount)[0] for amount in amounts])
    with_unknowns = rows @ posterior.covariance
    return lengths, with_unknowns, with_unknowns @ rows.T
