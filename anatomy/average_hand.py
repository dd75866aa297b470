"""The average adult hand as the estimators expect it: how hands differ, where receivers sit, how skin moves.

What estimators weigh recordings against. The simulator reads none of it: `anatomy.drawn_hands` says whom it
draws. Who reads what: tests/anatomy/test_average_hand.py.

Frame of the hand: right hand, origin at the wrist centre, x distal, y towards the thumb, z dorsal; mm. All
lengths grow with one scale, 1 for the average hand; a left hand is the mirror image.

Sources: Buryanov & Kotiuk 2010 (X-ray, 66 adults, joint to joint); Buchholz et al. 1992; MyoHand (Apache-2.0,
its numbers turned into this frame); Chang & Pollard 2008; Hollister et al. 1992; El-shennawy et al. 2001;
Yang et al. 2002; Zhang et al. 2003; Metcalf et al. 2020. "Ours": chosen by us, from trials or by judgement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from skeleton.rotations import Array, unit

Vector = tuple[float, float, float]

# --- the average hand ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DigitAnatomy:
    """A digit of the average hand, from the joint at its base outward.

    base_mm : (3,) first joint, the CMC. points_mm : the joints after it and the tip of a larger hand, of
    which only the directions between them are used. flexion_axes : one per joint, in the hand's frame with
    the digit straight. lengths_mm : one per bone, to the next joint or to the bone's tip. soft_tip_mm : skin
    and pulp beyond the bone's tip. second_axis : of the first joint, where that one is skew. faces_nail :
    whether the frame of the first bone, a thumb's metacarpal, faces as those of the phalanges do, y nearest
    the second joint's axis (`skeleton.thumb_facing`).
    """

    base_mm: Vector
    points_mm: tuple[Vector, ...]
    flexion_axes: tuple[Vector, ...]
    lengths_mm: tuple[float, ...]
    soft_tip_mm: float
    second_axis: Vector | None = None
    faces_nail: bool = False

    def frames(self) -> Array:
        """Bone frames (B, 3, 3) in the hand's frame, digit straight: x distal, y nearest the flexion axis."""
        x = self.directions()
        axes = unit(np.array(self.flexion_axes))
        if self.faces_nail:
            axes[0] = axes[1]
        y = unit(axes - (axes * x).sum(-1, keepdims=True) * x)
        return np.stack([x, y, np.cross(x, y)], -1)

    def directions(self) -> Array:
        """Unit vectors (B, 3) along the bones, distally."""
        return unit(np.diff(np.vstack([self.base_mm, self.points_mm]), axis=0))

    def joints_mm(self) -> Array:
        """Joints (B, 3) from the wrist centre, digit straight: bone after bone from the base."""
        bones = np.array(self.lengths_mm)[:, None] * self.directions()
        return np.asarray(self.base_mm + np.cumsum(bones, axis=0) - bones)


AVERAGE_DIGITS: Mapping[str, DigitAnatomy] = {
    "thumb": DigitAnatomy(
        (25.0, 26.5, -10.5),
        ((54.2, 43.0, -23.2), (80.1, 57.0, -33.3), (100.1, 67.0, -41.3)),
        ((-0.732, 0.496, 0.468), (-0.203, 0.084, -0.975), (-0.480, 0.050, -0.876)),
        (46.22, 31.57, 21.67),
        5.67,
        (0.665, -0.042, 0.745),
    ),
    "index": DigitAnatomy(
        (13.5, 10.6, 2.0),
        ((80.9, 22.2, 11.0), (122.2, 29.7, 18.3), (147.1, 33.0, 19.5), (165.1, 35.0, 19.5)),
        ((-0.10, 0.995, 0.0),) * 4,
        (68.12, 39.78, 22.38, 15.82),
        3.84,
    ),
    "middle": DigitAnatomy(
        (13.5, 0.0, 3.0),
        ((80.6, 4.7, 11.5), (124.8, 6.4, 17.7), (153.8, 7.7, 19.7), (172.8, 9.7, 18.7)),
        ((0.0, 1.0, 0.0),) * 4,
        (64.60, 44.63, 26.33, 17.40),
        3.95,
    ),
    "ring": DigitAnatomy(
        (13.5, -10.8, 2.0),
        ((79.3, -9.9, 5.7), (119.5, -13.4, 7.0), (144.3, -15.7, 7.6), (162.3, -16.7, 8.6)),
        ((0.0, 0.90, 0.43),) * 4,
        (58.00, 41.37, 25.65, 17.30),
        3.95,
    ),
    "little": DigitAnatomy(
        (13.5, -18.7, -1.0),
        ((71.2, -19.5, -3.4), (106.7, -24.8, -6.3), (127.4, -27.7, -8.5), (144.4, -28.7, -11.5)),
        ((0.0, 0.825, 0.565),) * 3 + ((0.227, 0.643, 0.731),),
        (53.69, 32.74, 18.11, 15.96),
        3.73,
    ),
}
"""Lengths of bones and of the soft tip: Buryanov & Kotiuk. Bases: Buchholz, shares of the hand's length
(distal) and breadth (lateral); the thumb's base, the joints and tips after it and the axes: MyoHand."""


def _base_on_line(digit: DigitAnatomy) -> DigitAnatomy:
    """The finger with its base as deep as the line from the wrist centre to its MCP joint, to 0.1 mm."""
    x, y, _ = digit.base_mm
    knuckle = digit.points_mm[0]
    return replace(digit, base_mm=(x, y, round(x * knuckle[2] / knuckle[0], 1)))


DIGITS: Mapping[str, DigitAnatomy] = {
    name: digit if name == "thumb" else _base_on_line(digit) for name, digit in AVERAGE_DIGITS.items()
}
"""As the estimators expect them: how deep a finger's CMC joint lies under the back of the hand is not
published, so it is that of the line from wrist to MCP joint (ours)."""

AVERAGE_LENGTH_MM = (
    DIGITS["middle"].base_mm[0] + sum(DIGITS["middle"].lengths_mm) + DIGITS["middle"].soft_tip_mm
)
"""Wrist centre to the tip of the middle finger, hand of scale 1."""

AVERAGE_BREADTH_MM = 84.0
"""Of the hand to which the lateral offsets of the bases belong (Buchholz)."""

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")
HEIGHT_MM = (8.5, 8.0, 7.0, 6.0)
"""Of a receiver over the line of joints, by kind of bone: half the thickness of the finger there and half
the receiver's housing (ours)."""

SKEW_MM, SKEW_DEG = 4.6, 87.0
"""The thumb's CMC axes pass each other at this distance and angle (Chang & Pollard), the abduction axis on
the metacarpal's side (Hollister)."""

PRO_SUPINATION = 0.8
"""Pro-supination per flexion of CMC 4 and 5: ranges of 27 and 22 deg over 20 and 27 (El-shennawy)."""

CMC_RANGE_DEG = {"index": 11.0, "middle": 7.0, "ring": 20.0, "little": 27.0}
"""Range of flexion of the fingers' CMC joints (El-shennawy)."""

# --- how hands differ ------------------------------------------------------------------------------------

SCALE_SD = 0.08
"""Of the hand's size among adults (Buryanov & Kotiuk: sd of the longest bones over their means)."""

SCALE_SD_BY_LENGTH, SCALE_SD_BY_BREADTH = 0.04, 0.06
"""Of the skeleton's scale when the hand's length or breadth is known: a crease is not a joint (ours)."""

LENGTH_SD = 0.05
"""Of a bone's length, relative, once the hand's size is known (same source: lengths correlate strongly)."""

BASE_SD_MM = 1.5
"""Of a metacarpal's base about its share of the hand's breadth and length (ours)."""

JOINTWISE_BASE_SD_MM = 2.5
"""Of any joint on the hand about its place, the hand's size apart (ours): of an MCP joint, what the base, the
direction and the length of its metacarpal come to, which the joint-by-joint estimator does not tell apart."""

DIRECTION_SD_RAD = float(np.radians(3.0))
"""Of a digit's direction in the flat hand, either way (ours: neighbours lie 5 to 8 deg apart)."""

AXIS_SD_RAD = float(np.radians(5.0))
"""Of a joint's axis either way: that of a finger's hinge varies by about 5 deg even as it turns."""

SKEW_SD_MM = 1.5
"""Of the distance of the thumb's CMC axes (Chang & Pollard)."""

PRO_SUPINATION_SD = 0.35
"""Of the pro-supination per flexion (ours)."""

JOINT_SLIDE_SD_MM = 0.5
"""Translation of a joint's centre per rad: hinge axes of finger joints move by less than 0.75 mm."""

# --- where receivers sit ---------------------------------------------------------------------------------

MOUNT_SD_MM = (3.2, 1.6, 1.3)
"""A receiver put on by eye at mid-bone: along the bone, across it, and in height over it (our trials)."""

MOUNT_TURN_SD_RAD = float(np.radians(6.0 / np.sqrt(3.0)))
"""6 deg away from the bone's axes in all, per component (our trials)."""

HAND_MOUNT_SD_MM = (8.0, 5.0, 4.0)
"""Of the receiver on the back of the hand about its nominal place (ours)."""

# --- how skin moves receivers ----------------------------------------------------------------------------
# Markers on a finger keep their spacing to 5 % in a pinch (Yang), 2 mm along a proximal phalanx; excursions
# are linear in flexion with R^2 of 0.89 to 0.97 (Zhang), mostly along the bone, about a millimetre at
# mid-bone.
# JOINTWISE: assumed by the joint-by-joint estimator, whose skin has one looseness for the whole hand.

SLIDE_SD_MM, JOINTWISE_SLIDE_SD_MM = (1.0, 0.3, 0.4), (1.0, 0.45, 0.45)
"""Of a receiver per rad of an adjacent joint: along, across, in height (Zhang)."""

TILT_SD, JOINTWISE_TILT_SD = (0.03, 0.05, 0.03), 0.05
"""Turn of a receiver in rad per rad of an adjacent joint, about x, y, z of its bone (Metcalf)."""

DISTAL_TILT = -0.11 / 2
"""Of a distal receiver with its own joint: markers under-read DIP flexion by 11 % (Metcalf), of which the
other half is the middle phalanx's."""

UNDER_READING, UNDER_READING_SD = -0.15, 0.12
"""Share of the CMC's motion that a receiver over the thumb's metacarpal adds, which is less than none: it
is known to lag by 20 to 40 %, of which slide and tilt take some."""

JOINTWISE_NAIL = 0.6
"""Of the usual slide and tilt: a distal phalanx's, whose nail holds the receiver (ours)."""

JOINTWISE_THENAR = 1.5
"""The same of the thumb's metacarpal, where muscles swell (ours)."""

PALM_SLIDE_SD_MM, UNKNOWN_SLIDE_SD_MM = 0.5, 2.0
"""The same of a receiver on the palm, whose skin is tight, and on a segment that is not known (ours)."""

SKIN_BENT, JOINTWISE_SKIN_BENT = 0.26, 0.5
"""Share of a slide that is not linear in the angle: the root of what R^2 0.89 to 0.97 leave (Zhang); for the
joint-by-joint estimator of the lowest R^2, with a margin for lag."""

# --- how joints are held in a recording ------------------------------------------------------------------

PHALANX_DEG, METACARPAL_DEG, PALM_DEG = (30.0, 50.0), (0.0, 30.0), (5.0, 10.0)
DIP_PER_PIP, DIP_BY_PIP_SD_DEG = 2 / 3, 15.0
ABDUCTION_DEG, AXIAL_DEG = (0.0, 15.0), (0.0, 5.0)
"""Mean and sd of a joint angle over a recording: flexion of MCP, PIP, DIP and IP joints (0 to 100 deg), of a
thumb's CMC (-30 to 60), of CMC 4 and 5 (ranges 20 and 27); of a finger's DIP joint given its PIP joint's, a
link of free flexion that breaks on contact; abduction (15 to 25 either way); axial rotation,
which nobody does at will."""
