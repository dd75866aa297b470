"""The hands that the simulator draws: their bones, how they differ, where receivers sit, how skin moves them.

No estimator reads this module, and the simulator reads nothing of `anatomy.average_hand`: an estimator that
is judged on people drawn from its own table cannot be seen to be wrong (tests/anatomy). Several published
sources stand here as whole hands, since they disagree by more than people differ.

Frame of the hand: right hand, x distal, y towards the thumb, z dorsal, mm; its origin, the wrist centre, is
the centre of the capitate's head. Lengths are distances between centres of rotation: a CMC joint's centre
lies on the base of the metacarpal, those of the other joints in the head of the bone before. All lengths grow
with one scale; a left hand is the mirror image.

Sources. CT: the mean of ten right hands (OpenHands 2024, Munyebvu et al., doi 10.1007/s10439-024-03560-7) for
the phalanges, two hands (DiffAutoKin) for thumb and index, centres and axes by our own fits of the joint
surfaces. MyoHand (Apache-2.0): one hand's meshes, fitted alike, its numbers turned into this frame. Buryanov
& Kotiuk 2010: X-ray of 66 adults. Buchholz et al. 1992. Chang & Pollard 2008; Hollister et al. 1992;
El-shennawy et al. 2001; Tang 2018; Yang et al. 2002; Zhang et al. 2003; Metcalf et al. 2020; Hess et al.
2013, doi 10.1155/2013/138063. "Ours": chosen by us, from trials or by judgement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.hand.rotations import Array, unit

Vector = tuple[float, float, float]

# --- whole hands, by source ------------------------------------------------------------------------------


@dataclass(frozen=True)
class DrawnDigit:
    """A digit from the joint at its base outward, straight, in the hand's frame; B bones.

    base_mm : (3,) the CMC. directions : (B, 3) unit, distally. lengths_mm : (B,) to the next joint, or the
    last bone's tip; length_sd_mm : (B,) between people of one size. flexion_axes : (B, 3) of the bones'
    proximal joints. soft_tip_mm : skin and pulp. second_axis : (3,) of the thumb's skew CMC.
    """

    base_mm: Array
    directions: Array
    lengths_mm: Array
    length_sd_mm: Array
    flexion_axes: Array
    soft_tip_mm: float
    second_axis: Array | None = None


DrawnHand = Mapping[str, DrawnDigit]
"""A whole hand: its digits by name, the thumb first."""

LENGTH_SD_MM = {
    "thumb": (2.2, 1.5, 1.6),
    "index": (2.5, 1.3, 1.0, 1.2),
    "middle": (2.5, 1.5, 1.2, 1.3),
    "ring": (2.5, 1.4, 1.2, 1.3),
    "little": (2.2, 1.3, 1.2, 1.3),
}
"""Of people's bones once the hand's size is known: published sds less what size explains."""

SOFT_TIP_MM = {"thumb": 5.67, "index": 3.84, "middle": 3.95, "ring": 3.95, "little": 3.73}
SOFT_TIP_SD_MM = 0.6
"""Skin and pulp beyond the bone and its sd between people (Buryanov & Kotiuk)."""


def _digit(
    name: str,
    points_mm: Sequence[Vector],
    flexion_axes: Sequence[Vector] | Array,
    lengths_mm: Sequence[float] | None = None,
    second_axis: Vector | None = None,
    scale: float = 1.0,
) -> DrawnDigit:
    """A digit through its joints and its bone's tip; with lengths, they only say where the bones point."""
    points = scale * np.array(points_mm)
    bones = np.diff(points, axis=0)
    return DrawnDigit(
        points[0],
        unit(bones),
        np.linalg.norm(bones, axis=-1) if lengths_mm is None else np.array(lengths_mm),
        np.array(LENGTH_SD_MM[name]),
        np.array(flexion_axes),
        SOFT_TIP_MM[name],
        None if second_axis is None else np.array(second_axis),
    )


def _across(along: Array, roll_deg: float = 0.0, obliquity_deg: float = 0.0) -> Array:
    """A radial axis square to a bone, its radial end lifted by a roll and moved distally by an obliquity."""
    lateral = unit(np.array([0.0, 1.0, 0.0]) - along[1] * along)
    roll, oblique = np.radians([roll_deg, obliquity_deg])
    square = np.cos(roll) * lateral + np.sin(roll) * np.cross(along, lateral)
    return np.asarray(np.cos(oblique) * square + np.sin(oblique) * along)


# MyoHand: joints and bone tips of its meshes from the centre of the capitate's head, our own fits; axes of
# its model. The hand is 168.1 mm long, to the skin of the middle finger's tip, and is brought to the CT
# hand's 176.
_MYOHAND_SCALE = 176.0 / 168.1
_MYOHAND_POINTS_MM: Mapping[str, tuple[Vector, ...]] = {
    "thumb": ((15.43, 20.77, -9.41), (45.17, 38.56, -23.76), (71.60, 53.08, -34.45), (89.10, 63.19, -41.60)),
    "index": (
        *((15.19, 10.16, 1.51), (72.98, 17.73, 10.02), (113.81, 25.71, 17.04)),
        *((137.76, 28.72, 18.68), (155.71, 31.30, 20.13)),
    ),
    "middle": (
        *((15.35, -0.45, 4.24), (71.88, 0.44, 10.92), (116.35, 2.00, 16.82)),
        *((144.17, 3.56, 18.94), (163.22, 4.62, 19.92)),
    ),
    "ring": (
        *((16.71, -9.44, 1.97), (71.01, -14.48, 4.95), (110.25, -17.69, 6.08)),
        *((134.77, -19.92, 6.81), (153.72, -21.73, 9.55)),
    ),
    "little": (
        *((14.67, -15.58, -2.73), (62.91, -23.87, -4.58), (97.95, -29.05, -7.15)),
        *((118.24, -32.05, -9.08), (135.04, -34.59, -10.35)),
    ),
}
_MYOHAND_AXES: Mapping[str, tuple[Vector, ...]] = {
    "thumb": ((-0.732, 0.496, 0.468), (-0.203, 0.084, -0.975), (-0.480, 0.050, -0.876)),
    "index": ((-0.10, 0.995, 0.0),) * 4,
    "middle": ((0.0, 1.0, 0.0),) * 4,
    "ring": ((0.0, 0.90, 0.43),) * 4,
    "little": ((0.0, 0.825, 0.565),) * 3 + ((0.227, 0.643, 0.731),),
}
_MYOHAND_RADIAL_ABDUCTION = (0.665, -0.042, 0.745)

MYOHAND: DrawnHand = {
    name: _digit(
        name,
        points,
        _MYOHAND_AXES[name],
        second_axis=_MYOHAND_RADIAL_ABDUCTION if name == "thumb" else None,
        scale=_MYOHAND_SCALE,
    )
    for name, points in _MYOHAND_POINTS_MM.items()
}
"""One hand, its joints assembled with gaps, its palm narrow; the thumb's CMC axes lie as its model has
them."""

ROLL_DEG = {"index": 0.0, "middle": 0.0, "ring": 25.5, "little": 34.4}
"""Of a finger's hinges about its long axis, the palm's arch (MyoHand; a CT hand of phalanges has none)."""

# The CT hand, 176 mm long. CMC joints: MyoHand's palm, lengthened to 15.6 mm from the capitate's head to the
# third (half the carpal height of 71 wrists, Tang; sd 1.5), widened by its scale; the thumb's facet level
# with the index's (+0.3 distal), 10.3 radial and 12 palmar of it. MCP joints: depths from MyoHand, 20, 17 and
# 16 mm from one to the next, where MyoHand is narrow (17.3, 16.1, 15.6) and the CT hands have 22.3, 17.6 and
# 16.1.
_CT_CMC_MCP_MM: Mapping[str, tuple[Vector, Vector]] = {
    "index": ((15.5, 10.7, 1.6), (73.0, 20.4, 10.5)),
    "middle": ((15.6, -0.5, 4.4), (73.2, 0.4, 11.4)),
    "ring": ((17.0, -9.9, 2.1), (68.7, -14.7, 5.1)),
    "little": ((15.0, -16.3, -2.8), (62.1, -25.4, -4.8)),
}
_CT_LENGTHS_MM = {
    "thumb": (37.3, 33.8, 25.2),
    "index": (59.0, 43.7, 24.9, 19.6),
    "middle": (58.0, 48.2, 29.4, 21.1),
    "ring": (52.0, 44.7, 28.2, 21.1),
    "little": (48.0, 36.3, 20.4, 19.1),
}
"""From facet to MCP centre, from centre to centre, from the last centre to the bone's tip."""

_CT_HINGES_DEG = {
    "index": (-5.0, -1.3, 11.0, -3.2),
    "middle": (-2.1, -0.8, 8.0, -2.5),
    "ring": (3.0, 1.8, -1.0, 4.4),
    "little": (4.4, 3.3, -1.0, 8.0),
}
"""Obliquity of the PIP axis to the middle phalanx and of the DIP axis to the distal one, twist of the DIP
after the PIP axis, lean of the distal phalanx to the radial side (OpenHands; the twist also in both other
hands)."""

_CT_THUMB_ALONG, _CT_IP_AXIS = (0.81, 0.35, -0.465), (-0.61, 0.11, -0.78)
"""Of a relaxed thumb: its metacarpal, and the axis of its IP joint (means of the two DiffAutoKin hands)."""


def _ct_finger(name: str) -> DrawnDigit:
    """A finger whose phalanges lie in line, as MyoHand's proximal phalanx points, but for the distal one."""
    pip_oblique, dip_oblique, twist, lean = _CT_HINGES_DEG[name]
    roll, axes = ROLL_DEG[name], np.array(_MYOHAND_AXES[name])
    base, knuckle = np.array(_CT_CMC_MCP_MM[name])
    along = MYOHAND[name].directions[1]
    leaning = np.radians(lean)
    distal = np.cos(leaning) * along + np.sin(leaning) * _across(along, roll)
    axes[2], axes[3] = _across(along, roll, pip_oblique), _across(distal, roll + twist, dip_oblique)
    return DrawnDigit(
        base,
        np.array([unit(knuckle - base), along, along, distal]),
        np.array(_CT_LENGTHS_MM[name]),
        np.array(LENGTH_SD_MM[name]),
        axes,
        SOFT_TIP_MM[name],
    )


def _ct_thumb() -> DrawnDigit:
    """A straight thumb; its CMC axes as its saddle lies: of palmar abduction, then of radial."""
    along = unit(np.array(_CT_THUMB_ALONG))
    across = unit(np.array(_CT_IP_AXIS) - (np.array(_CT_IP_AXIS) @ along) * along)
    return DrawnDigit(
        np.array([15.8, 21.0, -10.4]),
        np.tile(along, (3, 1)),
        np.array(_CT_LENGTHS_MM["thumb"]),
        np.array(LENGTH_SD_MM["thumb"]),
        np.array([np.cross(along, across), across, across]),
        SOFT_TIP_MM["thumb"],
        -across,
    )


CT: DrawnHand = {"thumb": _ct_thumb(), **{name: _ct_finger(name) for name in _CT_CMC_MCP_MM}}
"""The hand of our CT fits: the best supported by far, where phalanges are concerned."""

_XRAY_BONES_MM = {
    "thumb": (46.22, 31.57, 21.67),
    "index": (68.12, 39.78, 22.38, 15.82),
    "middle": (64.60, 44.63, 26.33, 17.40),
    "ring": (58.00, 41.37, 25.65, 17.30),
    "little": (53.69, 32.74, 18.11, 15.96),
}
"""From joint space to joint space (Buryanov & Kotiuk)."""

_TO_CENTRES_MM = {
    "thumb": (-9.4, 2.2, 3.0),
    "index": (-8.1, 2.5, 0.5, 2.7),
    "middle": (-7.4, 2.6, 0.1, 2.8),
    "ring": (-6.1, 2.6, 0.3, 2.6),
    "little": (-5.6, 3.0, 0.8, 2.0),
}
"""From a bone to the distance of its joints' centres: phalanges OpenHands, the rest DiffAutoKin and
MyoHand."""

XRAY: DrawnHand = {
    name: replace(
        digit,
        base_mm=0.97 * digit.base_mm,
        lengths_mm=np.array(_XRAY_BONES_MM[name]) + _TO_CENTRES_MM[name],
        flexion_axes=digit.flexion_axes if name == "thumb" else MYOHAND[name].flexion_axes,
    )
    for name, digit in CT.items()
}
"""A pictured hand, flat, 170.6 mm long; where its bones stand and turn is not in the picture and is that of
the CT hand and, of the fingers' axes, of MyoHand."""

# Buchholz: shares of the hand's length (182 mm) and breadth (84 mm), centres of curvature of the heads. MCP
# joints .463 .446 .421 .414 HL from the distal wrist crease (as coded by others), which lies 7.6 mm proximal
# of the capitate's head; CMC joints .126 0 -.129 -.223 HB to the side, depths and spread of the knuckles
# those of the CT hand. Its thumb starts at the flexion axis in the trapezium: its centre, half way between
# the two axes, is 2.3 mm further on, and its metacarpal (.251 HL) so much shorter.
_BUCHHOLZ_CMC_MCP_MM: Mapping[str, tuple[Vector, Vector]] = {
    "index": ((15.6, 10.6, 1.6), (73.7, 20.0, 10.5)),
    "middle": ((15.6, 0.0, 4.4), (72.8, 0.0, 11.4)),
    "ring": ((15.6, -10.8, 2.1), (67.4, -15.0, 5.1)),
    "little": ((15.6, -18.7, -2.8), (62.9, -26.0, -4.8)),
}
_BUCHHOLZ_PHALANGES_MM = {
    "index": (44.6, 26.0, 17.7),
    "middle": (48.4, 30.9, 19.7),
    "ring": (44.4, 30.0, 19.5),
    "little": (37.1, 21.3, 16.9),
}


def _buchholz_finger(name: str) -> DrawnDigit:
    """A straight finger with square hinges."""
    base, knuckle = np.array(_BUCHHOLZ_CMC_MCP_MM[name])
    along = MYOHAND[name].directions[1]
    return DrawnDigit(
        base,
        np.array([unit(knuckle - base), along, along, along]),
        np.array([float(np.linalg.norm(knuckle - base)), *_BUCHHOLZ_PHALANGES_MM[name]]),
        np.array(LENGTH_SD_MM[name]),
        np.tile(_across(along, ROLL_DEG[name]), (4, 1)),
        SOFT_TIP_MM[name],
    )


BUCHHOLZ: DrawnHand = {
    "thumb": replace(
        CT["thumb"],
        base_mm=np.array([7.6, 17.3, -9.0]),
        directions=MYOHAND["thumb"].directions,
        lengths_mm=np.array([43.4, 35.7, 28.8]),
    ),
    **{name: _buchholz_finger(name) for name in _BUCHHOLZ_CMC_MCP_MM},
}
"""Proportions of cadaver hands, its joints plain hinges."""


SOURCES: Mapping[str, DrawnHand] = {"ct": CT, "xray": XRAY, "buchholz": BUCHHOLZ, "myohand": MYOHAND}
BLEND = "blend"
ANATOMIES = (BLEND, *SOURCES)
"""What hands can be drawn from: a blend of the sources, another one for each person, or one hand alone."""

BLEND_SHARES = (2.0, 1.0, 1.0, 1.0)
"""Dirichlet distribution of the sources' weights, in their order: the CT hand counts twice (ours)."""


def blended(hands: Sequence[DrawnHand], weights: Sequence[float] | Array) -> DrawnHand:
    """The weighted mean of whole hands: of places and lengths, and of directions and axes as vectors."""
    return {name: _blended_digit([hand[name] for hand in hands], np.array(weights)) for name in hands[0]}


def _blended_digit(digits: Sequence[DrawnDigit], weights: Array) -> DrawnDigit:
    def mean(values: Sequence[Array]) -> Array:
        return np.asarray(np.tensordot(weights, np.array(values), 1))

    seconds = [digit.second_axis for digit in digits if digit.second_axis is not None]
    return DrawnDigit(
        mean([digit.base_mm for digit in digits]),
        unit(mean([digit.directions for digit in digits])),
        mean([digit.lengths_mm for digit in digits]),
        mean([digit.length_sd_mm for digit in digits]),
        unit(mean([unit(digit.flexion_axes) for digit in digits])),
        float(weights @ [digit.soft_tip_mm for digit in digits]),
        unit(mean([unit(axis) for axis in seconds])) if seconds else None,
    )


SKEW_MM, SKEW_DEG = 4.6, 87.0
"""The thumb's CMC axes pass each other at this distance and angle (Chang & Pollard). The thumb leaves the
palm about the one inside the metacarpal's base, and goes along it about the one inside the trapezium
(Hollister; the saddles of all three CT hands), which therefore carries the other."""

PRO_SUPINATION = 0.8
"""Pro-supination per flexion of CMC 4 and 5: ranges of 27 and 22 deg over 20 and 27 (El-shennawy)."""

WRIST_AXES = ((0.10, 0.97, 0.22), (-0.10, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Axes of flexion, abduction and axial rotation of the wrist, in the hand's frame (ours)."""

PAD_DEPTH_MM = {"thumb": 8.0, "index": 6.5, "middle": 6.5, "ring": 6.5, "little": 6.0}
"""Of the pad that touches under the line of joints (ours)."""

# --- how hands differ ------------------------------------------------------------------------------------


SCALE_SD, BASE_SD_MM, THUMB_BASE_SD_MM = 0.065, (1.5, 1.0, 1.0), (2.0, 1.5, 1.5)
DIRECTION_SD_RAD, AXIS_SD_RAD, CENTRES_SD_MM = 0.04, float(np.radians(5.0)), 1.0
"""Sds of how people differ from the hand that they are drawn around. Scale of all lengths, relative: 5.5 %
(OpenHands) to 8 % (Buryanov & Kotiuk). A digit's first joint, distal, lateral, dorsal: that of the third
(Tang), the thumb's axes, which are not known to 4 mm along its bone. Direction of a straight digit. Axes: a
hinge's varies by about 5 deg. Centres, deeper in all digits alike: what fits of joint surfaces leave open, by
comparison of our own with Buchholz'. Else ours."""

KNUCKLES_MM, METACARPALS_MM, FINGERS_MM = 13.0, 5.0, 10.0
"""Least distances of neighbours, scaled with the hand, below which nobody has them: of MCP centres (sources
have 15.5 to 22; they glide by some tenths), of the lines of metacarpals, and of those of fingers in the open
hand, whose skin touches at 14 and is pressed flat at 10 (ours)."""

SIDE_SD, SIDE_LIMIT = 0.0012, 0.0024
"""Sd of a bone's length, relative, between the two hands of a person, who differ by less than 0.5 %."""

PRO_SUPINATION_SD = 0.15
"""Sd of the pro-supination per flexion (ours)."""

WOBBLE_SD_RAD = 0.05
"""Abduction and axial rotation of a hinge at 90 deg of flexion: its helical axis varies by about 5 deg."""

AXIAL_COUPLING = (0.10, 0.05, 0.05)
"""Axial rotation of MCP joints and the thumb's CMC: per abduction, the sd of that, sd per flexion (ours)."""

GLIDE_MM: Mapping[str, tuple[float, float, float]] = {
    "thumb_cmc": (0.1, 0.5, 45.0),
    "mcp": (0.5, 2.0, 45.0),
    "pip": (0.06, 0.73, 90.0),
    "ip": (0.05, 0.5, 60.0),
    "dip": (0.05, 0.5, 60.0),
}
"""Least and largest way in mm that the centre which a joint turns about goes across its axis, and the flexion
in deg over which it does: of PIP joints as in a cadaver's finger (Hess et al.), the others ours."""

GLIDE_ALONG = 0.2
"""Of that glide, at most, along the axis (ours)."""

RELAXED_DEG: Mapping[str, tuple[float, float]] = {
    "mcp": (15.0, 45.0),
    "pip": (20.0, 50.0),
    "dip": (5.0, 25.0),
    "thumb": (10.0, 30.0),
}
"""Least and largest flexion at which people's hands are relaxed: of fingers by kind of joint, of all of the
thumb's (ours)."""

# --- where receivers sit ---------------------------------------------------------------------------------

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")
BONE_HEIGHT_MM = {
    "thumb": (8.0, 4.7, 1.5),
    "index": (8.0, 7.4, 3.8, 1.5),
    "middle": (8.0, 7.6, 4.1, 1.4),
    "ring": (7.4, 6.8, 4.0, 1.6),
    "little": (7.2, 6.7, 3.4, 1.8),
}
"""Dorsal surface of the bone at its middle over the line of joints: OpenHands and, of metacarpals, proximal
phalanges and the thumb, DiffAutoKin (index and thumb; other digits by the radii of their metacarpals'
heads)."""

SKIN_MM, NAIL_MM = 1.8, 1.2
"""Thickness over the bone of the skin on the back of a finger, and of the nail with its bed (ours)."""

RECEIVER_HALF_MM = (1.0, 3.0)
"""Least and largest half height of a receiver's housing, the same for all that a person wears (ours)."""

MOUNT_SHARE, NAIL_SHARE = 0.5, 0.7
"""Where on its bone a receiver sits, from the proximal joint: at the middle, or on the nail."""

MOUNT_RANGE, NAIL_RANGE = (0.25, 0.75), (0.6, 0.85)
"""The shares within which it stays: between the creases, which lie over the joints, and on the nail
(ours)."""

NAIL_TILT_DEG = 8.0
"""By which the nail slopes towards the pad (ours)."""

MOUNT_SD_MM, MOUNT_SD_DEG = (3.2, 1.6, 1.1), (3.4, 2.9, 3.5)
"""Sd of receivers' places along, across and in height, and of their turns about x, y, z: with the housings'
heights as spread as in trials, 3.2, 1.6 and 1.3 mm, 3 to 8 deg."""

HABIT_SHARE = (-0.2, 0.6)
"""Least and largest share of that variance that all receivers of a hand have alike, as its helper has the
habit; below 0 for people without one, who are a quarter (ours). The rest is each receiver's own, with heavy
tails (Student's t, 4 degrees of freedom)."""

NAIL_OWN, NAIL_OWN_TURN = (0.5, 1.0, 0.5), 0.5
"""Of what is a receiver's own, on a nail, which has the receiver's slope and is no longer than it: of its
place along, across and in height, and of its turn (ours)."""

HAND_MOUNT_MM, FOREARM_MOUNT_MM = (28.0, 0.0, 14.0), (-60.0, 0.0, 22.0)
"""Nominal places of the receivers on the back of the hand and on the forearm, from the wrist centre
(ours)."""

HAND_RISE_MM, HAND_MOUNT_SD_MM = 4.0, (5.0, 3.0, 2.0)
"""By how much the back of a hand is higher than that (CT: third metacarpal 6 mm over the wrist centre there,
its bone's back 8 mm higher, skin and half a receiver), and how hands differ (ours)."""

# --- how skin moves receivers ----------------------------------------------------------------------------
# Skin rests in the relaxed posture (`RELAXED_DEG`), in which receivers are put on: slides, tilts and lags are
# counted from there.
# Markers on a finger keep their spacing to 5 % in a pinch (Yang), 2 mm along a proximal phalanx; excursions
# are linear in flexion with R^2 of 0.89 to 0.97 (Zhang), mostly along the bone, about a millimetre at
# mid-bone. The law that is drawn (`stages.simulate.moving_skin`) saturates and lags in part.

SLIDE_SD_MM = (1.0, 0.25, 0.4)
"""Sd of a receiver per rad of an adjacent joint: along, across, in height (Zhang)."""

TILT_SD = (0.03, 0.04, 0.02)
"""Turn of a receiver in rad per rad of an adjacent joint, about x, y, z of its bone (Metcalf)."""

DISTAL_TILT = -0.02
"""Of a distal receiver with its own joint: markers on skin under-read DIP flexion by 11 % (Metcalf), of which
half is the middle phalanx's; a nail gives way a third of that or less."""

THUMB_PLACE_LAG = (0.10, 0.35)
"""Least and largest share of the CMC's motion by which the place of a receiver over the thumb's metacarpal
stays behind (ours)."""

THUMB_TURN_FURTHER = (-0.05, 0.15)
"""Least and largest share by which its turn stays further behind than its place (ours): the turn follows the
bone's less by 20 to 40 % in trials, in the mean of people by 28 % here."""

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
