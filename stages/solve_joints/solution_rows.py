"""Rows of the table joint_solutions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shukotsu.schemas.layout import Joint, Layout
from shukotsu.schemas.tables import vector_columns
from shukotsu.stages.solve_joints.closed import JointSolution

Row = dict[str, Any]

_SCALARS = (
    "gap_rms_mm",
    "gap_rms_free_mm",
    "slide_to_free_mm",
    "range_deg",
    "spread_deg",
    "axis_sd_deg",
    "n_frames",
    "n_effective",
)


def solution_rows(layout: Layout, solutions: Mapping[str, JointSolution | str]) -> list[Row]:
    """A row for every solvable joint of the layout, but not for an optional receiver not worn."""
    rows = []
    for joint in layout.solvable:
        solution = solutions[joint.name]
        optional = layout.segments[joint.parent_receiver].optional or layout.segments[joint.child].optional
        if not (optional and isinstance(solution, str)):
            rows.append(solution_row(joint, solution))
    return rows


def solution_row(joint: Joint, solution: JointSolution | str) -> Row:
    """The row of one joint, failed where `solution` is the reason why there is none."""
    names = {"joint": joint.name, "parent_segment": joint.parent_receiver, "child_segment": joint.child}
    if isinstance(solution, str):
        return {**names, "reason_values": "", "status": "failed", "message": solution, "n_frames": 0}
    return {
        **names,
        **vector_columns("parent_", solution.p_mm, "_mm"),
        **vector_columns("child_", solution.q_mm, "_mm"),
        **vector_columns("null_parent_", solution.null_parent),
        **vector_columns("null_child_", solution.null_child),
        **vector_columns("mean_rotation_x", solution.mean_rotation[0]),
        **vector_columns("mean_rotation_y", solution.mean_rotation[1]),
        **vector_columns("mean_rotation_z", solution.mean_rotation[2]),
        "singular_values": solution.singular_values,
        "covariance_mm2": solution.covariance_mm2.ravel(),
        **{name: getattr(solution, name) for name in _SCALARS},
        "reason_values": "",
        "status": "ok",
        "message": "",
    }
