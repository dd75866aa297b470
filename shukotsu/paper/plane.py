"""Joint centres: intersection of the axis with section 4's plane, manual corrections, stated error."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from shukotsu.arrays import Float
from shukotsu.errors import InputError
from shukotsu.hand.rotations import Array, nearest_rotation, unit
from shukotsu.paper.joint_solution import JointSolution
from shukotsu.paper.part_solutions import solution_of
from shukotsu.paper.unseen_error import unseen_covariance
from shukotsu.study.layout import Joint, Layout, Plane
from shukotsu.study.model import SkeletonModel
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.verdict import ACROSS, AXIS_IN_PLANE, BY_HAND, UNJUDGED, Values, note_doubts
from shukotsu.tables.catalogue import JOINT_SOLUTIONS
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.typed_table import rows_of, vector_columns, vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow, JointSolutionsRow


@dataclass(frozen=True)
class Projection:
    """Joint centre on its plane.

    Attributes
    ----------
    p_mm, q_mm : array, shape (3,)
        Centre in the parent's and the child's receiver frame, mm.
    slide_mm : float
        Signed distance moved along the axis.
    axis_plane_deg : float or None
        Angle between axis and plane, 0 to 90 deg; None without a plane.
    covariance_mm2 : array, shape (6, 6)
        Covariance of (p, q), mm^2.

    """

    p_mm: Array
    q_mm: Array
    slide_mm: float
    axis_plane_deg: float | None
    covariance_mm2: Array


def project(solution: JointSolution, plane: Plane) -> Projection | None:
    """Slide both halves of a centre along the axis by the same amount, onto the plane (end of section 4).

    Separate planes for the two halves would leave a constant gap along the axis. Solutions with five and with
    six singular values differ only along the axis and therefore project to the same point.

    Parameters
    ----------
    solution : JointSolution
        The joint's centre, axis and covariance.
    plane : Plane
        Point (mm) and normal in the parent's or the child's receiver frame.

    Returns
    -------
    Projection or None
        None if the axis lies in the plane.

    """
    p_mm, q_mm, covariance_mm2 = solution.p_mm, solution.q_mm, solution.covariance_mm2
    axis_parent, axis_child = solution.null_parent, solution.null_child
    axis_sd_rad, in_parent = float(np.radians(solution.axis_sd_deg)), plane.frame == "parent"
    normal = unit(np.array(plane.normal))
    point_mm, axis_in_plane = (p_mm, axis_parent) if in_parent else (q_mm, axis_child)
    sine = float(axis_in_plane @ normal)
    if abs(sine) < 1e-9:
        return None
    slide = float((np.array(plane.point_mm) - point_mm) @ normal) / sine
    null = np.concatenate([axis_parent, axis_child])
    cut = np.concatenate([normal, np.zeros(3)] if in_parent else [np.zeros(3), normal])
    onto_plane = np.eye(6) - np.outer(null, cut) / sine
    covariance = covariance_mm2.copy()  # an axis error moves each half sideways by half the variance
    for part, axis in ((slice(0, 3), axis_parent), (slice(3, 6), axis_child)):
        covariance[part, part] += (np.eye(3) - np.outer(axis, axis)) * (slide * axis_sd_rad) ** 2 / 2
    return Projection(
        p_mm=p_mm + slide * axis_parent,
        q_mm=q_mm + slide * axis_child,
        slide_mm=slide,
        axis_plane_deg=float(np.degrees(np.arcsin(min(abs(sine), 1.0)))),
        covariance_mm2=onto_plane @ covariance @ onto_plane.T,
    )


def leave_uncut(solution: JointSolution) -> Projection:
    """Return the centre of the six-value solution, for a joint without a plane.

    Parameters
    ----------
    solution : JointSolution
        The joint's five-value centre, the distance along the axis to the six-value one, and the covariance
        without the axis direction.

    Returns
    -------
    Projection
        The centre, with axis_plane_deg None. Its variance along the null vector is the variance of the mean
        gap per component over the squared smallest singular value.

    """
    slide_mm = solution.slide_to_free_mm
    per_sample_mm2 = solution.gap_rms_free_mm**2 / 3 / solution.n_effective
    along_mm2 = per_sample_mm2 / max(float(solution.singular_values[5]) ** 2, 1e-12)
    null = np.concatenate([solution.null_parent, solution.null_child]) / np.sqrt(2)
    across = np.eye(6) - np.outer(null, null)
    return Projection(
        p_mm=solution.p_mm + slide_mm * solution.null_parent,
        q_mm=solution.q_mm + slide_mm * solution.null_child,
        slide_mm=slide_mm,
        axis_plane_deg=None,
        covariance_mm2=across @ solution.covariance_mm2 @ across.T + along_mm2 * np.outer(null, null),
    )


def centre_sd_mm(covariance_mm2: Float[Array, "6 6"]) -> float:
    """Return the three-dimensional standard deviation of a centre, the larger one of its two halves.

    Parameters
    ----------
    covariance_mm2 : array, shape (6, 6)
        Covariance of (p, q).

    Returns
    -------
    float
        Standard deviation, mm.

    """
    variance = np.maximum(np.diag(covariance_mm2), 0.0)
    return float(np.sqrt(max(variance[:3].sum(), variance[3:].sum())))


def gap_rms_mm(
    solution: JointSolution,
    slide_mm: float,
    shift_parent_mm: Float[Array, " 3"],
    shift_child_mm: Float[Array, " 3"],
) -> float:
    """Compute the root mean square gap of a centre that was moved along the axis and, possibly, corrected.

    The mean square gap is a quadratic form about the six-value solution with the normal matrix [[I, -M],
    [-M^T, I]], M the mean of R_a^T R_b; along the axis it grows with the square of the smallest singular
    value.

    Parameters
    ----------
    solution : JointSolution
        The joint as solved.
    slide_mm : float
        Displacement of both halves along the axis.
    shift_parent_mm, shift_child_mm : array, shape (3,)
        Correction of p and of q in their frames, mm.

    Returns
    -------
    float
        Rms gap, mm.

    """
    beyond_free_mm = slide_mm - solution.slide_to_free_mm
    floor = float(solution.singular_values[5]) ** 2
    along = 2 * floor * beyond_free_mm**2
    towards_mm = solution.null_parent @ shift_parent_mm + solution.null_child @ shift_child_mm
    both = 2 * floor * beyond_free_mm * towards_mm
    across = (
        shift_parent_mm @ shift_parent_mm
        + shift_child_mm @ shift_child_mm
        - 2 * shift_parent_mm @ solution.mean_rotation @ shift_child_mm
    )
    return float(np.sqrt(solution.gap_rms_free_mm**2 + max(float(along + both + across), 0.0)))


def place_joints(solutions: Path, plan: SubjectPlan, part: Part) -> list[JointCentresRow]:
    """Convert one skeleton's rows of joint_solutions to rows of joint_centres.

    Parameters
    ----------
    solutions : Path
        The table joint_solutions.
    plan : SubjectPlan
        Plan of the subject.
    part : Part
        The skeleton.

    Returns
    -------
    list of dict
        One row for each joint.

    Raises
    ------
    InputError
        If the table has a joint that the layout lacks.

    """
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    sheet = plan.rows["corrections"] if model.planes.corrections else []
    corrections_mm = {r["joint"]: vector_of(r.values, "d", "_mm") for r in sheet if r["hand"] == part.hand}
    rows = []
    for solution in rows_of(read_part(solutions, JOINT_SOLUTIONS, part)):
        joint = layout.joints.get(solution["joint"])
        if joint is None:
            raise InputError(
                f"{solutions}: joint {solution['joint']} is not in layout {layout.name}; "
                "use the layout with which the joints were solved"
            )
        rows.append(place_joint(joint, layout, solution, model, corrections_mm.get(joint.name)))
    return rows


def place_joint(
    joint: Joint,
    layout: Layout,
    solution: JointSolutionsRow,
    model: SkeletonModel,
    correction_mm: Array | None,
) -> JointCentresRow:
    """Build the row of joint_centres of one joint, without subject, hand and model.

    Parameters
    ----------
    joint, layout : Joint, Layout
        The joint and the layout of the hand.
    solution : mapping
        Its row of joint_solutions.
    model : SkeletonModel
        The model, which states whether planes cut axes.
    correction_mm : array, shape (3,), or None
        Manual correction in the child's receiver frame.

    Returns
    -------
    dict
        The row; without numbers if the solution failed.

    """
    dof = 3 if joint.plane.frame == "none" else 1
    row: JointCentresRow = {
        "joint": joint.name,
        "parent_segment": joint.parent_receiver,
        "child_segment": joint.child,
        "dof": dof if model.planes.cut else max(joint.dof, 1),
        "source": "fit",
        "n_frames": solution["n_frames"],
        "status": solution["status"],
        "message": solution["message"],
    }
    row |= UNJUDGED
    if solution["status"] == "failed":
        return row
    solved = solution_of(solution)
    numbers = ("gap_rms_free_mm", "range_deg", "axis_sd_deg", "n_effective")
    row |= cast(Any, {name: getattr(solved, name) for name in numbers})
    row |= vector_columns("axis_parent_", solved.null_parent)
    row |= vector_columns("axis_child_", solved.null_child)
    placed: Projection | None = Projection(solved.p_mm, solved.q_mm, 0.0, None, solved.covariance_mm2)
    if model.planes.cut:
        placed = leave_uncut(solved) if joint.plane.frame == "none" else project(solved, joint.plane)
    if placed is None:
        return row | {"status": "failed", "message": "the axis lies in the plane that should cut it"}
    shift_mm = np.zeros(3) if correction_mm is None else correction_mm
    row |= _centre(solved, placed, shift_mm, model)
    doubts: dict[str, Values] = {}
    if model.planes.cut:
        whole_mm2 = placed.covariance_mm2 + unseen_covariance(joint, layout, placed, solved)
        row["scatter_sd_mm"], row["sd_mm"] = row["sd_mm"], centre_sd_mm(whole_mm2)
        row["covariance_mm2"] = whole_mm2.ravel().tolist()
        doubts |= _doubts(joint, row, model)
    if correction_mm is not None:
        row["source"], row["correction_mm"] = "fit, corrected by hand", float(np.linalg.norm(shift_mm))
        doubts[BY_HAND] = {"correction_mm": row["correction_mm"]}
    row |= note_doubts(doubts)
    return row


def _centre(
    solution: JointSolution, placed: Projection, shift_mm: Array, model: SkeletonModel
) -> JointCentresRow:
    """Build the columns of the corrected centre: its position, gap and scatter.

    shift_mm : (3,) manual correction (section 6) in the child's frame; the parent's half moves by the same in
    the mean posture.
    """
    p_mm = placed.p_mm + nearest_rotation(solution.mean_rotation) @ shift_mm
    q_mm = placed.q_mm + shift_mm
    gap = gap_rms_mm(solution, placed.slide_mm, p_mm - placed.p_mm, q_mm - placed.q_mm)
    row: JointCentresRow = {
        "gap_rms_mm": gap if model.planes.cut else solution.gap_rms_mm,
        "covariance_mm2": placed.covariance_mm2.ravel().tolist(),
        "sd_mm": centre_sd_mm(placed.covariance_mm2),
        "slide_mm": placed.slide_mm,
        "axis_plane_deg": placed.axis_plane_deg,
    }
    row |= vector_columns("parent_", p_mm, "_mm") | vector_columns("child_", q_mm, "_mm")
    return row


def _doubts(joint: Joint, row: JointCentresRow, model: SkeletonModel) -> dict[str, Values]:
    """List doubts about the centre by kind, with the values that their sentences quote."""
    doubts: dict[str, Values] = {}
    if joint.compound:
        doubts[ACROSS] = {"segment": joint.parent, "receiver": joint.parent_receiver}
    angle_deg = row["axis_plane_deg"]
    if angle_deg is not None and angle_deg < model.planes.parallel_limit_deg:
        doubts[AXIS_IN_PLANE] = {"axis_plane_deg": angle_deg, "slide_mm": abs(row["slide_mm"])}
    return doubts
