"""The hands that the simulator draws: bones, variation, receiver placement and skin motion.

No estimator reads this module, and the simulator does not read the estimators' prior, as errors of an
estimator would remain hidden if it were tested on hands drawn from its own prior (tests/hand). Several
published sources are included as whole hands, since they differ from each other by more than people do. The
numbers, their sources and the frame of the hand are in `drawn_hands.yaml`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shukotsu.hand.rotations import Array, unit
from shukotsu.study.config_files import constants, read_constants

Vector = tuple[float, float, float]

_FILE = Path(__file__).with_suffix(".yaml")
_NUMBERS = read_constants(_FILE)


@dataclass(frozen=True)
class Population:
    """Variation of drawn people, their receivers and skin; values and sources are in `drawn_hands.yaml`."""

    LENGTH_SD_MM: Mapping[str, tuple[float, ...]]
    """Sd of the lengths of a digit's bones between people of the same hand size, from the base outward."""
    SOFT_TIP_MM: Mapping[str, float]
    """Skin and pulp beyond the last bone, by digit."""
    SOFT_TIP_SD_MM: float
    """Sd of the soft tip between people."""
    ROLL_DEG: Mapping[str, float]
    """Roll of a finger's hinges about its long axis: the palm's arch."""
    BLEND_SHARES: tuple[float, ...]
    """Parameters of the Dirichlet distribution of the sources' weights, in the order of `SOURCES`."""
    SKEW_MM: float
    """Distance between the two skew axes of the thumb's CMC joint."""
    SKEW_DEG: float
    """Angle between those axes."""
    PRO_SUPINATION: float
    """Pro-supination per flexion of CMC 4 and 5."""
    WRIST_AXES: tuple[Vector, ...]
    """Axes of flexion, abduction and axial rotation of the wrist, in the hand's frame."""
    PAD_DEPTH_MM: Mapping[str, float]
    """Depth below the line of joints of the pad that makes contact, by digit."""
    SCALE_SD: float
    """Sd of the scale of all lengths, relative."""
    BASE_SD_MM: Vector
    """Sd of a finger's CMC joint: distal, lateral, dorsal."""
    THUMB_BASE_SD_MM: Vector
    """Sd of the thumb's CMC joint: distal, lateral, dorsal."""
    DIRECTION_SD_RAD: float
    """Sd of the direction of a straight digit."""
    AXIS_SD_RAD: float
    """Sd of the direction of a joint's axis."""
    CENTRES_SD_MM: float
    """Sd of the depth of joint centres in the bones' heads, common to all digits."""
    KNUCKLES_MM: float
    """Least distance between neighbouring MCP centres, at scale 1."""
    METACARPALS_MM: float
    """Least distance between the lines of neighbouring metacarpals, at scale 1."""
    FINGERS_MM: float
    """Least distance between the lines of neighbouring fingers of an open hand, at scale 1."""
    SIDE_SD: float
    """Sd of the relative difference of a bone's length between a person's hands."""
    SIDE_LIMIT: float
    """Largest such difference."""
    PRO_SUPINATION_SD: float
    """Sd of the pro-supination per flexion."""
    WOBBLE_SD_RAD: float
    """Sd of the abduction and axial rotation of a hinge at 90 deg of flexion."""
    AXIAL_COUPLING: Vector
    """Axial rotation of MCP joints and the thumb's CMC: mean and sd per abduction, sd per flexion."""
    GLIDE_MM: Mapping[str, Vector]
    """Least and largest glide across a joint's axis, mm, and the flexion over which it occurs, deg."""
    GLIDE_ALONG: float
    """Largest glide along the axis, as a share of that across it."""
    RELAXED_DEG: Mapping[str, tuple[float, float]]
    """Least and largest flexion of a relaxed hand, by kind of joint."""
    BONE_HEIGHT_MM: Mapping[str, tuple[float, ...]]
    """Height of the bones' dorsal surface at mid-length above the line of joints, by digit."""
    SKIN_MM: float
    """Thickness of the skin on the back of a finger."""
    NAIL_MM: float
    """Thickness of the nail with its bed."""
    RECEIVER_HALF_MM: tuple[float, float]
    """Least and largest half height of a receiver's housing."""
    MOUNT_SHARE: float
    """Share of a bone's length, from its proximal joint, at which its receiver sits."""
    NAIL_SHARE: float
    """The same for a receiver on a nail."""
    MOUNT_RANGE: tuple[float, float]
    """Least and largest share at which a receiver sits."""
    NAIL_RANGE: tuple[float, float]
    """The same for a receiver on a nail."""
    NAIL_TILT_DEG: float
    """Slope of the nail towards the pad."""
    MOUNT_SD_MM: Vector
    """Sd of a receiver's placement along the bone, across it and in height."""
    MOUNT_SD_DEG: Vector
    """Sd of a receiver's rotation about x, y, z of its bone."""
    HABIT_SHARE: tuple[float, float]
    """Least and largest share of that variance that is common to a hand's receivers; below 0 means 0."""
    NAIL_OWN: Vector
    """Factor on a receiver's individual placement if it is on a nail: along, across, in height."""
    NAIL_OWN_TURN: float
    """The same for its rotation."""
    HAND_MOUNT_MM: Vector
    """Nominal position of the receiver on the back of the hand, from the wrist centre."""
    FOREARM_MOUNT_MM: Vector
    """Nominal position of the receiver on the forearm, from the wrist centre."""
    HAND_RISE_MM: float
    """Height of the back of a drawn hand above that nominal position."""
    HAND_MOUNT_SD_MM: Vector
    """Sd of the placement of the receiver on the back of the hand."""
    SLIDE_SD_MM: Vector
    """Sd of a receiver's motion on the skin per radian of an adjacent joint: along, across, in height."""
    TILT_SD: Vector
    """Sd of a receiver's rotation on the skin per rotation of an adjacent joint, about its bone's axes."""
    DISTAL_TILT: float
    """Rotation of a receiver on a nail per flexion of the last joint."""
    THUMB_PLACE_LAG: tuple[float, float]
    """Least and largest share of CMC motion by which the thumb's metacarpal receiver lags in position."""
    THUMB_TURN_FURTHER: tuple[float, float]
    """Least and largest share by which it lags further in orientation."""
    NAIL: float
    """Factor on skin motion over a distal phalanx."""
    THENAR: float
    """Factor on skin motion over the thumb's metacarpal."""
    LITTLE: float
    """Factor on skin motion over the little finger."""
    SATURATION_RAD: float
    """Joint angle towards which skin motion saturates."""
    LAG_S: float
    """Time by which skin lags behind its joint."""
    LAG_SHARE: float
    """Share of skin motion that lags."""
    WANDER_MM: float
    """Sd of the drift of a receiver's position that follows no joint."""
    WANDER_DEG: float
    """Sd of the drift of its orientation."""
    WANDER_S: float
    """Time constant of that drift."""


drawn = constants(Population, _FILE, _NUMBERS, r"(CT|MYOHAND|XRAY|BUCHHOLZ)_\w+|TO_CENTRES_MM")


@dataclass(frozen=True)
class DrawnDigit:
    """A straight digit with B bones, from the joint at its base outward, in the hand's frame.

    Attributes
    ----------
    base_mm : array, shape (3,)
        First joint, the CMC.
    directions : array, shape (B, 3)
        Unit vectors along the bones, distally.
    lengths_mm, length_sd_mm : array, shape (B,)
        Lengths between joint centres (of the last bone, to its tip), and their sd between people of one size.
    flexion_axes : array, shape (B, 3)
        Axes of the bones' proximal joints.
    soft_tip_mm : float
        Skin and pulp beyond the last bone.
    second_axis : array, shape (3,), optional
        Second axis of the thumb's CMC joint, which has two skew axes.

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


def _across(along: Array, roll_deg: float = 0.0, obliquity_deg: float = 0.0) -> Array:
    """Return an axis across a bone, its radial end lifted by a roll and moved distally by an obliquity."""
    lateral = unit(np.array([0.0, 1.0, 0.0]) - along[1] * along)
    roll, oblique = np.radians([roll_deg, obliquity_deg])
    square = np.cos(roll) * lateral + np.sin(roll) * np.cross(along, lateral)
    return np.asarray(np.cos(oblique) * square + np.sin(oblique) * along)


def _drawn_digit(name: str, base_mm: Array, directions: Array, lengths_mm: Array, axes: Array) -> DrawnDigit:
    length_sd_mm = np.array(drawn.LENGTH_SD_MM[name])
    return DrawnDigit(base_mm, directions, lengths_mm, length_sd_mm, axes, drawn.SOFT_TIP_MM[name])


def _myohand_digit(name: str) -> DrawnDigit:
    """Build a digit of MyoHand from its joints and bone tip, scaled to the CT hand's length."""
    scale = _NUMBERS["CT_LENGTH_MM"] / _NUMBERS["MYOHAND_LENGTH_MM"]
    points = scale * np.array(_NUMBERS["MYOHAND_POINTS_MM"][name])
    bones, axes = np.diff(points, axis=0), np.array(_NUMBERS["MYOHAND_AXES"][name])
    digit = _drawn_digit(name, points[0], unit(bones), np.linalg.norm(bones, axis=-1), axes)
    if name != "thumb":
        return digit
    return replace(digit, second_axis=np.array(_NUMBERS["MYOHAND_RADIAL_ABDUCTION"]))


MYOHAND: DrawnHand = {name: _myohand_digit(name) for name in drawn.LENGTH_SD_MM}
"""A single hand with gaps between its bones and a narrow palm; the thumb's CMC axes are those of the
model."""


def _ct_finger(name: str) -> DrawnDigit:
    """Build a finger: proximal and middle phalanx point as MyoHand's proximal one, the distal one leans."""
    pip_oblique, dip_oblique, twist, lean = _NUMBERS["CT_HINGES_DEG"][name]
    roll, axes = drawn.ROLL_DEG[name], MYOHAND[name].flexion_axes.copy()
    base, knuckle = np.array(_NUMBERS["CT_CMC_MCP_MM"][name])
    along = MYOHAND[name].directions[1]
    leaning = np.radians(lean)
    distal = np.cos(leaning) * along + np.sin(leaning) * _across(along, roll)
    axes[2], axes[3] = _across(along, roll, pip_oblique), _across(distal, roll + twist, dip_oblique)
    directions = np.array([unit(knuckle - base), along, along, distal])
    return _drawn_digit(name, base, directions, np.array(_NUMBERS["CT_LENGTHS_MM"][name]), axes)


def _ct_thumb() -> DrawnDigit:
    """Build a straight thumb; its CMC axes follow the saddle: first of palmar, then of radial abduction."""
    along, ip_axis = unit(np.array(_NUMBERS["CT_THUMB_ALONG"])), np.array(_NUMBERS["CT_IP_AXIS"])
    across = unit(ip_axis - (ip_axis @ along) * along)
    axes = np.array([np.cross(along, across), across, across])
    lengths_mm = np.array(_NUMBERS["CT_LENGTHS_MM"]["thumb"])
    base_mm = np.array(_NUMBERS["CT_THUMB_BASE_MM"])
    return replace(
        _drawn_digit("thumb", base_mm, np.tile(along, (3, 1)), lengths_mm, axes), second_axis=-across
    )


CT: DrawnHand = {"thumb": _ct_thumb(), **{name: _ct_finger(name) for name in drawn.ROLL_DEG}}
"""The hand of our CT fits, by far the best supported source for phalanges."""

XRAY: DrawnHand = {
    name: replace(
        digit,
        base_mm=0.97 * digit.base_mm,
        lengths_mm=np.array(_NUMBERS["XRAY_BONES_MM"][name]) + _NUMBERS["TO_CENTRES_MM"][name],
        flexion_axes=digit.flexion_axes if name == "thumb" else MYOHAND[name].flexion_axes,
    )
    for name, digit in CT.items()
}
"""A flat hand from X-ray pictures, 170.6 mm long. The pictures show no positions and axes, which are those of
the CT hand or, for the fingers' axes, of MyoHand."""


def _buchholz_finger(name: str) -> DrawnDigit:
    """Build a straight finger with hinges at right angles to the bones."""
    base, knuckle = np.array(_NUMBERS["BUCHHOLZ_CMC_MCP_MM"][name])
    along = MYOHAND[name].directions[1]
    directions = np.array([unit(knuckle - base), along, along, along])
    lengths_mm = (float(np.linalg.norm(knuckle - base)), *_NUMBERS["BUCHHOLZ_PHALANGES_MM"][name])
    axes = np.tile(_across(along, drawn.ROLL_DEG[name]), (4, 1))
    return _drawn_digit(name, base, directions, np.array(lengths_mm), axes)


BUCHHOLZ: DrawnHand = {
    "thumb": replace(
        CT["thumb"],
        base_mm=np.array(_NUMBERS["BUCHHOLZ_THUMB_BASE_MM"]),
        directions=MYOHAND["thumb"].directions,
        lengths_mm=np.array(_NUMBERS["BUCHHOLZ_THUMB_MM"]),
    ),
    **{name: _buchholz_finger(name) for name in drawn.ROLL_DEG},
}
"""A hand with the proportions of cadaver hands and plain hinges as joints."""

SOURCES: Mapping[str, DrawnHand] = {"ct": CT, "xray": XRAY, "buchholz": BUCHHOLZ, "myohand": MYOHAND}
BLEND = "blend"
ANATOMIES = (BLEND, *SOURCES)
"""Anatomies from which hands can be drawn: a blend of the sources that differs for each person, or one
source."""


def blend_hands(hands: Sequence[DrawnHand], weights: Sequence[float] | Array) -> DrawnHand:
    """Compute the weighted mean of whole hands: of positions, lengths, and direction and axis vectors.

    Parameters
    ----------
    hands : sequence of DrawnHand
        Hands of the same digits.
    weights : sequence of float
        Weight of each hand; the sum is 1.

    Returns
    -------
    DrawnHand
        The mean hand.

    """
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
