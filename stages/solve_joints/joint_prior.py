"""Predict a joint from anatomy before it moves: where its centre lies in its receivers, and how surely.

The average hand is that of `anatomy.average_hand`; a hand of another size is scaled. A segment that it does
not have gets a prior so weak that the data alone decide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.anatomy.average_hand import BONE_KINDS, CMC_RANGE_DEG, DIGITS
from shukotsu.schemas.layout import Joint, Layout
from shukotsu.skeleton.rotations import Array


@dataclass(frozen=True)
class Bone:
    """A bone of the average hand, right or left, in the hand's frame (x distal, z dorsal).

    frame : (3, 3) its own axes (x along it, y a flexion axis made perpendicular, z dorsal) as columns;
    start_mm : (3,) its proximal joint from the wrist centre; axis : (3,) unit flexion axis of that joint.
    mount_mm : (3,) its receiver's place in the bone's frame. digit, kind : as in the segment's name.
    """

    digit: str
    kind: str
    frame: Array
    start_mm: Array
    length_mm: float
    mount_mm: Array
    axis: Array


def average_bones(hand: str, *, thumb_faces_nail: bool = False) -> dict[str, Bone]:
    """Give the bones of an average hand by segment; a left hand is the mirror image of a right one.

    thumb_faces_nail : whether the frame of the thumb's metacarpal faces as those of its phalanges do, y
    nearest the MCP joint's axis (`shukotsu.skeleton.thumb_facing`).
    """
    mirror = np.array([1.0, -1.0 if hand == "left" else 1.0, 1.0])
    bones = {}
    for digit, average in DIGITS.items():
        thumb = digit == "thumb"
        frames = replace(average, faces_nail=thumb and thumb_faces_nail).frames() * np.outer(mirror, mirror)
        starts = average.joints_mm() * mirror
        axes = average.flexion_axes * mirror * mirror[1]  # mirrored as pseudo-vectors
        kinds = [kind for kind in BONE_KINDS if not (thumb and kind == "middle")]
        lengths, mounts = average.lengths_mm, average.mounts_mm()
        for kind, *own in zip(kinds, frames, starts, lengths, mounts, axes, strict=True):
            bones[f"{digit}_{kind}"] = Bone(digit, kind, *own)
    return bones


@dataclass(frozen=True)
class JointPrior:
    """A joint before it moved, for the average hand, everything in its receivers' frames.

    p_fixed_mm, q_fixed_mm : (3,) the part that no size of the hand changes; p_mm, q_mm : the rest, at size 1.
    axis_parent, axis_child : (3,) unit flexion axis, or None. sweep_mm : (3,) in the parent's frame, how far
    the joint's parent bone, which carries no receiver, can take it; zero where it does.
    knows_parent, knows_child : whether anatomy knows the half at all.
    """

    p_fixed_mm: Array
    p_mm: Array
    q_fixed_mm: Array
    q_mm: Array
    axis_parent: Array | None
    axis_child: Array | None
    sweep_mm: Array
    knows_parent: bool
    knows_child: bool


def joint_prior(joint: Joint, layout: Layout, bones: Mapping[str, Bone]) -> JointPrior:
    """Give the prior of a joint of the layout; bones : of the hand's side."""
    parent, child = layout.segments[joint.parent_receiver], layout.segments[joint.child]
    above, below = bones.get(joint.parent_receiver), bones.get(joint.child)
    p_fixed = p = q_fixed = q = sweep = np.zeros(3)
    hand = layout.wrist.segment if layout.wrist else ""
    nominal_mm = np.array(layout.wrist.nominal_mm) if layout.wrist else np.zeros(3)
    on_hand = joint.parent_receiver == hand and below is not None
    if on_hand and below is not None:
        p_fixed, p = nominal_mm, parent.axes @ below.start_mm
        sweep = parent.axes @ _sweep_mm(joint, below, bones)
    elif above is not None:
        end = np.array([above.length_mm, 0.0, 0.0])
        p = parent.axes @ (end - above.mount_mm)
    if below is not None:
        q = child.axes @ -below.mount_mm
    elif joint.child == hand:
        q_fixed = nominal_mm
    parent_frame = above.frame if above is not None else np.eye(3)
    knows_parent = on_hand or above is not None
    return JointPrior(
        p_fixed,
        p,
        q_fixed,
        q,
        parent.axes @ parent_frame.T @ below.axis if knows_parent and below else None,
        child.axes @ below.frame.T @ below.axis if below else None,
        sweep,
        knows_parent,
        below is not None or joint.child == hand,
    )


def _sweep_mm(joint: Joint, below: Bone, bones: Mapping[str, Bone]) -> Array:
    """Return how far (3,) the metacarpal's own motion takes its MCP joint, hand's frame; zero for others."""
    between = bones.get(joint.parent)
    if between is None or below.kind != "proximal" or below.digit not in CMC_RANGE_DEG:
        return np.zeros(3)
    turn = np.radians(CMC_RANGE_DEG[below.digit]) * between.axis
    return np.asarray(np.cross(turn, below.start_mm - between.start_mm))
