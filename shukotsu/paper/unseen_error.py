"""Model a centre's error that no frame shows: skin that moves in step with it, receivers beside the bone.

The gap's scatter, which the joint solve states, knows neither. Skin that slides by c mm per rad of the joint
moves a solved centre by c mm across the axis and leaves no gap; a plane through a receiver that sits beside
its bone moves it along the axis (docs/method.md, "what the uncertainty says").
"""

from __future__ import annotations

import numpy as np

from shukotsu.hand import average_hand as average
from shukotsu.hand.rotations import Array, cross_matrix, nearest_rotation
from shukotsu.paper.plane import Projection
from shukotsu.study.layout import Joint, Layout

MARGIN = 1.7
"""By which other people's skin and mounts may exceed the tabulated ones (ours: with it the stated 95 % hold
for skins of another law and receivers misplaced twice as far)."""

TYPICAL_GAP_MM = 1.0
"""Rms gap of a joint under typical skin; skin that leaves a larger one is taken to slide as much farther."""

NEIGHBOUR_RANGE_DEG = 30.0
"""Range of a neighbour's motion that goes with the joint's own: it moves the skin of both, and the less the
joint itself moves, the farther that moves its centre."""

COMPOUND_SD_MM = 6.0
"""In 3-D, of a centre across a bone that moves and carries no receiver (ours: hands of the simulator)."""

UNKNOWN_PLACE_SD_MM = 5.0
"""Sd of a receiver beside a bone that is not of a hand (ours)."""


def unseen_covariance(
    joint: Joint,
    layout: Layout,
    placed: Projection,
    axes: tuple[Array, Array],
    mean_rotation: Array,
    gap_rms_mm: float,
    range_deg: float,
) -> Array:
    """Covariance (6, 6) mm^2 of the centre's two halves that neither scatter nor gap shows.

    axes : (3,) unit in both frames. mean_rotation : (3, 3) child to parent. gap_rms_mm : of the unconstrained
    fit. Both halves are off by the same vector, as they coincide.
    """
    to_parent = nearest_rotation(mean_rotation)
    slides = [
        _slide_covariance(segment, layout, half_mm, _looseness(segment, layout, gap_rms_mm))
        for segment, half_mm in ((joint.parent_receiver, placed.p_mm), (joint.child, placed.q_mm))
    ]
    turn = cross_matrix(axes[1])
    neighbours = 1.0 + (NEIGHBOUR_RANGE_DEG / max(range_deg, 1.0)) ** 2
    skin_mm2 = turn @ (to_parent.T @ slides[0] @ to_parent + slides[1]) @ turn.T
    if joint.compound:
        skin_mm2 += COMPOUND_SD_MM**2 / 3 * np.eye(3)
    skin_mm2 = neighbours * skin_mm2 + _along_variance_mm2(joint, layout, placed) * np.outer(axes[1], axes[1])
    both = np.vstack([to_parent, np.eye(3)])
    return np.asarray(both @ skin_mm2 @ both.T)


def _looseness(segment: str, layout: Layout, gap_rms_mm: float) -> float:
    if _is_known(segment, layout):
        return MARGIN * max(1.0, gap_rms_mm / TYPICAL_GAP_MM)
    return max(1.0, gap_rms_mm / average.UNKNOWN_SLIDE_SD_MM)


def _along_variance_mm2(joint: Joint, layout: Layout, placed: Projection) -> float:
    """Variance of the place on the axis at which the plane cuts it; nothing where no plane does."""
    if placed.axis_plane_deg is None:
        return 0.0
    in_parent = joint.plane.frame == "parent"
    segment = joint.parent_receiver if in_parent else joint.child
    place_mm2 = UNKNOWN_PLACE_SD_MM**2
    if _is_known(segment, layout):
        lever_mm = float(np.linalg.norm(placed.p_mm if in_parent else placed.q_mm))
        place_mm2 = MARGIN**2 * (average.MOUNT_SD_MM[1] ** 2 + (average.MOUNT_TURN_SD_RAD * lever_mm) ** 2)
    return place_mm2 / float(np.sin(np.radians(placed.axis_plane_deg))) ** 2


def _is_known(segment: str, layout: Layout) -> bool:
    """Whether anatomy knows the segment: the hand itself, or a bone of one of its digits."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return True
    digit, _, kind = segment.rpartition("_")
    return digit in average.DIGITS and kind in average.BONE_KINDS and (digit, kind) != ("thumb", "middle")


def _slide_covariance(segment: str, layout: Layout, lever_mm: Array, looseness: float) -> Array:
    """Covariance (3, 3), mm^2 per rad^2, of a point's motion seen by its receiver, at lever_mm (3,)."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return np.asarray((looseness * average.PALM_SLIDE_SD_MM) ** 2 * np.eye(3))
    if not _is_known(segment, layout):
        return np.asarray((looseness * average.UNKNOWN_SLIDE_SD_MM) ** 2 * np.eye(3))
    if segment == "thumb_metacarpal":
        looseness *= average.JOINTWISE_THENAR
    elif segment.endswith("_distal"):
        looseness *= average.JOINTWISE_NAIL
    axes, cross = layout.segments[segment].axes, cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(average.JOINTWISE_SLIDE_SD_MM)) @ axes.T
    return np.asarray(looseness**2 * (slide + average.JOINTWISE_TILT_SD**2 * cross @ cross.T))
