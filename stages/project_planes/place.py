"""One joint from its solution to its centre: plane, correction, trust, in that order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinematics.rotations import Array
from schemas.layout import Joint
from schemas.model import SkeletonModel
from stages.project_planes.plane import centre_sd_mm, correct, gap_rms_mm, project, worst_direction_sd_mm

WEAK_SD_MM = 2.0
WEAK_AXIS_SD_DEG = 5.0
WEAK_RANGE_DEG = 10.0
"""Skin alone turns receivers by some 4 deg against each other, and correlates with the neighbours' motion:
an axis found from less than about twice that may be the skin's (docs/method.md)."""


def place_joint(
    joint: Joint, solution: Mapping[str, Any], model: SkeletonModel, correction_mm: Array | None
) -> dict[str, Any]:
    """Give the joint's row of the joint_centres table (names of subject, hand and model left out).

    solution : the joint's row of joint_solutions. correction_mm : (3,) in the child's frame, or None.
    """
    row: dict[str, Any] = {
        "joint": joint.name,
        "parent_segment": joint.parent_receiver,
        "child_segment": joint.child,
        "dof": 1,
        "source": "fit",
        "n_frames": solution["n_frames"],
        "status": solution["status"],
        "message": solution["message"],
    }
    if solution["status"] == "failed":
        return row
    row |= {name: solution[name] for name in ("gap_rms_free_mm", "range_deg", "axis_sd_deg", "n_effective")}
    axis_parent, axis_child = _vector(solution, "null_parent_"), _vector(solution, "null_child_")
    row |= _named("axis_parent_", axis_parent) | _named("axis_child_", axis_child)
    p_mm, q_mm = _vector(solution, "parent_", "_mm"), _vector(solution, "child_", "_mm")
    projection = project(
        p_mm,
        q_mm,
        axis_parent,
        axis_child,
        np.reshape(solution["covariance_mm2"], (6, 6)),
        float(np.radians(solution["axis_sd_deg"])),
        plane_point_mm=np.array(joint.plane.point_mm),
        plane_normal=np.array(joint.plane.normal),
        plane_in_parent=joint.plane.frame == "parent",
    )
    if projection is None:
        return row | {"status": "failed", "message": "the axis lies in the plane that should cut it"}
    mean_rotation = np.array([[solution[f"mean_rotation_{i}{j}"] for j in "xyz"] for i in "xyz"])
    shift = np.zeros(3) if correction_mm is None else correction_mm
    p_new_mm, q_new_mm = correct(projection.p_mm, projection.q_mm, shift, mean_rotation)
    row |= _named("parent_", p_new_mm, "_mm") | _named("child_", q_new_mm, "_mm")
    row["gap_rms_mm"] = gap_rms_mm(
        solution["gap_rms_free_mm"],
        solution["singular_values"][5],
        axis_parent,
        axis_child,
        projection.slide_mm - solution["slide_to_free_mm"],
        p_new_mm - projection.p_mm,
        q_new_mm - projection.q_mm,
        mean_rotation,
    )
    row["covariance_mm2"] = projection.covariance_mm2.ravel()
    row["sd_mm"] = centre_sd_mm(projection.covariance_mm2)
    row["slide_mm"], row["axis_plane_deg"] = projection.slide_mm, projection.axis_plane_deg
    reasons = _doubts(row, worst_direction_sd_mm(projection.covariance_mm2), model)
    row["status"] = "weak" if reasons else "ok"
    if correction_mm is not None:
        row["source"], row["correction_mm"] = "fit, corrected by hand", float(np.linalg.norm(shift))
        reasons.append(f"moved {row['correction_mm']:.1f} mm by hand; its sd_mm is the fit's, not the hand's")
    return row | {"message": "; ".join(reasons)}


def _doubts(row: Mapping[str, Any], worst_sd_mm: float, model: SkeletonModel) -> list[str]:
    """Say in words what makes the centre weak; nothing where nothing does."""
    reasons = []
    if row["range_deg"] < WEAK_RANGE_DEG:
        reasons.append(f"moved only {row['range_deg']:.1f} deg; skin motion alone can look like that")
    if row["axis_plane_deg"] < model.parallel_limit_deg:
        reasons.append(
            f"its axis is {row['axis_plane_deg']:.0f} deg from the plane that cuts it, "
            f"which moved the centre {abs(row['slide_mm']):.0f} mm along it"
        )
    if worst_sd_mm > WEAK_SD_MM:
        reasons.append(f"centre uncertain by {worst_sd_mm:.1f} mm in its worst direction")
    if row["axis_sd_deg"] > WEAK_AXIS_SD_DEG:
        reasons.append(f"axis uncertain by {row['axis_sd_deg']:.0f} deg")
    return reasons


def _vector(row: Mapping[str, Any], prefix: str, suffix: str = "") -> Array:
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"])


def _named(prefix: str, vector: Array, suffix: str = "") -> dict[str, float]:
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", vector, strict=True)}
