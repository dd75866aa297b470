"""Measure how much a mistake matters: compare joints with it and with it undone."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from shukotsu.checks.expected_body import ExpectedBody
from shukotsu.checks.explanation import Explanation
from shukotsu.checks.sampled_motion import MIRROR, Motion
from shukotsu.sentences.finding_sentences import Values
from shukotsu.skeleton.rotations import Array

MOVED_MM = 2.0
"""A joint whose centre moves farther on its bones is another joint."""
CLOSER = 0.95
"""Share of the median gap below which joints close better."""


@dataclass(frozen=True)
class Joints:
    """A motion's J joints as they are explained. centre_mm : (J, 2, 3) in both receivers. gap_mm : (J,)."""

    motion: Motion
    centre_mm: Array
    gap_mm: Array
    scale: float

    @classmethod
    def of(cls, motion: Motion, explanation: Explanation, row: int = 0) -> Joints:
        """Give those of one hypothesis of an explanation."""
        scale = float(explanation.scale[row])
        return cls(motion, explanation.centre_mm[row], explanation.gap_mm[row], scale)


def effect(
    body: ExpectedBody,
    before: Joints,
    after: Joints,
    places: Collection[int] | None = None,
    *,
    other_hand: bool = False,
) -> Values:
    """Compare joints without a mistake: the joints' median gap, how many of them move, the hand's scale.

    places : the receivers concerned, whose joints count; None: all. other_hand : whether undoing it mirrors
    the world.
    """
    own = np.isin(body.ends, list(places)).any(1) if places else np.ones(len(body.names), bool)
    own = own if own.any() else ~own
    gaps = [float(np.median(joints.gap_mm[own])) for joints in (before, after)]
    moved = (_apart_mm(body, before, after, mirrored=other_hand)[own] > MOVED_MM).sum()
    values: dict[str, float | int | str] = {
        "effect": "closer" if gaps[1] < CLOSER * gaps[0] else "no-closer" if moved else "none",
        "gap_before_mm": gaps[0],
        "gap_after_mm": gaps[1],
        "moved": int(moved),
        "joints": int(own.sum()),
    }
    if body.known.any():
        values |= {"scale_before": before.scale, "scale_after": after.scale}
    return values


def _apart_mm(body: ExpectedBody, before: Joints, after: Joints, *, mirrored: bool) -> Array:
    """Return how far (J,) the joints move from their receivers, in the world's axes; the receiver that sees
    more.
    """
    signs = MIRROR if mirrored else np.ones(3)
    one, other = (
        np.einsum("kjeab,jeb->kjea", joints.motion.rotation[:, body.ends], joints.centre_mm)
        for joints in (before, after)
    )
    apart = np.linalg.norm(one - signs * other, axis=-1)
    apart[~before.motion.valid[:, body.ends]] = np.nan
    seen = np.isfinite(apart).any(0)
    return np.asarray(np.where(seen, np.nanmedian(np.where(seen, apart, 0.0), axis=0), 0.0).max(-1))
