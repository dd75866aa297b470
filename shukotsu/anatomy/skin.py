"""Compute how far moving skin may carry a joint's centre, as the receivers beside it see it.

A receiver that slides and tilts on its bone in step with a joint's angle sees the centre move in its frame
by (slide + tilt x lever) per rad. The numbers are those of `anatomy.average_hand`, without the simulator's.
"""

from __future__ import annotations

import numpy as np

from shukotsu.anatomy.average_hand import (
    BONE_KINDS,
    DIGITS,
    JOINTWISE_NAIL,
    JOINTWISE_SLIDE_SD_MM,
    JOINTWISE_THENAR,
    JOINTWISE_TILT_SD,
    PALM_SLIDE_SD_MM,
    UNKNOWN_SLIDE_SD_MM,
)
from shukotsu.schemas.layout import Layout
from shukotsu.skeleton.rotations import Array, cross_matrix


def is_known(segment: str, layout: Layout) -> bool:
    """Say whether anatomy knows the segment: the hand itself, or a bone of one of its digits."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return True
    digit, _, kind = segment.rpartition("_")
    return digit in DIGITS and kind in BONE_KINDS and (digit, kind) != ("thumb", "middle")


def slide_covariance(segment: str, layout: Layout, lever_mm: Array, looseness: float) -> Array:
    """Covariance (3, 3), mm^2 per rad^2, of the motion of a point on a bone seen by its receiver.

    lever_mm : (3,) the point in the receiver's frame. looseness : of the skin, 1 for a typical one.
    """
    if layout.wrist is not None and segment == layout.wrist.segment:
        return np.asarray((looseness * PALM_SLIDE_SD_MM) ** 2 * np.eye(3))
    if not is_known(segment, layout):
        return np.asarray((looseness * UNKNOWN_SLIDE_SD_MM) ** 2 * np.eye(3))
    if segment == "thumb_metacarpal":
        looseness *= JOINTWISE_THENAR
    elif segment.endswith("_distal"):
        looseness *= JOINTWISE_NAIL
    axes, cross = layout.segments[segment].axes, cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(JOINTWISE_SLIDE_SD_MM)) @ axes.T
    return np.asarray(looseness**2 * (slide + JOINTWISE_TILT_SD**2 * cross @ cross.T))
