"""Define how near two fingertips come, and when they touch."""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.rotations import Array

CONTACT_MM = 14.0
"""Ends of two digits' skin that are nearer touch: a thumb's pulp, 7.5 mm thick, on a finger's of 6.5 mm."""

RELEASE_MM = 18.0
"""A contact lasts until they are farther apart: a distance that wavers about one threshold is one contact."""


def contacts(distance_mm: Array) -> Array:
    """Tell whether two tips touch (T,), from their distance (T,); in a gap they do not, and after it anew."""
    known = ~np.isnan(distance_mm)
    decides = ~known | (distance_mm < CONTACT_MM) | (distance_mm > RELEASE_MM)
    last = np.maximum.accumulate(np.where(decides, np.arange(len(distance_mm)), -1))
    return np.asarray((last >= 0) & known[last] & (distance_mm[last] < CONTACT_MM))


def contact_count(touching: Array) -> int:
    """Count how often a contact begins in (T,)."""
    return int(np.diff(np.concatenate([[0], np.asarray(touching, np.int8)])).clip(0).sum())
