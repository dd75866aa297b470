"""The hands that the simulator draws: their bones, how they differ, where receivers sit, how skin moves them.

No estimator reads this module, and the simulator reads nothing that estimators expect: one that is judged on
people drawn from its own table cannot be seen to be wrong (tests/hand). Several published sources stand here
as whole hands, since they disagree by more than people differ. The numbers, their sources and the frame of
the hand stand in `drawn_hands.yaml`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shukotsu.hand.rotations import Array, unit
from shukotsu.study.config_files import read_constants

Vector = tuple[float, float, float]

_NUMBERS = read_constants(Path(__file__).with_suffix(".yaml"))

LENGTH_SD_MM: Mapping[str, tuple[float, ...]] = _NUMBERS["LENGTH_SD_MM"]
SOFT_TIP_MM: Mapping[str, float] = _NUMBERS["SOFT_TIP_MM"]
SOFT_TIP_SD_MM: float = _NUMBERS["SOFT_TIP_SD_MM"]
ROLL_DEG: Mapping[str, float] = _NUMBERS["ROLL_DEG"]
BLEND_SHARES: tuple[float, ...] = _NUMBERS["BLEND_SHARES"]
SKEW_MM: float = _NUMBERS["SKEW_MM"]
SKEW_DEG: float = _NUMBERS["SKEW_DEG"]
PRO_SUPINATION: float = _NUMBERS["PRO_SUPINATION"]
WRIST_AXES: tuple[Vector, ...] = _NUMBERS["WRIST_AXES"]
PAD_DEPTH_MM: Mapping[str, float] = _NUMBERS["PAD_DEPTH_MM"]
SCALE_SD: float = _NUMBERS["SCALE_SD"]
BASE_SD_MM: Vector = _NUMBERS["BASE_SD_MM"]
THUMB_BASE_SD_MM: Vector = _NUMBERS["THUMB_BASE_SD_MM"]
DIRECTION_SD_RAD: float = _NUMBERS["DIRECTION_SD_RAD"]
AXIS_SD_RAD = float(np.radians(_NUMBERS["AXIS_SD_DEG"]))
CENTRES_SD_MM: float = _NUMBERS["CENTRES_SD_MM"]
KNUCKLES_MM: float = _NUMBERS["KNUCKLES_MM"]
METACARPALS_MM: float = _NUMBERS["METACARPALS_MM"]
FINGERS_MM: float = _NUMBERS["FINGERS_MM"]
SIDE_SD: float = _NUMBERS["SIDE_SD"]
SIDE_LIMIT: float = _NUMBERS["SIDE_LIMIT"]
PRO_SUPINATION_SD: float = _NUMBERS["PRO_SUPINATION_SD"]
WOBBLE_SD_RAD: float = _NUMBERS["WOBBLE_SD_RAD"]
AXIAL_COUPLING: Vector = _NUMBERS["AXIAL_COUPLING"]
GLIDE_MM: Mapping[str, Vector] = _NUMBERS["GLIDE_MM"]
GLIDE_ALONG: float = _NUMBERS["GLIDE_ALONG"]
RELAXED_DEG: Mapping[str, tuple[float, float]] = _NUMBERS["RELAXED_DEG"]
BONE_HEIGHT_MM: Mapping[str, tuple[float, ...]] = _NUMBERS["BONE_HEIGHT_MM"]
SKIN_MM: float = _NUMBERS["SKIN_MM"]
NAIL_MM: float = _NUMBERS["NAIL_MM"]
RECEIVER_HALF_MM: tuple[float, float] = _NUMBERS["RECEIVER_HALF_MM"]
MOUNT_SHARE: float = _NUMBERS["MOUNT_SHARE"]
NAIL_SHARE: float = _NUMBERS["NAIL_SHARE"]
MOUNT_RANGE: tuple[float, float] = _NUMBERS["MOUNT_RANGE"]
NAIL_RANGE: tuple[float, float] = _NUMBERS["NAIL_RANGE"]
NAIL_TILT_DEG: float = _NUMBERS["NAIL_TILT_DEG"]
MOUNT_SD_MM: Vector = _NUMBERS["MOUNT_SD_MM"]
MOUNT_SD_DEG: Vector = _NUMBERS["MOUNT_SD_DEG"]
HABIT_SHARE: tuple[float, float] = _NUMBERS["HABIT_SHARE"]
NAIL_OWN: Vector = _NUMBERS["NAIL_OWN"]
NAIL_OWN_TURN: float = _NUMBERS["NAIL_OWN_TURN"]
HAND_MOUNT_MM: Vector = _NUMBERS["HAND_MOUNT_MM"]
FOREARM_MOUNT_MM: Vector = _NUMBERS["FOREARM_MOUNT_MM"]
HAND_RISE_MM: float = _NUMBERS["HAND_RISE_MM"]
HAND_MOUNT_SD_MM: Vector = _NUMBERS["HAND_MOUNT_SD_MM"]
SLIDE_SD_MM: Vector = _NUMBERS["SLIDE_SD_MM"]
TILT_SD: Vector = _NUMBERS["TILT_SD"]
DISTAL_TILT: float = _NUMBERS["DISTAL_TILT"]
THUMB_PLACE_LAG: tuple[float, float] = _NUMBERS["THUMB_PLACE_LAG"]
THUMB_TURN_FURTHER: tuple[float, float] = _NUMBERS["THUMB_TURN_FURTHER"]
NAIL: float = _NUMBERS["NAIL"]
THENAR: float = _NUMBERS["THENAR"]
LITTLE: float = _NUMBERS["LITTLE"]
SATURATION_RAD: float = _NUMBERS["SATURATION_RAD"]
LAG_S: float = _NUMBERS["LAG_S"]
LAG_SHARE: float = _NUMBERS["LAG_SHARE"]
WANDER_MM: float = _NUMBERS["WANDER_MM"]
WANDER_DEG: float = _NUMBERS["WANDER_DEG"]
WANDER_S: float = _NUMBERS["WANDER_S"]


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


def _across(along: Array, roll_deg: float = 0.0, obliquity_deg: float = 0.0) -> Array:
    """A radial axis square to a bone, its radial end lifted by a roll and moved distally by an obliquity."""
    lateral = unit(np.array([0.0, 1.0, 0.0]) - along[1] * along)
    roll, oblique = np.radians([roll_deg, obliquity_deg])
    square = np.cos(roll) * lateral + np.sin(roll) * np.cross(along, lateral)
    return np.asarray(np.cos(oblique) * square + np.sin(oblique) * along)


def _drawn_digit(name: str, base_mm: Array, directions: Array, lengths_mm: Array, axes: Array) -> DrawnDigit:
    length_sd_mm = np.array(LENGTH_SD_MM[name])
    return DrawnDigit(base_mm, directions, lengths_mm, length_sd_mm, axes, SOFT_TIP_MM[name])


def _myohand_digit(name: str) -> DrawnDigit:
    """A digit through its joints and its bone's tip, brought to the CT hand's length."""
    scale = _NUMBERS["CT_LENGTH_MM"] / _NUMBERS["MYOHAND_LENGTH_MM"]
    points = scale * np.array(_NUMBERS["MYOHAND_POINTS_MM"][name])
    bones, axes = np.diff(points, axis=0), np.array(_NUMBERS["MYOHAND_AXES"][name])
    digit = _drawn_digit(name, points[0], unit(bones), np.linalg.norm(bones, axis=-1), axes)
    if name != "thumb":
        return digit
    return replace(digit, second_axis=np.array(_NUMBERS["MYOHAND_RADIAL_ABDUCTION"]))


MYOHAND: DrawnHand = {name: _myohand_digit(name) for name in LENGTH_SD_MM}
"""One hand, its joints assembled with gaps, its palm narrow; the thumb's CMC axes lie as its model has
them."""


def _ct_finger(name: str) -> DrawnDigit:
    """A finger whose phalanges lie in line, as MyoHand's proximal phalanx points, but for the distal one."""
    pip_oblique, dip_oblique, twist, lean = _NUMBERS["CT_HINGES_DEG"][name]
    roll, axes = ROLL_DEG[name], MYOHAND[name].flexion_axes.copy()
    base, knuckle = np.array(_NUMBERS["CT_CMC_MCP_MM"][name])
    along = MYOHAND[name].directions[1]
    leaning = np.radians(lean)
    distal = np.cos(leaning) * along + np.sin(leaning) * _across(along, roll)
    axes[2], axes[3] = _across(along, roll, pip_oblique), _across(distal, roll + twist, dip_oblique)
    directions = np.array([unit(knuckle - base), along, along, distal])
    return _drawn_digit(name, base, directions, np.array(_NUMBERS["CT_LENGTHS_MM"][name]), axes)


def _ct_thumb() -> DrawnDigit:
    """A straight thumb; its CMC axes as its saddle lies: of palmar abduction, then of radial."""
    along, ip_axis = unit(np.array(_NUMBERS["CT_THUMB_ALONG"])), np.array(_NUMBERS["CT_IP_AXIS"])
    across = unit(ip_axis - (ip_axis @ along) * along)
    axes = np.array([np.cross(along, across), across, across])
    lengths_mm = np.array(_NUMBERS["CT_LENGTHS_MM"]["thumb"])
    base_mm = np.array(_NUMBERS["CT_THUMB_BASE_MM"])
    return replace(
        _drawn_digit("thumb", base_mm, np.tile(along, (3, 1)), lengths_mm, axes), second_axis=-across
    )


CT: DrawnHand = {"thumb": _ct_thumb(), **{name: _ct_finger(name) for name in ROLL_DEG}}
"""The hand of our CT fits: the best supported by far, where phalanges are concerned."""

XRAY: DrawnHand = {
    name: replace(
        digit,
        base_mm=0.97 * digit.base_mm,
        lengths_mm=np.array(_NUMBERS["XRAY_BONES_MM"][name]) + _NUMBERS["TO_CENTRES_MM"][name],
        flexion_axes=digit.flexion_axes if name == "thumb" else MYOHAND[name].flexion_axes,
    )
    for name, digit in CT.items()
}
"""A pictured hand, flat, 170.6 mm long; where its bones stand and turn is not in the picture and is that of
the CT hand and, of the fingers' axes, of MyoHand."""


def _buchholz_finger(name: str) -> DrawnDigit:
    """A straight finger with square hinges."""
    base, knuckle = np.array(_NUMBERS["BUCHHOLZ_CMC_MCP_MM"][name])
    along = MYOHAND[name].directions[1]
    directions = np.array([unit(knuckle - base), along, along, along])
    lengths_mm = (float(np.linalg.norm(knuckle - base)), *_NUMBERS["BUCHHOLZ_PHALANGES_MM"][name])
    axes = np.tile(_across(along, ROLL_DEG[name]), (4, 1))
    return _drawn_digit(name, base, directions, np.array(lengths_mm), axes)


BUCHHOLZ: DrawnHand = {
    "thumb": replace(
        CT["thumb"],
        base_mm=np.array(_NUMBERS["BUCHHOLZ_THUMB_BASE_MM"]),
        directions=MYOHAND["thumb"].directions,
        lengths_mm=np.array(_NUMBERS["BUCHHOLZ_THUMB_MM"]),
    ),
    **{name: _buchholz_finger(name) for name in ROLL_DEG},
}
"""Proportions of cadaver hands, its joints plain hinges."""

SOURCES: Mapping[str, DrawnHand] = {"ct": CT, "xray": XRAY, "buchholz": BUCHHOLZ, "myohand": MYOHAND}
BLEND = "blend"
ANATOMIES = (BLEND, *SOURCES)
"""What hands can be drawn from: a blend of the sources, another one for each person, or one hand alone."""


def blend_hands(hands: Sequence[DrawnHand], weights: Sequence[float] | Array) -> DrawnHand:
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
