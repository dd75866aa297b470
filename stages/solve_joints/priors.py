"""What anatomy says of a joint before it moves: where its centre lies in its receivers, and how surely.

The tables hold an average adult right hand; a left hand is its mirror image, and a hand of another size is
scaled. A segment that they do not know gets a prior so weak that the data alone decide.

Sources. Bone lengths: mean of Buryanov & Kotiuk 2010 (X-ray, 66 adults, joint to joint) and, for the
phalanges of the fingers, OpenHands 2024 (CT, 10 adults). Places of the joints on the hand and flexion axes:
MyoHand (Apache-2.0; the numbers only); bases of the metacarpals and the carpus' share of the hand's length:
Buchholz et al. 1992. Motion of CMC 2-5: El-shennawy et al. 2001. Published helical axes of DIP and PIP joints
vary by 5 deg.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Array, unit
from schemas.layout import Joint, Layout, Segment

AVERAGE_HAND_LENGTH_MM = 173.0
"""Of the hand in these tables: its middle finger's bones with 7.3 % for the carpus (Buchholz)."""

MEASURED_SCALE_SD, FREE_SCALE_SD, BONE_SD = 0.03, 0.08, 0.05
"""Relative: a hand's size with and without its length measured; one bone beside the hand's size."""

LENGTH_MM = {
    "thumb": (46.2, 31.6, 21.7),
    "index": (68.1, 40.4, 23.8, 16.9),
    "middle": (64.6, 45.4, 28.3, 18.3),
    "ring": (58.0, 42.1, 27.3, 18.5),
    "little": (53.7, 33.5, 19.4, 17.1),
}
_BONES = ("metacarpal", "proximal", "middle", "distal")
_THUMB_BONES = ("metacarpal", "proximal", "distal")

HEIGHT_MM = {"metacarpal": 8.0, "proximal": 7.5, "middle": 7.0, "distal": 6.5}
"""Of a receiver above the line between the joints: half a finger's depth and half a receiver."""

_POINTS_MM = {  # ends of the bones, base to tip, from the wrist centre: distal, radial, dorsal
    "thumb": ((25.0, 26.5, -10.5), (54.2, 43.0, -23.2), (80.1, 57.0, -33.3), (100.1, 67.0, -41.3)),
    "index": (
        *((12.6, 10.6, 2.0), (80.9, 22.2, 11.0), (122.2, 29.7, 18.3), (147.1, 33.0, 19.5)),
        (165.1, 35.0, 19.5),
    ),
    "middle": (
        *((12.6, 0.0, 3.0), (80.6, 4.7, 11.5), (124.8, 6.4, 17.7), (153.8, 7.7, 19.7)),
        (172.8, 9.7, 18.7),
    ),
    "ring": (
        *((12.6, -10.8, 2.0), (79.3, -9.9, 5.7), (119.5, -13.4, 7.0), (144.3, -15.7, 7.6)),
        (162.3, -16.7, 8.6),
    ),
    "little": (
        *((12.6, -18.7, -1.0), (71.2, -19.5, -3.4), (106.7, -24.8, -6.3), (127.4, -27.7, -8.5)),
        (144.4, -28.7, -11.5),
    ),
}
_AXES = {  # of flexion of the joint before each bone, same frame
    "thumb": ((-0.732, 0.496, 0.468), (-0.203, 0.084, -0.975), (-0.480, 0.050, -0.876)),
    "index": ((-0.10, 0.995, 0.0),) * 4,
    "middle": ((0.0, 1.0, 0.0),) * 4,
    "ring": ((0.0, 0.90, 0.43),) * 4,
    "little": ((0.0, 0.825, 0.565),) * 3 + ((0.227, 0.643, 0.731),),
}
CMC_RANGE_DEG = {"index": 11.0, "middle": 7.0, "ring": 20.0, "little": 27.0}

MOUNT_SD_MM = (3.0, 1.5, 1.5)
"""Of a receiver about mid-bone: along, lateral, dorsal. Where somebody sticks it by eye."""

MOUNT_SD_RAD = float(np.radians(4.0))
HAND_SD_MM = (8.0, 5.0, 4.0)
BASE_SD_MM = 2.5
"""Of a joint on the hand, beside the hand's size."""

AXIS_SD_RAD = float(np.radians(5.0))
UNKNOWN_SD_MM = 500.0


@dataclass(frozen=True)
class Bone:
    """A bone of the average hand, right or left, in the hand's frame (x distal, z dorsal).

    frame : (3, 3) its own axes (x along it, y a flexion axis made perpendicular, z dorsal) as columns;
    start_mm : (3,) its proximal joint from the wrist centre; axis : (3,) unit flexion axis of that joint.
    digit, kind : as in the segment's name.
    """

    digit: str
    kind: str
    frame: Array
    start_mm: Array
    length_mm: float
    axis: Array

    @property
    def mount_mm(self) -> Array:
        """The receiver's place in the bone's frame: mid-bone, above the line between the joints."""
        return np.array([self.length_mm / 2, 0.0, HEIGHT_MM[self.kind]])


def average_bones(hand: str, *, thumb_faces_nail: bool = False) -> dict[str, Bone]:
    """Give the bones of an average hand by segment; a left hand is the mirror image of a right one.

    thumb_faces_nail : whether the frame of the thumb's metacarpal faces as those of its phalanges do, y
    nearest the MCP joint's axis (`kinematics.thumb_facing`).
    """
    mirror = np.array([1.0, -1.0, 1.0]) if hand == "left" else np.ones(3)
    bones = {}
    for digit, points in _POINTS_MM.items():
        ends = np.array(points) * mirror
        axes = unit(np.array(_AXES[digit])) * mirror * (-1.0 if hand == "left" else 1.0)
        across = axes[[1, 1, 2]] if digit == "thumb" and thumb_faces_nail else axes
        for i, kind in enumerate(_THUMB_BONES if digit == "thumb" else _BONES):
            x = unit(ends[i + 1] - ends[i])
            y = unit(across[i] - (across[i] @ x) * x)
            frame = np.stack([x, y, np.cross(x, y)], -1)
            bones[f"{digit}_{kind}"] = Bone(digit, kind, frame, ends[i], LENGTH_MM[digit][i], axes[i])
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
        p_fixed, p = nominal_mm, receiver_axes(parent) @ below.start_mm
        sweep = receiver_axes(parent) @ _sweep_mm(joint, below, bones)
    elif above is not None:
        end = np.array([above.length_mm, 0.0, 0.0])
        p = receiver_axes(parent) @ (end - above.mount_mm)
    if below is not None:
        q = receiver_axes(child) @ -below.mount_mm
    elif joint.child == hand:
        q_fixed = nominal_mm
    parent_frame = above.frame if above is not None else np.eye(3)
    knows_parent = on_hand or above is not None
    return JointPrior(
        p_fixed,
        p,
        q_fixed,
        q,
        receiver_axes(parent) @ parent_frame.T @ below.axis if knows_parent and below else None,
        receiver_axes(child) @ below.frame.T @ below.axis if below else None,
        sweep,
        knows_parent,
        below is not None or joint.child == hand,
    )


def _sweep_mm(joint: Joint, below: Bone, bones: Mapping[str, Bone]) -> Array:
    """How far (3,) the metacarpal's own motion takes its MCP joint, hand's frame; zero for other joints."""
    between = bones.get(joint.parent)
    if between is None or below.kind != "proximal" or below.digit not in CMC_RANGE_DEG:
        return np.zeros(3)
    turn = np.radians(CMC_RANGE_DEG[below.digit]) * between.axis
    return np.asarray(np.cross(turn, below.start_mm - between.start_mm))


def receiver_axes(segment: Segment) -> Array:
    """(3, 3) from the bone's axes (distal, lateral, dorsal) to the receiver's."""
    return np.stack([segment.distal, segment.lateral, segment.dorsal], -1)
