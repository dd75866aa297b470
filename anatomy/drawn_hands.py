"""The hands that the simulator draws: their bones, how they differ, where receivers sit, how skin moves them.

No estimator reads this module, and the simulator reads nothing of `anatomy.average_hand`: an estimator that
is judged on people drawn from its own table cannot be seen to be wrong (tests/anatomy).

Frame of the hand: right hand, x distal, y towards the thumb, z dorsal; mm; its origin is the wrist centre.
All lengths grow with one scale; a left hand is the mirror image.

Sources: Buryanov & Kotiuk 2010 (X-ray, 66 adults, joint to joint); Buchholz et al. 1992; MyoHand (Apache-2.0,
its numbers turned into this frame); Chang & Pollard 2008; Hollister et al. 1992; El-shennawy et al. 2001;
Yang et al. 2002; Zhang et al. 2003; Metcalf et al. 2020. "Ours": chosen by us, from trials or by judgement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skeleton.rotations import Array, unit

Vector = tuple[float, float, float]

# --- whole hands, by source ------------------------------------------------------------------------------


@dataclass(frozen=True)
class DrawnDigit:
    """A digit from the joint at its base outward, straight, in the hand's frame; B bones.

    base_mm : (3,) its first joint, the CMC. directions : (B, 3) unit vectors along the bones, distally.
    lengths_mm : (B,) to the next joint, or to the last bone's tip. flexion_axes : (B, 3) axes of the
    joints at the bones' proximal ends. soft_tip_mm : skin and pulp beyond the last bone. second_axis : (3,)
    of the thumb's CMC, which is skew; None for a finger.
    """

    base_mm: Array
    directions: Array
    lengths_mm: Array
    flexion_axes: Array
    soft_tip_mm: float
    second_axis: Array | None = None


DrawnHand = Mapping[str, DrawnDigit]
"""A whole hand: its digits by name, the thumb first."""


def _digit(
    base_mm: Vector,
    points_mm: tuple[Vector, ...],
    flexion_axes: tuple[Vector, ...],
    lengths_mm: tuple[float, ...],
    soft_tip_mm: float,
    second_axis: Vector | None = None,
) -> DrawnDigit:
    """A digit from points after its base, of which only the directions between them are used."""
    return DrawnDigit(
        np.array(base_mm),
        unit(np.diff(np.vstack([base_mm, points_mm]), axis=0)),
        np.array(lengths_mm),
        np.array(flexion_axes),
        soft_tip_mm,
        None if second_axis is None else np.array(second_axis),
    )


MIXED_TABLE: DrawnHand = {
    "thumb": _digit(
        (25.0, 26.5, -10.5),
        ((54.2, 43.0, -23.2), (80.1, 57.0, -33.3), (100.1, 67.0, -41.3)),
        ((-0.732, 0.496, 0.468), (-0.203, 0.084, -0.975), (-0.480, 0.050, -0.876)),
        (46.22, 31.57, 21.67),
        5.67,
        (0.665, -0.042, 0.745),
    ),
    "index": _digit(
        (13.5, 10.6, 2.0),
        ((80.9, 22.2, 11.0), (122.2, 29.7, 18.3), (147.1, 33.0, 19.5), (165.1, 35.0, 19.5)),
        ((-0.10, 0.995, 0.0),) * 4,
        (68.12, 39.78, 22.38, 15.82),
        3.84,
    ),
    "middle": _digit(
        (13.5, 0.0, 3.0),
        ((80.6, 4.7, 11.5), (124.8, 6.4, 17.7), (153.8, 7.7, 19.7), (172.8, 9.7, 18.7)),
        ((0.0, 1.0, 0.0),) * 4,
        (64.60, 44.63, 26.33, 17.40),
        3.95,
    ),
    "ring": _digit(
        (13.5, -10.8, 2.0),
        ((79.3, -9.9, 5.7), (119.5, -13.4, 7.0), (144.3, -15.7, 7.6), (162.3, -16.7, 8.6)),
        ((0.0, 0.90, 0.43),) * 4,
        (58.00, 41.37, 25.65, 17.30),
        3.95,
    ),
    "little": _digit(
        (13.5, -18.7, -1.0),
        ((71.2, -19.5, -3.4), (106.7, -24.8, -6.3), (127.4, -27.7, -8.5), (144.4, -28.7, -11.5)),
        ((0.0, 0.825, 0.565),) * 3 + ((0.227, 0.643, 0.731),),
        (53.69, 32.74, 18.11, 15.96),
        3.73,
    ),
}
"""Bones from joint space to joint space (Buryanov & Kotiuk) taken for distances of centres, bases by shares
of the hand that belong to the thumb (Buchholz), the rest from MyoHand, whose origin lies elsewhere."""

SKEW_MM, SKEW_DEG = 4.6, 87.0
"""The thumb's CMC axes pass each other at this distance and angle (Chang & Pollard), the abduction axis on
the metacarpal's side (Hollister)."""

PRO_SUPINATION = 0.8
"""Pro-supination per flexion of CMC 4 and 5: ranges of 27 and 22 deg over 20 and 27 (El-shennawy)."""

WRIST_AXES = ((0.10, 0.97, 0.22), (-0.10, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Axes of flexion, abduction and axial rotation of the wrist, in the hand's frame (ours)."""

PAD_DEPTH_MM = {"thumb": 8.0, "index": 6.5, "middle": 6.5, "ring": 6.5, "little": 6.0}
"""Of the pad that touches under the line of joints (ours)."""

# --- how hands differ ------------------------------------------------------------------------------------

SCALE_SD = 0.08
"""Of the hand's size among adults (Buryanov & Kotiuk: sd of the longest bones over their means)."""

LENGTH_SD = 0.05
"""Of a bone's length, relative, once the hand's size is known (same source: lengths correlate strongly)."""

SIDE_SD, SIDE_LIMIT = 0.0012, 0.0024
"""Of a bone's length, relative, between the two hands of a person, who differ by less than 0.5 %."""

BASE_SD_MM = 1.0
"""Of a metacarpal's base (ours)."""

DIRECTION_SD_RAD = 0.03
"""Of a digit's direction in the flat hand, either way (ours: neighbours lie 5 to 8 deg apart)."""

AXIS_SD_RAD = 0.05
"""Of a joint's axis either way."""

PRO_SUPINATION_SD = 0.15
"""Of the pro-supination per flexion (ours)."""

WOBBLE_SD_RAD = 0.05
"""Abduction and axial rotation of a hinge at 90 deg of flexion: its helical axis varies by about 5 deg."""

AXIAL_COUPLING = (0.10, 0.05, 0.05)
"""Axial rotation of MCP joints and the thumb's CMC: per abduction, the sd of that, sd per flexion (ours)."""

# --- where receivers sit ---------------------------------------------------------------------------------

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")
HEIGHT_MM = (8.5, 8.0, 7.0, 6.0)
"""Of a receiver over the line of joints, by kind of bone: half the thickness of the finger there and half
the receiver's housing (ours)."""

MOUNT_SD_MM = (3.2, 1.6, 1.3)
"""A receiver put on by eye at mid-bone: along the bone, across it, and in height over it (our trials)."""

MOUNT_TURN_DEG = (3.0, 8.0)
"""Least and largest angle by which a receiver is turned away from the bone's axes (our trials)."""

HAND_MOUNT_MM, FOREARM_MOUNT_MM = (35.0, 0.0, 14.0), (-60.0, 0.0, 22.0)
"""Receivers on the back of the hand and on the forearm, from the wrist centre (ours)."""

# --- how skin moves receivers ----------------------------------------------------------------------------
# Markers on a finger keep their spacing to 5 % in a pinch (Yang), 2 mm along a proximal phalanx; excursions
# are linear in flexion with R^2 of 0.89 to 0.97 (Zhang), mostly along the bone, about a millimetre at
# mid-bone. What is drawn saturates and lags, which no estimator assumes.

SLIDE_SD_MM = (1.0, 0.25, 0.4)
"""Of a receiver per rad of an adjacent joint: along, across, in height (Zhang)."""

TILT_SD = (0.03, 0.04, 0.02)
"""Turn of a receiver in rad per rad of an adjacent joint, about x, y, z of its bone (Metcalf)."""

DISTAL_TILT = -0.06
"""Of a distal receiver with its own joint: markers under-read DIP flexion by 11 % (Metcalf), of which the
other half is the middle phalanx's."""

UNDER_READING = (0.20, 0.40)
"""Least and largest share of the CMC's motion that a receiver over the thumb's metacarpal does not follow."""

NAIL = 0.3
"""Of the usual slide and tilt: a distal phalanx's, whose nail holds the receiver (ours)."""

THENAR, LITTLE = 1.6, 1.5
"""The same of the thumb's metacarpal, where muscles swell, and of the little finger (ours)."""

SATURATION_RAD = 0.9
"""Angle towards which the skin's motion with a joint saturates (ours)."""

LAG_S, LAG_SHARE = 0.25, 0.3
"""Time by which skin lags behind its joint, and the share of it that does (ours)."""

WANDER_MM, WANDER_DEG, WANDER_S = 0.3, 0.4, 0.4
"""Sd of a receiver's place and turn that follow no joint, and the time over which they last (ours)."""
