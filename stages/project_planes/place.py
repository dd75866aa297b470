"""One joint from its solution to its centre: plane, correction, trust, in that order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from anatomy.skin import is_known
from schemas.layout import Joint, Layout
from schemas.model import SkeletonModel
from skeleton.rotations import Array
from stages.project_planes.plane import (
    Projection,
    centre_sd_mm,
    correct,
    gap_rms_mm,
    is_worst_along,
    leave_uncut,
    project,
    worst_direction_sd_mm,
)
from stages.project_planes.unseen_error import unseen_covariance

WEAK_SCATTER_MM = 2.0
WEAK_SD_MM = 7.0
"""In 3-D: a third of a phalanx; a centre that is less sure is of little use on a hand."""

WEAK_AXIS_SD_DEG = 5.0
WEAK_GAP_MM = 10.0
"""No skin on a hand lets two receivers disagree so much about their joint; a wrong quaternion order does."""

WEAK_RANGE_DEG = 10.0
"""Skin alone turns receivers by some 4 deg against each other, and correlates with the neighbours' motion:
an axis found from less than about twice that may be the skin's (docs/method.md)."""


def place_joint(
    joint: Joint,
    layout: Layout,
    solution: Mapping[str, Any],
    model: SkeletonModel,
    correction_mm: Array | None,
) -> dict[str, Any]:
    """Give the joint's row of the joint_centres table (names of subject, hand and model left out).

    solution : the joint's row of joint_solutions. correction_mm : (3,) in the child's frame, or None.
    """
    row: dict[str, Any] = {
        "joint": joint.name,
        "parent_segment": joint.parent_receiver,
        "child_segment": joint.child,
        "dof": _dof(joint, model),
        "source": "fit",
        "n_frames": solution["n_frames"],
        "status": solution["status"],
        "message": solution["message"],
    }
    if solution["status"] == "failed":
        return row
    row |= {name: solution[name] for name in ("gap_rms_free_mm", "range_deg", "axis_sd_deg", "n_effective")}
    row |= _named("axis_parent_", _vector(solution, "null_parent_"))
    row |= _named("axis_child_", _vector(solution, "null_child_"))
    placed = _projection(joint, solution) if model.cut else _as_solved(solution)
    if placed is None:
        return row | {"status": "failed", "message": "the axis lies in the plane that should cut it"}
    shift_mm = np.zeros(3) if correction_mm is None else correction_mm
    row |= _centre(solution, placed, shift_mm, model)
    if model.cut:
        row |= _whole_error(joint, layout, placed, solution)
        reasons = _doubts(joint, layout, row, placed.covariance_mm2, model)
    else:
        reasons = [solution["message"]] * bool(solution["message"]) + _disagreement(row)
    row["status"] = "weak" if reasons else "ok"
    if correction_mm is not None:
        row["source"], row["correction_mm"] = "fit, corrected by hand", float(np.linalg.norm(shift_mm))
        reasons.append(f"moved {row['correction_mm']:.1f} mm by hand; its sd_mm is the fit's, not the hand's")
    return row | {"message": "; ".join(reasons)}


def _dof(joint: Joint, model: SkeletonModel) -> int:
    if not model.cut:
        return max(joint.dof, 1)
    return 3 if joint.plane.frame == "none" else 1


def _as_solved(solution: Mapping[str, Any]) -> Projection:
    """The centre of the joint solve, for a model whose planes cut nothing."""
    return Projection(
        p_mm=_vector(solution, "parent_", "_mm"),
        q_mm=_vector(solution, "child_", "_mm"),
        slide_mm=0.0,
        axis_plane_deg=None,
        covariance_mm2=np.reshape(solution["covariance_mm2"], (6, 6)),
    )


def _projection(joint: Joint, solution: Mapping[str, Any]) -> Projection | None:
    p_mm, q_mm = _vector(solution, "parent_", "_mm"), _vector(solution, "child_", "_mm")
    axes = _vector(solution, "null_parent_"), _vector(solution, "null_child_")
    covariance_mm2 = np.reshape(solution["covariance_mm2"], (6, 6))
    if joint.plane.frame == "none":
        per_sample = solution["gap_rms_free_mm"] ** 2 / 3 / solution["n_effective"]
        along = per_sample / max(solution["singular_values"][5] ** 2, 1e-12)
        return leave_uncut(p_mm, q_mm, *axes, covariance_mm2, solution["slide_to_free_mm"], along)
    return project(
        p_mm,
        q_mm,
        *axes,
        covariance_mm2,
        float(np.radians(solution["axis_sd_deg"])),
        plane_point_mm=np.array(joint.plane.point_mm),
        plane_normal=np.array(joint.plane.normal),
        plane_in_parent=joint.plane.frame == "parent",
    )


def _centre(
    solution: Mapping[str, Any], placed: Projection, shift_mm: Array, model: SkeletonModel
) -> dict[str, Any]:
    """Where the centre is after the correction, how large its gap is and how far it can be trusted."""
    mean_rotation = _mean_rotation(solution)
    p_mm, q_mm = correct(placed.p_mm, placed.q_mm, shift_mm, mean_rotation)
    gap = gap_rms_mm(
        solution["gap_rms_free_mm"],
        solution["singular_values"][5],
        _vector(solution, "null_parent_"),
        _vector(solution, "null_child_"),
        placed.slide_mm - solution["slide_to_free_mm"],
        p_mm - placed.p_mm,
        q_mm - placed.q_mm,
        mean_rotation,
    )
    return {
        **_named("parent_", p_mm, "_mm"),
        **_named("child_", q_mm, "_mm"),
        "gap_rms_mm": gap if model.cut else solution["gap_rms_mm"],
        "covariance_mm2": placed.covariance_mm2.ravel(),
        "sd_mm": centre_sd_mm(placed.covariance_mm2),
        "slide_mm": placed.slide_mm,
        "axis_plane_deg": placed.axis_plane_deg,
    }


def _whole_error(
    joint: Joint, layout: Layout, placed: Projection, solution: Mapping[str, Any]
) -> dict[str, Any]:
    """The centre's error with what its frames cannot show; the scatter's part in a column of its own."""
    unseen_mm2 = unseen_covariance(
        joint,
        layout,
        placed,
        (_vector(solution, "null_parent_"), _vector(solution, "null_child_")),
        _mean_rotation(solution),
        solution["gap_rms_free_mm"],
        solution["range_deg"],
    )
    covariance_mm2 = placed.covariance_mm2 + unseen_mm2
    return {
        "scatter_sd_mm": centre_sd_mm(placed.covariance_mm2),
        "sd_mm": centre_sd_mm(covariance_mm2),
        "covariance_mm2": covariance_mm2.ravel(),
    }


def _mean_rotation(solution: Mapping[str, Any]) -> Array:
    return np.array([[solution[f"mean_rotation_{i}{j}"] for j in "xyz"] for i in "xyz"])


def _doubts(
    joint: Joint, layout: Layout, row: Mapping[str, Any], scatter_mm2: Array, model: SkeletonModel
) -> list[str]:
    """Say in words what makes the centre weak; nothing where nothing does.

    scatter_mm2 : (6, 6) covariance of the centre by its frames' scatter.
    """
    reasons = []
    worst_scatter_mm = worst_direction_sd_mm(scatter_mm2)
    hinge = is_worst_along(scatter_mm2, _vector(row, "axis_parent_"), _vector(row, "axis_child_"))
    where = "along its axis, where only a plane could place it" if hinge else "in the worst direction"
    if joint.compound:
        reasons.append(
            f"solved against {joint.parent_receiver} across {joint.parent}, which moves and carries no "
            "receiver: the centre can be centimetres off and nothing in the data shows it"
        )
    reasons += _disagreement(row)
    if row["range_deg"] < WEAK_RANGE_DEG:
        reasons.append(f"moved only {row['range_deg']:.1f} deg; skin motion alone can look like that")
    cut = row["axis_plane_deg"] is not None
    if cut and row["axis_plane_deg"] < model.parallel_limit_deg:
        reasons.append(
            f"its axis is {row['axis_plane_deg']:.0f} deg from the plane that cuts it, "
            f"which moved the centre {abs(row['slide_mm']):.0f} mm along it"
        )
    if worst_scatter_mm > WEAK_SCATTER_MM:
        reasons.append(f"its frames scatter by {worst_scatter_mm:.1f} mm {where}")
    elif row["sd_mm"] > WEAK_SD_MM and is_known(joint.child, layout):
        reasons.append(f"skin and the receivers' places leave the centre uncertain by {row['sd_mm']:.0f} mm")
    if cut and row["axis_sd_deg"] > WEAK_AXIS_SD_DEG:
        reasons.append(f"axis uncertain by {row['axis_sd_deg']:.0f} deg")
    return reasons


def _disagreement(row: Mapping[str, Any]) -> list[str]:
    if row["gap_rms_free_mm"] > WEAK_GAP_MM:
        return [
            f"its receivers disagree by {row['gap_rms_free_mm']:.0f} mm at best: a loose receiver, a wrong "
            "quaternion order or angle convention, or more skin than on a hand"
        ]
    if row["gap_rms_mm"] > WEAK_GAP_MM:
        return [
            f"its receivers disagree by {row['gap_rms_mm']:.0f} mm about this centre and by "
            f"{row['gap_rms_free_mm']:.0f} mm at best: what it was moved by does not fit its motion"
        ]
    return []


def _vector(row: Mapping[str, Any], prefix: str, suffix: str = "") -> Array:
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"])


def _named(prefix: str, vector: Array, suffix: str = "") -> dict[str, float]:
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", vector, strict=True)}
