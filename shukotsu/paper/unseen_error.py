"""Covariance of a joint centre due to errors that the data cannot show: skin motion and receiver placement.

docs/method.md, "Uncertainty".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shukotsu.hand.average_hand import BONE_KINDS, DIGITS, PRIOR
from shukotsu.hand.rotations import Array, cross_matrix, nearest_rotation
from shukotsu.study.layout import Joint, Layout

if TYPE_CHECKING:
    from shukotsu.paper.joint_solution import JointSolution
    from shukotsu.paper.plane import Projection

MARGIN = 1.7
"""Factor by which skin motion and receiver misplacement may exceed the tabulated sizes.

Set on simulated hands: with it the stated 95 % hold for another law of skin motion, and for receivers
misplaced by twice the tabulated sizes.
"""

TYPICAL_GAP_MM = 1.0
"""Rms gap of a joint under typical skin motion; a larger gap scales the assumed skin motion up in proportion.
"""

NEIGHBOUR_RANGE_DEG = 30.0
"""Range of a neighbouring joint's motion that is correlated with that of the joint.

It moves the skin of both receivers, which displaces the centre more if the joint itself moves less.
"""

COMPOUND_SD_MM = 6.0
"""Three-dimensional standard deviation of a centre solved across a moving bone without a receiver.

Set on simulated hands.
"""

UNKNOWN_PLACE_SD_MM = 5.0
"""Standard deviation of a receiver's lateral position on a segment without tabulated anatomy (our choice)."""


def unseen_covariance(joint: Joint, layout: Layout, placed: Projection, solution: JointSolution) -> Array:
    """Compute the covariance of a centre due to errors that cause neither scatter nor a gap.

    These are skin motion and receiver placement (docs/method.md, "Uncertainty"). Both halves have the same
    error, as they coincide.

    Parameters
    ----------
    joint, layout : Joint, Layout
        The joint and the layout of the hand.
    placed : Projection
        The centre on its plane.
    solution : JointSolution
        The joint as solved.

    Returns
    -------
    array, shape (6, 6)
        Covariance of (p, q), mm^2.

    """
    to_parent, axis = nearest_rotation(solution.mean_rotation), solution.null_child
    slides = [
        _slide_covariance(segment, layout, half_mm, _looseness(segment, layout, solution.gap_rms_free_mm))
        for segment, half_mm in ((joint.parent_receiver, placed.p_mm), (joint.child, placed.q_mm))
    ]
    turn = cross_matrix(axis)
    neighbours = 1.0 + (NEIGHBOUR_RANGE_DEG / max(solution.range_deg, 1.0)) ** 2
    skin_mm2 = turn @ (to_parent.T @ slides[0] @ to_parent + slides[1]) @ turn.T
    if joint.compound:
        skin_mm2 += COMPOUND_SD_MM**2 / 3 * np.eye(3)
    skin_mm2 = neighbours * skin_mm2 + _along_variance_mm2(joint, layout, placed) * np.outer(axis, axis)
    both = np.vstack([to_parent, np.eye(3)])
    return np.asarray(both @ skin_mm2 @ both.T)


def _looseness(segment: str, layout: Layout, gap_rms_mm: float) -> float:
    """Return the factor on a segment's tabulated skin motion, from the gap and the margin."""
    if _is_known(segment, layout):
        return MARGIN * max(1.0, gap_rms_mm / TYPICAL_GAP_MM)
    return max(1.0, gap_rms_mm / PRIOR.UNKNOWN_SLIDE_SD_MM)


def _along_variance_mm2(joint: Joint, layout: Layout, placed: Projection) -> float:
    """Return the variance, mm^2, of the plane's intersection along the axis; 0 if the joint has no plane."""
    if placed.axis_plane_deg is None:
        return 0.0
    in_parent = joint.plane.frame == "parent"
    segment = joint.parent_receiver if in_parent else joint.child
    place_mm2 = UNKNOWN_PLACE_SD_MM**2
    if _is_known(segment, layout):
        lever_mm = float(np.linalg.norm(placed.p_mm if in_parent else placed.q_mm))
        place_mm2 = MARGIN**2 * (PRIOR.MOUNT_SD_MM[1] ** 2 + (PRIOR.MOUNT_TURN_SD_RAD * lever_mm) ** 2)
    return place_mm2 / float(np.sin(np.radians(placed.axis_plane_deg))) ** 2


def _is_known(segment: str, layout: Layout) -> bool:
    """Return whether the anatomy tables cover the segment: the hand itself, or a bone of a digit."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return True
    digit, _, kind = segment.rpartition("_")
    return digit in DIGITS and kind in BONE_KINDS and (digit, kind) != ("thumb", "middle")


def _slide_covariance(segment: str, layout: Layout, lever_mm: Array, looseness: float) -> Array:
    """Return the covariance (3, 3), mm^2 per rad^2, of a point due to its receiver's skin motion.

    lever_mm : (3,) the point in the receiver's frame. looseness : factor on tabulated skin motion.
    """
    if layout.wrist is not None and segment == layout.wrist.segment:
        return np.asarray((looseness * PRIOR.PALM_SLIDE_SD_MM) ** 2 * np.eye(3))
    if not _is_known(segment, layout):
        return np.asarray((looseness * PRIOR.UNKNOWN_SLIDE_SD_MM) ** 2 * np.eye(3))
    if segment == "thumb_metacarpal":
        looseness *= PRIOR.JOINTWISE_THENAR
    elif segment.endswith("_distal"):
        looseness *= PRIOR.JOINTWISE_NAIL
    axes, cross = layout.segments[segment].axes, cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(PRIOR.JOINTWISE_SLIDE_SD_MM)) @ axes.T
    return np.asarray(looseness**2 * (slide + PRIOR.JOINTWISE_TILT_SD**2 * cross @ cross.T))
