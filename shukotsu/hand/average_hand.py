"""The average adult hand as the estimators expect it: how hands differ, where receivers sit, how skin moves.

What estimators weigh recordings against. The simulator reads none of it, and has its hands from elsewhere;
who reads what: tests/hand. The numbers, their sources and the frame of the hand stand in `average_hand.yaml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.hand.rotations import Array, unit
from shukotsu.study.config_files import read_constants

Vector = tuple[float, float, float]

BONE_KINDS = ("metacarpal", "proximal", "middle", "distal")

_NUMBERS = read_constants(Path(__file__).with_suffix(".yaml"))

MOUNT_SHARE: float = _NUMBERS["MOUNT_SHARE"]
NAIL_SHARE: float = _NUMBERS["NAIL_SHARE"]
NAIL_SLOPE_DEG: float = _NUMBERS["NAIL_SLOPE_DEG"]
COVER_MM: float = _NUMBERS["COVER_MM"]
CAPITATE_TO_CREASE_MM: float = _NUMBERS["CAPITATE_TO_CREASE_MM"]
SOURCE_SCALE: float = _NUMBERS["SOURCE_SCALE"]
AVERAGE_BREADTH_MM: float = _NUMBERS["AVERAGE_BREADTH_MM"]
SKEW_MM: float = _NUMBERS["SKEW_MM"]
SKEW_DEG: float = _NUMBERS["SKEW_DEG"]
PRO_SUPINATION: float = _NUMBERS["PRO_SUPINATION"]
SCALE_SD: float = _NUMBERS["SCALE_SD"]
SCALE_SD_BY_LENGTH: float = _NUMBERS["SCALE_SD_BY_LENGTH"]
BREADTH_SD_MM: float = _NUMBERS["BREADTH_SD_MM"]
LENGTH_SD_MM: Mapping[str, float] = _NUMBERS["LENGTH_SD_MM"]
SOURCE_SD_MM: Mapping[str, float] = _NUMBERS["SOURCE_SD_MM"]
THUMB_METACARPAL_SD_MM: float = _NUMBERS["THUMB_METACARPAL_SD_MM"]
BASE_SD_MM: float = _NUMBERS["BASE_SD_MM"]
THUMB_BASE_SD_MM: float = _NUMBERS["THUMB_BASE_SD_MM"]
PALM_BREADTH_SD: float = _NUMBERS["PALM_BREADTH_SD"]
DIRECTION_SD_RAD = float(np.radians(_NUMBERS["DIRECTION_SD_DEG"]))
ROLL_SD_RAD = float(np.radians(_NUMBERS["ROLL_SD_DEG"]))
THUMB_ROLL_SD_RAD = float(np.radians(_NUMBERS["THUMB_ROLL_SD_DEG"]))
AXIS_SD_RAD = float(np.radians(_NUMBERS["AXIS_SD_DEG"]))
SKEW_SD_MM: float = _NUMBERS["SKEW_SD_MM"]
SKEW_AXIS_SD_RAD = float(np.radians(_NUMBERS["SKEW_AXIS_SD_DEG"]))
PRO_SUPINATION_SD: float = _NUMBERS["PRO_SUPINATION_SD"]
LEAN_SD_RAD = float(np.radians(_NUMBERS["LEAN_SD_DEG"]))
JOINT_SLIDE_SD_MM: float = _NUMBERS["JOINT_SLIDE_SD_MM"]
HINGE_SLIDE_SD_MM: float = _NUMBERS["HINGE_SLIDE_SD_MM"]
MOUNT_SD_MM: Vector = _NUMBERS["MOUNT_SD_MM"]
ROUND_SD_RAD = float(np.radians(_NUMBERS["ROUND_SD_DEG"]))
COVER_SD_MM: float = _NUMBERS["COVER_SD_MM"]
HEIGHT_SD_MM: float = _NUMBERS["HEIGHT_SD_MM"]
HOUSING_MM: float = _NUMBERS["HOUSING_MM"]
SKIN_COVER_SD_MM: float = _NUMBERS["SKIN_COVER_SD_MM"]
HABIT_SHARE: float = _NUMBERS["HABIT_SHARE"]
MOUNT_TURN_SD_RAD = float(np.radians(_NUMBERS["MOUNT_TURN_DEG"] / np.sqrt(3.0)))
FACING_SD_RAD = float(np.radians(_NUMBERS["FACING_SD_DEG"]))
HAND_MOUNT_SD_MM: Vector = _NUMBERS["HAND_MOUNT_SD_MM"]
SLIDE_SD_MM: Vector = _NUMBERS["SLIDE_SD_MM"]
JOINTWISE_SLIDE_SD_MM: Vector = _NUMBERS["JOINTWISE_SLIDE_SD_MM"]
TILT_SD: Vector = _NUMBERS["TILT_SD"]
JOINTWISE_TILT_SD: float = _NUMBERS["JOINTWISE_TILT_SD"]
DISTAL_TILT: float = _NUMBERS["DISTAL_TILT"]
DISTAL_TILT_SD: float = _NUMBERS["DISTAL_TILT_SD"]
PLACE_LAG: float = _NUMBERS["PLACE_LAG"]
PLACE_LAG_SD: float = _NUMBERS["PLACE_LAG_SD"]
TURN_LAG: float = _NUMBERS["TURN_LAG"]
TURN_LAG_SD: float = _NUMBERS["TURN_LAG_SD"]
RELAXED_RAD = float(np.radians(_NUMBERS["RELAXED_DEG"]))
JOINTWISE_NAIL: float = _NUMBERS["JOINTWISE_NAIL"]
JOINTWISE_THENAR: float = _NUMBERS["JOINTWISE_THENAR"]
PALM_SLIDE_SD_MM: float = _NUMBERS["PALM_SLIDE_SD_MM"]
PALM_TILT_SD: float = _NUMBERS["PALM_TILT_SD"]
UNKNOWN_SLIDE_SD_MM: float = _NUMBERS["UNKNOWN_SLIDE_SD_MM"]
SKIN_BENT: float = _NUMBERS["SKIN_BENT"]
FIELD_TURN_SD_RAD = float(np.radians(_NUMBERS["FIELD_TURN_SD_DEG"]))
FIELD_SLOPE_SD_RAD_PER_MM = float(np.radians(_NUMBERS["FIELD_SLOPE_SD_DEG_PER_50_MM"]) / 50.0)
UNMODELLED_MM: Mapping[str, float] = _NUMBERS["UNMODELLED_MM"]
COMPOUND_DIGITS = ("ring", "little")
UNMODELLED_LENGTH_MM: Mapping[str, float] = _NUMBERS["UNMODELLED_LENGTH_MM"]
PHALANX_DEG: tuple[float, float] = _NUMBERS["PHALANX_DEG"]
METACARPAL_DEG: tuple[float, float] = _NUMBERS["METACARPAL_DEG"]
PALM_DEG: tuple[float, float] = _NUMBERS["PALM_DEG"]
STILL_PALM_DEG: tuple[float, float] = _NUMBERS["STILL_PALM_DEG"]
PALM_HELD_SD_RAD = float(np.radians(_NUMBERS["PALM_HELD_SD_DEG"]))
DIP_PER_PIP = 2 / 3
DIP_BY_PIP_SD_DEG: float = _NUMBERS["DIP_BY_PIP_SD_DEG"]
ABDUCTION_DEG: tuple[float, float] = _NUMBERS["ABDUCTION_DEG"]
AXIAL_DEG: tuple[float, float] = _NUMBERS["AXIAL_DEG"]
HINGE_DEG: tuple[float, float] = _NUMBERS["HINGE_DEG"]
THENAR: float = _NUMBERS["THENAR"]
LITTLE: float = _NUMBERS["LITTLE"]
NAIL: float = _NUMBERS["NAIL"]


@dataclass(frozen=True)
class DigitAnatomy:
    """A digit of the average hand, straight, from the joint at its base outward; B bones, hand's frame.

    base_mm : (3,) first joint, the CMC. directions : (B, 3) unit, distally. flexion_axes : (B, 3) unit, of
    the bones' proximal joints. lengths_mm : (B,) between joint centres, the last to the bone's tip.
    soft_tip_mm : skin and pulp beyond it. second_axis : (3,) of a skew first joint. bone_heights_mm : (B,) of
    each bone's back half way along, over the line between its ends. faces_nail : whether a thumb's metacarpal
    faces as the phalanges do (`shukotsu.hand.neutral_bones`).
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


def _thumb(
    facet_mm: Vector, direction: Vector, ip_axis: Vector, mcp_axis: Vector, **numbers: Any
) -> DigitAnatomy:
    """A straight thumb of the numbers' THUMB; its CMC axes lie as its saddle does."""
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
    """A finger of the numbers' FINGERS, from its CMC, MCP and PIP joint."""
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
        SOURCE_SCALE * cmc,
        np.array([unit(mcp - SOURCE_SCALE * cmc), proximal, middle, distal]),
        unit(np.array(axes)),
        np.array(numbers["lengths_mm"]),
        numbers["soft_tip_mm"],
        np.array(numbers["bone_heights_mm"]),
    )


DIGITS: Mapping[str, DigitAnatomy] = {
    "thumb": _thumb(**_NUMBERS["THUMB"]),
    **{name: _finger(**numbers) for name, numbers in _NUMBERS["FINGERS"].items()},
}

AVERAGE_LENGTH_MM = (
    CAPITATE_TO_CREASE_MM
    + float(DIGITS["middle"].base_mm[0] + DIGITS["middle"].lengths_mm.sum())
    + DIGITS["middle"].soft_tip_mm
)
"""Distal wrist crease to the skin of the middle finger's tip, as people measure it; hand of scale 1."""


def looseness(segment: str) -> float:
    """Return how far skin moves over a segment's bone, 1 for a typical one."""
    if segment == "thumb_metacarpal":
        return THENAR
    return (LITTLE if segment.startswith("little") else 1.0) * (NAIL if segment.endswith("_distal") else 1.0)
