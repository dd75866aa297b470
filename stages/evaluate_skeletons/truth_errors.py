"""How far a simulated hand's joints and bones are from what they are: rows of joint_errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kinematics.rotations import Array
from schemas.layout import Layout
from stages.evaluate_skeletons.skeleton_folder import Stated
from stages.evaluate_skeletons.truth_folder import TruthFolder

RADIUS_SD = 1.614
"""95 % of a three-dimensional error lie within this many sd_mm, if it is as large in every direction."""

Row = dict[str, Any]


def truth_for(tasks: Sequence[str], truths: Sequence[TruthFolder]) -> TruthFolder | None:
    """The truth that a skeleton's joints are held against: of its first calibration task that has one, else
    of any; a joint seen across a palm that moves is at its mean over the recording.
    """
    own = [truth for task in tasks for truth in truths if truth.name.task == task]
    return next(iter([*own, *truths]), None)


def joint_errors(stated: Stated, truth: TruthFolder, layout: Layout) -> list[Row]:
    """Rows (subject, hand, model and calibrated_on left out) of every joint between two receivers of which
    the truth is known; without numbers where the skeleton has none.
    """
    rows = []
    for joint in layout.solvable:
        true = truth.stated.joints.get(joint.name)
        if true is None or not true["parent_segment"]:
            continue
        row: Row = {"joint": joint.name, "bone": ""}
        found = stated.joints.get(joint.name)
        if found is not None and found["status"] != "failed":
            row |= centre_errors(found, true)
        length_mm = stated_length_mm(stated, layout, joint.name)
        length = truth.stated.bones.get(joint.child, {}).get("length_mm")
        if length_mm is not None and length is not None:
            off_mm = length_mm - length
            row |= {"bone": joint.child, "bone_error_mm": off_mm, "bone_error_percent": 100 * off_mm / length}
        rows.append(row)
    return rows


def centre_errors(found: Mapping[str, Any], true: Mapping[str, Any]) -> Row:
    """Errors of one joint; found, true : its rows of joint_centres.

    within_95 asks for the worse of the two halves, as sd_mm is that half's.
    """
    child, parent = (_vector(found, f"{side}_", "_mm") - _vector(true, f"{side}_", "_mm") for side in _SIDES)
    axis = _vector(true, "axis_child_", "")
    along = float(abs(child @ axis))
    both = float(np.linalg.norm(child)), float(np.linalg.norm(parent))
    sd_mm = found["sd_mm"]
    within = None if sd_mm is None or np.isnan(both).all() else bool(np.nanmax(both) <= RADIUS_SD * sd_mm)
    return {
        "error_mm": both[0],
        "along_mm": along,
        "across_mm": float(np.linalg.norm(np.cross(child, axis))),
        "parent_error_mm": both[1],
        "axis_deg": _line_angle_deg(_vector(found, "axis_child_", ""), axis) if true["dof"] == 1 else None,
        "sd_mm": sd_mm,
        "within_95": within,
    }


def stated_length_mm(stated: Stated, layout: Layout, joint: str) -> float | None:
    """Length that a skeleton states for the bone that starts at a joint; None where it states something else.

    A fit of the whole hand states every bone. Else a digit's last bone ends at the receiver, and its first
    one starts at the wrist unless the joint is a point of its own.
    """
    bone = stated.bones.get(layout.joints[joint].child)
    if bone is None:
        return None
    if bone["bone_mm"] is not None:
        return float(bone["bone_mm"])
    for digit in layout.digits.values():
        if joint in digit.joints[:-1] and (joint != digit.joints[0] or joint in stated.own_cmc):
            length_mm = bone["length_mm"]
            return None if length_mm is None else float(length_mm)
    return None


_SIDES = ("child", "parent")


def _vector(row: Mapping[str, Any], prefix: str, suffix: str) -> Array:
    """Three columns as a vector; NaN where they are null."""
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"], float)


def _line_angle_deg(first: Array, second: Array) -> float:
    """Angle between two lines, whichever way their unit vectors point."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), abs(first @ second))))
