"""The average adult hand as a prior of the estimators: bones, variation, receiver placement and skin motion.

Estimators regularise towards these values. The simulator uses none of them (tests/hand). The numbers, their
sources and the frame of the hand are in `average_hand.yaml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.hand.rotations import Array, unit
from shukotsu.study.config_files import constants, read_constants

Vector = tuple[float, float, float]

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")
COMPOUND_DIGITS = ("ring", "little")
"""Digits whose MCP joints are less well modelled, as their metacarpals move when the palm folds."""

_FILE = Path(__file__).with_suffix(".yaml")
_NUMBERS = read_constants(_FILE)


@dataclass(frozen=True)
class Prior:
    """Prior of the estimators for hands, receivers and skin; values and sources: `average_hand.yaml`."""

    MOUNT_SHARE: float
    """Share of a bone's length, from its proximal joint, at which its receiver sits."""
    NAIL_SHARE: float
    """The same for a distal phalanx, whose receiver sits on the nail."""
    NAIL_SLOPE_DEG: float
    """Slope of the back of a distal phalanx, and of a receiver on it, towards the tip."""
    COVER_MM: float
    """Height of the tracked point above the bone: skin and half a receiver's housing."""
    CAPITATE_TO_CREASE_MM: float
    """Distance from the wrist centre to the distal wrist crease, which is proximal to it."""
    SOURCE_SCALE: float
    """Scale of the average hand relative to the hand from which the palm's shape is taken."""
    AVERAGE_BREADTH_MM: float
    """Breadth across the knuckles of digits 2 to 5, with skin, at scale 1."""
    SKEW_MM: float
    """Distance between the two skew axes of the thumb's CMC joint."""
    SKEW_DEG: float
    """Angle between those axes."""
    PRO_SUPINATION: float
    """Pro-supination per flexion of CMC 4 and 5."""
    SCALE_SD: float
    """Sd of the hand's scale among adults, relative."""
    SCALE_SD_BY_LENGTH: float
    """Sd of the scale if the hand's length was measured."""
    BREADTH_SD_MM: float
    """Sd of the measured breadth relative to the breadth of the bones plus the flesh of an average hand."""
    LENGTH_SD_MM: Mapping[str, float]
    """Sd of a bone's length between people whose hands have the same scale, by kind of bone."""
    SOURCE_SD_MM: Mapping[str, float]
    """Sd of the error that all lengths of a kind share, by which published sources differ."""
    THUMB_METACARPAL_SD_MM: float
    """Sd of the length of the thumb's metacarpal."""
    BASE_SD_MM: float
    """Sd per direction of a metacarpal's base relative to the average palm."""
    THUMB_BASE_SD_MM: float
    """The same for the thumb's metacarpal."""
    PALM_BREADTH_SD: float
    """Sd of the palm's breadth between hands of the same scale, relative."""
    DIRECTION_SD_RAD: float
    """Sd of a digit's direction in the flat hand, in each of the two directions across it."""
    ROLL_SD_RAD: float
    """Sd of a finger's roll about its long axis."""
    THUMB_ROLL_SD_RAD: float
    """Sd of the thumb's roll about its long axis."""
    AXIS_SD_RAD: float
    """Sd of the direction of a joint's axis, in each of the two directions across it."""
    SKEW_SD_MM: float
    """Sd of the distance between the thumb's CMC axes."""
    SKEW_AXIS_SD_RAD: float
    """Sd of the direction of each of the thumb's CMC axes."""
    PRO_SUPINATION_SD: float
    """Sd of the pro-supination per flexion."""
    LEAN_SD_RAD: float
    """Sd of the angle by which the bone distal to a hinge leans sideways in a straight finger."""
    JOINT_SLIDE_SD_MM: float
    """Sd of the translation of a joint's centre per radian of flexion."""
    HINGE_SLIDE_SD_MM: float
    """The same for hinges: PIP, DIP and IP joints."""
    MOUNT_SD_MM: Vector
    """Sd of a receiver's placement along the bone, across it and in height."""
    ROUND_SD_RAD: float
    """Sd of a receiver's angular position around its bone, which turns it and moves it sideways."""
    COVER_SD_MM: float
    """Sd of the part of the tracked point's height above the bone that is common to all receivers."""
    HEIGHT_SD_MM: float
    """Sd of each receiver's height if the layout states the height of its tracked point."""
    HOUSING_MM: float
    """Height of the tracked point above a receiver's base that is assumed in COVER_MM."""
    SKIN_COVER_SD_MM: float
    """Sd of the common height if the layout states that of the tracked point: thickness of the skin."""
    HABIT_SHARE: float
    """Share of the variance of placement that is common to the nails, or to all other bones of digits."""
    MOUNT_TURN_SD_RAD: float
    """Sd per component of a receiver's rotation away from the bone's axes."""
    FACING_SD_RAD: float
    """Sd of the roll about the bone of the receiver on the thumb's metacarpal."""
    HAND_MOUNT_SD_MM: Vector
    """Sd of the placement of the receiver on the back of the hand, in the hand's frame."""
    SLIDE_SD_MM: Vector
    """Sd of a receiver's motion on the skin per radian of an adjacent joint: along, across, in height."""
    JOINTWISE_SLIDE_SD_MM: Vector
    """The same for models that solve joints one by one."""
    TILT_SD: Vector
    """Sd of a receiver's rotation on the skin per rotation of an adjacent joint, about its bone's axes."""
    JOINTWISE_TILT_SD: float
    """The same about any axis, for models that solve joints one by one."""
    DISTAL_TILT: float
    """Mean rotation of a receiver on a nail per flexion of the last joint."""
    DISTAL_TILT_SD: float
    """Sd of that rotation."""
    PLACE_LAG: float
    """Share of CMC motion that skin adds to the position of the receiver on the thumb's metacarpal."""
    PLACE_LAG_SD: float
    """Sd of that share."""
    TURN_LAG: float
    """Share of CMC motion that skin adds to its orientation, beyond that of its position."""
    TURN_LAG_SD: float
    """Sd of that share."""
    RELAXED_RAD: float
    """Flexion of MCP, PIP, DIP and IP joints of a hand at rest, in which receivers are put on."""
    JOINTWISE_NAIL: float
    """Factor on skin motion over a distal phalanx for models that solve joints one by one."""
    JOINTWISE_THENAR: float
    """Factor on skin motion over the thumb's metacarpal for models that solve joints one by one."""
    PALM_SLIDE_SD_MM: float
    """Sd of a receiver's motion on the skin of the palm, per radian."""
    PALM_TILT_SD: float
    """Sd of a receiver's rotation on the skin of the palm, per rotation of the joint."""
    UNKNOWN_SLIDE_SD_MM: float
    """Sd of the motion of a receiver on a segment outside the described anatomy, per radian."""
    SKIN_BENT: float
    """Share of skin motion that is not linear in the joint's angle."""
    FIELD_TURN_SD_RAD: float
    """Sd per component of the rotation that a room's field adds to all receivers."""
    FIELD_SLOPE_SD_RAD_PER_MM: float
    """Sd of the change of that rotation with position."""
    UNMODELLED_MM: Mapping[str, float]
    """Sd per direction of a centre's error that the fit does not model, by kind of joint."""
    UNMODELLED_LENGTH_MM: Mapping[str, float]
    """The same for lengths, by kind of bone."""
    PHALANX_DEG: tuple[float, float]
    """Mean and sd of the flexion of MCP, PIP, DIP and IP joints over a recording."""
    METACARPAL_DEG: tuple[float, float]
    """Mean and sd of the flexion of the thumb's CMC joint."""
    PALM_DEG: tuple[float, float]
    """Mean and sd of the flexion of CMC 4 and 5."""
    STILL_PALM_DEG: tuple[float, float]
    """Mean and sd of the flexion of CMC 2 and 3."""
    PALM_HELD_SD_RAD: float
    """Sd of the mean angle at which a person holds CMC 4 and 5."""
    DIP_PER_PIP: float
    """Flexion of a DIP joint per flexion of its PIP joint, in free motion."""
    DIP_BY_PIP_SD_DEG: float
    """Sd of a DIP joint's flexion relative to DIP_PER_PIP times the PIP joint's."""
    ABDUCTION_DEG: tuple[float, float]
    """Mean and sd of abduction."""
    AXIAL_DEG: tuple[float, float]
    """Mean and sd of axial rotation."""
    HINGE_DEG: tuple[float, float]
    """Mean and sd of the abduction and axial rotation of a hinge."""
    THENAR: float
    """Factor on skin motion over the thumb's metacarpal."""
    LITTLE: float
    """Factor on skin motion over the little finger."""
    NAIL: float
    """Factor on skin motion over a distal phalanx."""

    def looseness(self, segment: str) -> float:
        """Return the factor on skin motion over a segment's bone, 1 for a typical one."""
        if segment == "thumb_metacarpal":
            return self.THENAR
        little = self.LITTLE if segment.startswith("little") else 1.0
        return little * (self.NAIL if segment.endswith("_distal") else 1.0)


PRIOR = constants(
    Prior,
    _FILE,
    _NUMBERS,
    "THUMB|FINGERS|MOUNT_TURN_DEG|FIELD_SLOPE_SD_DEG_PER_50_MM",
    MOUNT_TURN_SD_RAD=float(np.radians(_NUMBERS["MOUNT_TURN_DEG"] / np.sqrt(3.0))),
    DIP_PER_PIP=2 / 3,
    FIELD_SLOPE_SD_RAD_PER_MM=float(np.radians(_NUMBERS["FIELD_SLOPE_SD_DEG_PER_50_MM"]) / 50.0),
)


@dataclass(frozen=True)
class DigitAnatomy:
    """A straight digit of the average hand with B bones, from its base outward, in the hand's frame.

    Attributes
    ----------
    base_mm : array, shape (3,)
        First joint, the CMC.
    directions : array, shape (B, 3)
        Unit vectors along the bones, distally.
    flexion_axes : array, shape (B, 3)
        Unit axes of the bones' proximal joints.
    lengths_mm : array, shape (B,)
        Lengths between joint centres; of the last bone, to its tip.
    soft_tip_mm : float
        Skin and pulp beyond the last bone.
    bone_heights_mm : array, shape (B,)
        Height of each bone's back at mid-length above the line between its ends.
    second_axis : array, shape (3,), optional
        Second axis of a first joint with two skew axes.
    faces_nail : bool
        Whether a thumb's metacarpal faces as the phalanges do (`shukotsu.hand.neutral_bones`).

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
        """Return bone frames (B, 3, 3) in the hand's frame: x distal, y nearest the flexion axis."""
        x, axes = self.directions, self.flexion_axes.copy()
        if self.faces_nail:
            axes[0] = axes[1]
        y = unit(axes - (axes * x).sum(-1, keepdims=True) * x)
        return np.stack([x, y, np.cross(x, y)], -1)

    def joints_mm(self) -> Array:
        """Return the joints (B, 3) of the straight digit, mm from the wrist centre."""
        bones = self.lengths_mm[:, None] * self.directions
        return np.asarray(self.base_mm + np.cumsum(bones, axis=0) - bones)

    def mounts_mm(self) -> Array:
        """Return the receivers' positions (B, 3), mm in the bones' frames: on the nail, or near mid-bone."""
        mounts = np.zeros((len(self.lengths_mm), 3))
        mounts[:, 0] = PRIOR.MOUNT_SHARE * self.lengths_mm
        mounts[-1, 0] = PRIOR.NAIL_SHARE * self.lengths_mm[-1]
        mounts[:, 2] = self.bone_heights_mm + PRIOR.COVER_MM
        return mounts


def _thumb(
    facet_mm: Vector, direction: Vector, ip_axis: Vector, mcp_axis: Vector, **numbers: Any
) -> DigitAnatomy:
    """Build a straight thumb from THUMB of the YAML file; its CMC axes follow the saddle of the joint."""
    along = unit(np.array(direction))
    ip, mcp = (unit(axis - (axis @ along) * along) for axis in (np.array(ip_axis), np.array(mcp_axis)))
    return DigitAnatomy(
        np.array(facet_mm) - numbers["facet_to_centre_mm"] * along,
        np.tile(along, (3, 1)),
        np.array([np.cross(along, ip), mcp, ip]),
        np.array(numbers["lengths_mm"]),
        numbers["soft_tip_mm"],
        np.array(numbers["bone_heights_mm"]),
        -ip,
    )


def _finger(
    joints_mm: tuple[Vector, Vector, Vector],
    mcp_axis: Vector,
    oblique_deg: tuple[float, float],
    twist_deg: float,
    lean_deg: float,
    **numbers: Any,
) -> DigitAnatomy:
    """Build a finger from FINGERS of the YAML file; joints_mm : its CMC, MCP and PIP joint."""
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
    return DigitAnatomy(
        PRIOR.SOURCE_SCALE * cmc,
        np.array([unit(mcp - PRIOR.SOURCE_SCALE * cmc), proximal, middle, distal]),
        unit(np.array(axes)),
        np.array(numbers["lengths_mm"]),
        numbers["soft_tip_mm"],
        np.array(numbers["bone_heights_mm"]),
    )


DIGITS: dict[str, DigitAnatomy] = {
    "thumb": _thumb(**_NUMBERS["THUMB"]),
    **{name: _finger(**numbers) for name, numbers in _NUMBERS["FINGERS"].items()},
}

AVERAGE_LENGTH_MM = (
    PRIOR.CAPITATE_TO_CREASE_MM
    + float(DIGITS["middle"].base_mm[0] + DIGITS["middle"].lengths_mm.sum())
    + DIGITS["middle"].soft_tip_mm
)
"""Length of a hand of scale 1 as people measure it: distal wrist crease to the skin of the middle finger's
tip."""
