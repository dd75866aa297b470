"""The average adult hand as the estimators expect it: how hands differ, where receivers sit, how skin moves.

What estimators weigh recordings against. The simulator reads none of it: `anatomy.drawn_hands` says whom it
draws. Who reads what: tests/hand/test_drawn_hands.py.

Frame of the hand: right hand, origin at the wrist centre, which is the centre of the capitate's head, x
distal, y towards the thumb, z dorsal; mm. All lengths grow with one scale, 1 for the average hand; a left
hand is the mirror image. A length is one between centres of rotation, which lie inside the heads of the
bones: a bone as an X-ray shows it is 2.5 mm shorter (phalanges) or 7 mm longer (metacarpals).

Sources: CT of ten hands (OpenHands, Munyebvu et al. 2024) and two more with metacarpals (DiffAutoKin), on
whose meshes centres and axes were fitted; MyoHand (Apache-2.0), its numbers turned into this frame; Buryanov
& Kotiuk 2010 (X-ray, 66 adults, joint to joint); Buchholz et al. 1992; Chang & Pollard 2008; Hollister et al.
1992; El-shennawy et al. 2001; Yang et al. 2002; Zhang et al. 2003; Metcalf et al. 2020. "Ours": chosen by us,
from trials or by judgement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shukotsu.hand.rotations import Array, unit

Vector = tuple[float, float, float]

# --- the average hand ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DigitAnatomy:
    """A digit of the average hand, straight, from the joint at its base outward; B bones, hand's frame.

    base_mm : (3,) first joint, the CMC. directions : (B, 3) unit, distally. flexion_axes : (B, 3) unit, of
    the bones' proximal joints. lengths_mm : (B,) between joint centres, the last to the bone's tip.
    soft_tip_mm : skin and pulp beyond it. second_axis : (3,) of a skew first joint. bone_heights_mm : (B,) of
    each bone's back half way along, over the line between its ends. faces_nail : whether a thumb's metacarpal
    faces as the phalanges do (`shukotsu.hand.thumb_facing`).
    """

    base_mm: Array
    directions: Array
    flexion_axes: Array
    lengths_mm: Array
    soft_tip_mm: float
    bone_heights_mm: Array
    second_axis: Array | None = None
    faces_nail: bool = False

    def frames(self) -> Array:
        """Bone frames (B, 3, 3) in the hand's frame, digit straight: x distal, y nearest the flexion axis."""
        x, axes = self.directions, self.flexion_axes.copy()
        if self.faces_nail:
            axes[0] = axes[1]
        y = unit(axes - (axes * x).sum(-1, keepdims=True) * x)
        return np.stack([x, y, np.cross(x, y)], -1)

    def joints_mm(self) -> Array:
        """Joints (B, 3) from the wrist centre, digit straight: bone after bone from the base."""
        bones = self.lengths_mm[:, None] * self.directions
        return np.asarray(self.base_mm + np.cumsum(bones, axis=0) - bones)

    def mounts_mm(self) -> Array:
        """Receivers' places (B, 3), in the bones' frames: on the nail, and half way along others."""
        mounts = np.zeros((len(self.lengths_mm), 3))
        mounts[:, 0] = MOUNT_SHARE * self.lengths_mm
        mounts[-1, 0] = NAIL_SHARE * self.lengths_mm[-1]
        mounts[:, 2] = self.bone_heights_mm + COVER_MM
        return mounts


MOUNT_SHARE, NAIL_SHARE = 0.5, 0.6
"""Share of a bone's length at which its receiver sits; on the last bone the nail draws it distally (ours)."""

NAIL_SLOPE_DEG = 6.0
"""By which the back of a last phalanx falls towards its tip, and a receiver on it: 2.7 mm over the joint, 1.5
half way along (CT)."""

COVER_MM = 3.5
"""Skin and half a receiver's housing, between the bone and the point that is tracked (ours)."""

CAPITATE_TO_CREASE_MM = 6.0
"""The distal wrist crease, from which people measure a hand, lies so far proximal of the wrist centre."""

SOURCE_SCALE = 1.035
"""Of the average hand over the one whose palm is taken: their index proximal phalanges compared."""


def _thumb() -> DigitAnatomy:
    """A straight thumb, its CMC centre half way between its two skew axes, which lie as its saddle does."""
    facet_mm, along = np.array([16.0, 21.0, -10.0]), unit(np.array([0.80, 0.39, -0.44]))
    ip, mcp = (
        unit(axis - (axis @ along) * along)
        for axis in (np.array([-0.57, 0.09, -0.81]), np.array([-0.40, 0.09, -0.91]))
    )
    return DigitAnatomy(
        facet_mm - 1.7 * along,
        np.tile(along, (3, 1)),
        np.array([np.cross(along, ip), mcp, ip]),
        np.array([39.0, 33.8, 25.2]),
        5.7,
        np.array([8.1, 4.7, 1.5]),
        -ip,
    )


def _finger(
    joints_mm: tuple[Vector, Vector, Vector],
    lengths_mm: tuple[float, float, float, float],
    bone_heights_mm: tuple[float, float, float, float],
    soft_tip_mm: float,
    mcp_axis: Vector,
    oblique_deg: tuple[float, float],
    twist_deg: float,
    lean_deg: float,
) -> DigitAnatomy:
    """A finger from its CMC, MCP and PIP joint, of which the palm is taken and the direction beyond it.

    oblique_deg : of the PIP and the DIP axis, distally at the radial end. twist_deg : of the DIP axis after
    the PIP axis. lean_deg : of the distal phalanx towards the radial side.
    """
    cmc, mcp, pip = np.array(joints_mm)
    proximal = middle = unit(pip - mcp)
    lateral = unit(np.array(mcp_axis) - (np.array(mcp_axis) @ middle) * middle)
    dorsal = np.cross(middle, lateral)
    oblique, (twist, lean) = np.radians(oblique_deg), np.radians([twist_deg, lean_deg])
    distal = np.cos(lean) * middle + np.sin(lean) * lateral
    twisted = np.cos(twist) * lateral + np.sin(twist) * dorsal
    twisted = unit(twisted - (twisted @ distal) * distal)
    axes = [
        np.array(mcp_axis),
        np.array(mcp_axis),
        np.cos(oblique[0]) * lateral + np.sin(oblique[0]) * middle,
        np.cos(oblique[1]) * twisted + np.sin(oblique[1]) * distal,
    ]
    directions = np.array([unit(mcp - SOURCE_SCALE * cmc), proximal, middle, distal])
    return DigitAnatomy(
        SOURCE_SCALE * cmc,
        directions,
        unit(np.array(axes)),
        np.array(lengths_mm),
        soft_tip_mm,
        np.array(bone_heights_mm),
    )


DIGITS: Mapping[str, DigitAnatomy] = {
    "thumb": _thumb(),
    "index": _finger(
        ((15.19, 10.16, 1.51), (75.5, 20.3, 10.2), (116.3, 28.3, 17.2)),
        (59.0, 43.7, 24.9, 19.6),
        (8.0, 7.0, 3.8, 1.5),
        3.8,
        (-0.10, 0.995, 0.0),
        (-5.0, -1.3),
        11.1,
        -3.2,
    ),
    "middle": _finger(
        ((15.35, -0.45, 4.24), (74.4, 0.4, 11.3), (118.9, 2.0, 17.2)),
        (58.0, 48.2, 29.4, 21.1),
        (8.0, 7.0, 4.1, 1.4),
        4.0,
        (0.0, 1.0, 0.0),
        (-2.1, -0.8),
        8.1,
        -2.5,
    ),
    "ring": _finger(
        ((16.71, -9.44, 1.97), (73.5, -15.3, 5.0), (112.7, -18.5, 6.1)),
        (52.0, 44.7, 28.2, 21.1),
        (8.0, 6.3, 4.0, 1.6),
        4.0,
        (0.0, 0.90, 0.43),
        (3.0, 1.8),
        -0.9,
        4.4,
    ),
    "little": _finger(
        ((14.67, -15.58, -2.73), (65.1, -24.9, -4.8), (100.1, -30.1, -7.4)),
        (48.0, 36.3, 20.4, 19.1),
        (8.0, 5.4, 3.4, 1.8),
        3.7,
        (0.0, 0.825, 0.565),
        (4.4, 3.3),
        -1.3,
        8.0,
    ),
}
"""Lengths between centres, bone tips, obliquities, twist and lean: CT of three sets of public bone meshes and
X-ray lengths turned into those between centres, pooled. Heights: the same CT; of proximal phalanges and
metacarpals the index's and the thumb's alone. Palm, directions and MCP axes: MyoHand, its knuckles 20, 17 and
16 mm apart as in CT. The thumb's direction, IP and CMC axes: CT of two hands and MyoHand's; its MCP axis
between its IP axis and MyoHand's. Soft tips: Buryanov & Kotiuk."""

AVERAGE_LENGTH_MM = (
    CAPITATE_TO_CREASE_MM
    + float(DIGITS["middle"].base_mm[0] + DIGITS["middle"].lengths_mm.sum())
    + DIGITS["middle"].soft_tip_mm
)
"""Distal wrist crease to the skin of the middle finger's tip, as people measure it; hand of scale 1."""

AVERAGE_BREADTH_MM = 82.0
"""Across the knuckles of digits 2 to 5, skin and all, of a hand of that length (ours, from anthropometry)."""

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")
SKEW_MM, SKEW_DEG = 4.6, 87.0
"""The thumb's CMC axes pass each other at this distance and angle (Chang & Pollard). That which flexes and
extends the thumb, its second axis here, lies in the trapezium, the other in the metacarpal (Hollister; the
saddles of three hands)."""

PRO_SUPINATION = 0.8
"""Pro-supination per flexion of CMC 4 and 5: ranges of 27 and 22 deg over 20 and 27 (El-shennawy)."""

# --- how hands differ ------------------------------------------------------------------------------------

SCALE_SD = 0.08
"""Sd of the hand's size among adults (Buryanov & Kotiuk: sd of the longest bones over their means)."""

SCALE_SD_BY_LENGTH, SCALE_SD_BY_BREADTH = 0.04, 0.06
"""Sd of the skeleton's scale when the hand's length or breadth is known: a crease is not a joint (ours)."""

LENGTH_SD_MM: Mapping[str, float] = {"metacarpal": 2.5, "proximal": 1.4, "middle": 1.2, "distal": 1.4}
"""Sd of a bone's length between people, once the hand's size is known (CT, X-ray; by kind)."""

SOURCE_SD_MM: Mapping[str, float] = {"metacarpal": 3.5, "proximal": 1.3, "middle": 0.9, "distal": 1.3}
"""By how much all lengths of a kind may be off together: how far inside their heads centres lie, of which
sources differ by 2 to 9 mm."""

THUMB_METACARPAL_SD_MM = 3.5
"""Sd of the thumb's first length: where along the bone its CMC axes lie is known to 4 mm."""

BASE_SD_MM = 2.0
"""Sd of a metacarpal's base about that of the average palm (ours; three hands differ by as much)."""

DIRECTION_SD_RAD = float(np.radians(3.0))
"""Sd of a digit's direction in the flat hand, either way (ours: neighbours lie 5 to 8 deg apart)."""

ROLL_SD_RAD, THUMB_ROLL_SD_RAD = np.radians([3.0, 8.0]).tolist()
"""Sd of a digit about its own length (ours); a thumb's nail stands 65 to 85 deg from the hand's back."""

AXIS_SD_RAD = float(np.radians(5.0))
"""Sd of a joint's axis either way: that of a finger's hinge varies by about 5 deg even as it turns."""

SKEW_SD_MM, SKEW_AXIS_SD_RAD = 2.0, float(np.radians(10.0))
"""Sd of the distance of the thumb's CMC axes (Chang & Pollard), and of each: CT and models differ by 20 deg
and more."""

PRO_SUPINATION_SD = 0.35
"""Sd of the pro-supination per flexion (ours)."""

LEAN_SD_RAD = float(np.radians(1.5))
"""Sd of a straight finger's bone beyond a hinge, sideways: joints are set to neutral by eye (ours)."""

JOINT_SLIDE_SD_MM, HINGE_SLIDE_SD_MM = 1.0, 0.4
"""Translation of a joint's centre per rad: an MCP joint's moves by 0.5 to 2 mm over 45 deg, a hinge's by 0.06
to 0.73 mm over its range (PIP joints of cadavers)."""

# --- where receivers sit ---------------------------------------------------------------------------------

MOUNT_SD_MM = (3.5, 2.0, 2.0)
"""A receiver put on by eye: along the bone, across it, and in height over it (our trials; the housings of
receivers are of several heights)."""

HABIT_SHARE = 0.5
"""Share of that variance that all receivers of a hand have in common: one person puts them on (ours)."""

MOUNT_TURN_SD_RAD = float(np.radians(6.0 / np.sqrt(3.0)))
"""6 deg away from the bone's axes in all, per component (our trials)."""

FACING_SD_RAD = float(np.radians(20.0))
"""Sd of the receiver over the thumb's metacarpal about its bone, from the nearer of its two sides (ours)."""

HAND_MOUNT_SD_MM = (8.0, 5.0, 4.0)
"""Sd of the receiver on the back of the hand about its nominal place (ours)."""

# --- how skin moves receivers ----------------------------------------------------------------------------
# Markers on a finger keep their spacing to 5 % in a pinch (Yang), 2 mm along a proximal phalanx; excursions
# are linear in flexion with R^2 of 0.89 to 0.97 (Zhang), mostly along the bone, about a millimetre at
# mid-bone.
# JOINTWISE: assumed of joints that are solved one by one, whose skin has one looseness for the whole hand.

SLIDE_SD_MM, JOINTWISE_SLIDE_SD_MM = (1.0, 0.3, 0.4), (1.0, 0.45, 0.45)
"""Sd of a receiver per rad of an adjacent joint: along, across, in height (Zhang)."""

TILT_SD, JOINTWISE_TILT_SD = (0.03, 0.05, 0.03), 0.05
"""Turn of a receiver in rad per rad of an adjacent joint, about x, y, z of its bone (Metcalf)."""

DISTAL_TILT, DISTAL_TILT_SD = -0.01, 0.02
"""Tilt of a distal receiver with its own joint: markers on skin under-read DIP flexion by 11 % (Metcalf), of
which half is the middle phalanx's; on a nail it is a third of that or less."""

PLACE_LAG, PLACE_LAG_SD = -0.10, 0.12
TURN_LAG, TURN_LAG_SD = -0.15, 0.12
"""Share of the CMC's motion that the place of a receiver over the thumb's metacarpal adds, which is less than
none, and what its turn adds to that: the turn is known to lag by 20 to 40 %, of which slide and tilt take
some; of the place only that it lags less (ours)."""

RELAXED_RAD = float(np.radians(25.0))
"""Flexion of MCP, PIP, DIP and IP joints at which skin is where the receivers were put on: a hand at rest."""

JOINTWISE_NAIL = 0.6
"""Of the usual slide and tilt: a distal phalanx's, whose nail holds the receiver (ours)."""

JOINTWISE_THENAR = 1.5
"""The same of the thumb's metacarpal, where muscles swell (ours)."""

PALM_SLIDE_SD_MM, PALM_TILT_SD, UNKNOWN_SLIDE_SD_MM = 0.5, 0.01, 2.0
"""The same of a receiver on the palm, whose skin is tight, and on a segment that is not known (ours)."""

SKIN_BENT = 0.5
"""Share of a slide that is not linear in the angle: the root of what an R^2 of 0.89 leaves (at best 0.97:
Zhang), with a margin for lag."""

# --- the room --------------------------------------------------------------------------------------------

FIELD_TURN_SD_RAD, FIELD_SLOPE_SD_RAD_PER_MM = float(np.radians(1.0)), float(np.radians(0.3) / 50.0)
"""By how much a room's field turns receivers, per component: all alike, some 0.3 m from the transmitter, and
from place to place (0.3 deg for 50 mm, LIBERTY in laboratories)."""

# --- how joints are held in a recording ------------------------------------------------------------------

PHALANX_DEG, METACARPAL_DEG, PALM_DEG, STILL_PALM_DEG = (30.0, 50.0), (0.0, 30.0), (5.0, 10.0), (0.0, 3.0)
PALM_HELD_SD_RAD = float(np.radians(8.0))
DIP_PER_PIP, DIP_BY_PIP_SD_DEG = 2 / 3, 15.0
ABDUCTION_DEG, AXIAL_DEG, HINGE_DEG = (0.0, 15.0), (0.0, 5.0), (0.0, 3.0)
"""Mean and sd of a joint angle over a recording: flexion of MCP, PIP, DIP and IP joints (0 to 100 deg), of a
thumb's CMC (-30 to 60), of CMC 4 and 5 (ranges 20 and 27) and of CMC 2 and 3 (11 and 7), and of how a person
holds CMC 4 and 5 all along (ours); of a finger's DIP
joint given its PIP joint's, a link of free flexion that breaks on contact; abduction (15 to 25 either way);
axial rotation, which nobody does at will; abduction and axial rotation of a hinge, whose axis varies by about
5 deg as it turns."""

THENAR, LITTLE, NAIL = 1.6, 1.3, 0.6
"""Of the usual slide and tilt of skin: that over the thumb's metacarpal, where muscles swell, over the little
finger, and over a last phalanx, whose nail holds its receiver (ours)."""


def looseness(segment: str) -> float:
    """Return how far skin moves over a segment's bone, 1 for a typical one."""
    if segment == "thumb_metacarpal":
        return THENAR
    return (LITTLE if segment.startswith("little") else 1.0) * (NAIL if segment.endswith("_distal") else 1.0)
