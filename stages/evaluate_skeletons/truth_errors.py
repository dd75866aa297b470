"""Define how far a simulated hand's joints and bones are from what they are: rows of joint_errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shukotsu.schemas.catalogue import DISTAL_RECEIVER
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.tables import vector_columns, vector_of
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.skeleton.rotations import unit
from shukotsu.stages.evaluate_skeletons.scored_skeleton import Row, Stated
from shukotsu.stages.evaluate_skeletons.truth import Truth


def truth_for(tasks: Sequence[str], truths: Sequence[Truth]) -> Stated | None:
    """A skeleton's reference: joints' means over its calibrations' truths, else over all, if any."""
    own = [truth.stated for truth in truths if truth.name.task in tasks]
    own = own or [truth.stated for truth in truths]
    if not own:
        return None
    joints = {
        name: _averaged([one.joints[name] for one in own if name in one.joints]) for name in own[0].joints
    }
    return replace(own[0], joints=joints)


def _averaged(rows: Sequence[Mapping[str, Any]]) -> Row:
    """One joint's rows of several recordings as one."""
    frames = [row["n_frames"] for row in rows]
    mean = dict(rows[0])
    for side in ("parent_", "child_"):
        mean |= vector_columns(
            side, np.average([vector_of(row, side, "_mm") for row in rows], 0, frames), "_mm"
        )
        axis = np.average([vector_of(row, f"axis_{side}") for row in rows], 0, frames)
        mean |= vector_columns(f"axis_{side}", unit(axis))
    return mean


def joint_errors(stated: Stated, truth: Stated, layout: Layout) -> list[Row]:
    """Rows of every joint between two receivers of which the truth is known, without the skeleton's keys."""
    rows = []
    for joint in layout.solvable:
        true = truth.joints.get(joint.name)
        if true is None or not true["parent_segment"]:
            continue
        row: Row = {"joint": joint.name, "bone": ""}
        estimated = stated.joints.get(joint.name)
        if estimated is not None and estimated["status"] != "failed":
            row |= centre_errors(estimated, true)
        bone, length = stated.bones.get(joint.child), truth.bones.get(joint.child, {}).get("length_mm")
        # a bone that starts at the wrist, or ends at the distal receiver, is not the bone itself
        whole = bone and bone["starts_at"] == joint.name and bone["ends_at"] != DISTAL_RECEIVER
        stated_mm = bone["length_mm"] if bone and whole else None
        if stated_mm is not None and length is not None:
            off_mm = float(stated_mm) - length
            row |= {"bone": joint.child, "bone_error_mm": off_mm, "bone_error_percent": 100 * off_mm / length}
        rows.append(row)
    return rows


def centre_errors(estimated: Mapping[str, Any], true: Mapping[str, Any]) -> Row:
    """Errors of one joint by its rows of joint_centres; within_95 : of the worse half, as sd_mm is."""
    child, parent = (
        vector_of(estimated, side, "_mm") - vector_of(true, side, "_mm") for side in ("child_", "parent_")
    )
    axis, estimated_axis = (vector_of(row, "axis_child_") for row in (true, estimated))
    turned = np.linalg.norm(np.cross(estimated_axis, axis)), abs(estimated_axis @ axis)
    axis_deg = float(np.degrees(np.arctan2(*turned)))  # whichever way they point
    both = float(np.linalg.norm(child)), float(np.linalg.norm(parent))
    sd_mm = estimated["sd_mm"]
    within = None if sd_mm is None or np.isnan(both).all() else bool(np.nanmax(both) <= RADIUS_SD * sd_mm)
    return {
        "error_mm": both[0],
        "along_mm": float(abs(child @ axis)),
        "across_mm": float(np.linalg.norm(np.cross(child, axis))),
        "parent_error_mm": both[1],
        "axis_deg": axis_deg if true["dof"] == 1 else None,
        "sd_mm": sd_mm,
        "within_95": within,
    }
