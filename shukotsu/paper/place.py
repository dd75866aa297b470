"""Joint centre from a joint solution: plane, manual correction, then the error that the data cannot show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from shukotsu.errors import InputError
from shukotsu.hand.average_hand import BONE_KINDS, DIGITS, PRIOR
from shukotsu.hand.rotations import Array, cross_matrix, nearest_rotation
from shukotsu.paper import plane
from shukotsu.paper.closed import JointSolution
from shukotsu.paper.part_solutions import solution_of
from shukotsu.paper.plane import Projection
from shukotsu.study.layout import Joint, Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.verdict import ACROSS, AXIS_IN_PLANE, BY_HAND, UNJUDGED, Values, note_doubts
from shukotsu.tables.catalogue import JOINT_SOLUTIONS
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.typed_table import rows_of, vector_columns, vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow, JointSolutionsRow

MARGIN = 1.7
"""Factor by which skin motion and receiver misplacement may exceed the tabulated sizes.

Set on simulated hands: with it the stated 95 % hold for another law of skin motion, and for receivers
misplaced by twice the tabulated sizes.
"""

TYPICAL_GAP_MM = 1.0
"""Rms gap of a joint under typical skin motion; a larger gap scales the assumed skin motion up in proportion.
"""

NEIGHBOUR_RANGE_DEG = 30.0
"""Range of motion of a neighbouring joint that is correlated with the joint's own.

It moves the skin of both receivers, and displaces the centre more the less the joint itself moves.
"""

COMPOUND_SD_MM = 6.0
"""Three-dimensional standard deviation of a centre solved across a moving bone without a receiver.

Set on simulated hands.
"""

UNKNOWN_PLACE_SD_MM = 5.0
"""Standard deviation of a receiver's lateral position on a segment without tabulated anatomy (our choice)."""


def unseen_covariance(
    joint: Joint,
    layout: Layout,
    placed: Projection,
    axes: tuple[Array, Array],
    mean_rotation: Array,
    gap_rms_mm: float,
    range_deg: float,
) -> Array:
    """Covariance of a centre from errors that leave neither scatter nor a gap: skin motion and receiver
    placement.

    docs/method.md, "Uncertainty". Both halves are off by the same vector, since they coincide.

    Parameters
    ----------
    joint, layout : Joint, Layout
        The joint and the layout of the hand.
    placed : Projection
        The centre on its plane.
    axes : tuple of array, shape (3,)
        Unit axis in the parent's and the child's receiver frame.
    mean_rotation : array, shape (3, 3)
        Mean rotation, child to parent.
    gap_rms_mm : float
        Rms gap of the six-value solution.
    range_deg : float
        Range of motion about the axis.

    Returns
    -------
    array, shape (6, 6)
        Covariance of (p, q), mm^2.

    """
    to_parent = nearest_rotation(mean_rotation)
    slides = [
        _slide_covariance(segment, layout, half_mm, _looseness(segment, layout, gap_rms_mm))
        for segment, half_mm in ((joint.parent_receiver, placed.p_mm), (joint.child, placed.q_mm))
    ]
    turn = cross_matrix(axes[1])
    neighbours = 1.0 + (NEIGHBOUR_RANGE_DEG / max(range_deg, 1.0)) ** 2
    skin_mm2 = turn @ (to_parent.T @ slides[0] @ to_parent + slides[1]) @ turn.T
    if joint.compound:
        skin_mm2 += COMPOUND_SD_MM**2 / 3 * np.eye(3)
    skin_mm2 = neighbours * skin_mm2 + _along_variance_mm2(joint, layout, placed) * np.outer(axes[1], axes[1])
    both = np.vstack([to_parent, np.eye(3)])
    return np.asarray(both @ skin_mm2 @ both.T)


def _looseness(segment: str, layout: Layout, gap_rms_mm: float) -> float:
    """Factor on the tabulated skin motion of a segment, from the gap and the margin."""
    if _is_known(segment, layout):
        return MARGIN * max(1.0, gap_rms_mm / TYPICAL_GAP_MM)
    return max(1.0, gap_rms_mm / PRIOR.UNKNOWN_SLIDE_SD_MM)


def _along_variance_mm2(joint: Joint, layout: Layout, placed: Projection) -> float:
    """Variance along the axis of the point where the plane cuts it, mm^2; 0 for a joint without a plane."""
    if placed.axis_plane_deg is None:
        return 0.0
    in_parent = joint.plane.frame == "parent"
    segment = joint.parent_receiver if in_parent else joint.child
    place_mm2 = UNKNOWN_PLACE_SD_MM**2
    if _is_known(segment, layout):
        lever_mm = float(np.linalg.norm(placed.p_mm if in_parent else placed.q_mm))
        place_mm2 = MARGIN**2 * (PRIOR.MOUNT_SD_MM[1] ** 2 + (PRIOR.MOUNT_TURN_SD_RAD * lever_mm) ** 2)
    return place_mm2 / float(np.sin(np.radians(placed.axis_plane_deg))) ** 2


def _is_known(segment: str, layout: Layout) -> bool:
    """Whether the anatomy tables cover the segment: the hand itself, or a bone of one of its digits."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return True
    digit, _, kind = segment.rpartition("_")
    return digit in DIGITS and kind in BONE_KINDS and (digit, kind) != ("thumb", "middle")


def _slide_covariance(segment: str, layout: Layout, lever_mm: Array, looseness: float) -> Array:
    """Covariance (3, 3), mm^2 per rad^2, of a point's skin motion as its receiver sees it; lever_mm (3,)."""
    if layout.wrist is not None and segment == layout.wrist.segment:
        return np.asarray((looseness * PRIOR.PALM_SLIDE_SD_MM) ** 2 * np.eye(3))
    if not _is_known(segment, layout):
        return np.asarray((looseness * PRIOR.UNKNOWN_SLIDE_SD_MM) ** 2 * np.eye(3))
    if segment == "thumb_metacarpal":
        looseness *= PRIOR.JOINTWISE_THENAR
    elif segment.endswith("_distal"):
        looseness *= PRIOR.JOINTWISE_NAIL
    axes, cross = layout.segments[segment].axes, cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(PRIOR.JOINTWISE_SLIDE_SD_MM)) @ axes.T
    return np.asarray(looseness**2 * (slide + PRIOR.JOINTWISE_TILT_SD**2 * cross @ cross.T))


def place_joints(solutions: Path, plan: SubjectPlan, part: Part) -> list[JointCentresRow]:
    """Rows of joint_centres of one skeleton from its rows of joint_solutions.

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
        Where the table has a joint that the layout lacks.

    """
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    rows_of_hand = [
        row for row in plan.rows["corrections"] if row["hand"] == part.hand and model.planes.corrections
    ]
    corrections_mm = {row["joint"]: vector_of(row.values, "d", "_mm") for row in rows_of_hand}
    rows = []
    for solution in rows_of(read_part(solutions, JOINT_SOLUTIONS, part)):
        joint = layout.joints.get(solution["joint"])
        if joint is None:
            raise InputError(
                f"{solutions}: joint {solution['joint']} is not in layout {layout.name}; "
                "give the layout that the joints were solved with"
            )
        row = place_joint(joint, layout, solution, model, corrections_mm.get(joint.name))
        row |= {"subject": plan.who.subject, "session": plan.who.session}
        rows.append(row)
    return rows


def place_joint(
    joint: Joint,
    layout: Layout,
    solution: JointSolutionsRow,
    model: SkeletonModel,
    correction_mm: Array | None,
) -> JointCentresRow:
    """Row of joint_centres of one joint, without subject, hand and model.

    Parameters
    ----------
    joint, layout : Joint, Layout
        The joint and the layout of the hand.
    solution : mapping
        Its row of joint_solutions.
    model : SkeletonModel
        The model, which says whether planes cut axes.
    correction_mm : array, shape (3,), or None
        Manual correction in the child's receiver frame.

    Returns
    -------
    dict
        A failed solution gives a row without numbers.

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
    placed = _projection(joint, solved, cut=model.planes.cut)
    if placed is None:
        return row | {"status": "failed", "message": "the axis lies in the plane that should cut it"}
    shift_mm = np.zeros(3) if correction_mm is None else correction_mm
    row |= _centre(solved, placed, shift_mm, model)
    doubts: dict[str, Values] = {}
    if model.planes.cut:
        row |= _whole_error(joint, layout, placed, solved)
        doubts |= _doubts(joint, row, model)
    if correction_mm is not None:
        row["source"], row["correction_mm"] = "fit, corrected by hand", float(np.linalg.norm(shift_mm))
        doubts[BY_HAND] = {"correction_mm": row["correction_mm"]}
    row |= note_doubts(doubts)
    return row


def _projection(joint: Joint, solution: JointSolution, *, cut: bool) -> Projection | None:
    """The centre where the plane cuts the axis, or as solved where the model uses no planes."""
    if not cut:
        return Projection(solution.p_mm, solution.q_mm, 0.0, None, solution.covariance_mm2)
    if joint.plane.frame == "none":
        return plane.leave_uncut(solution)
    return plane.project(solution, joint.plane)


def _centre(
    solution: JointSolution, placed: Projection, shift_mm: Array, model: SkeletonModel
) -> JointCentresRow:
    """Columns of the corrected centre: its position, gap and scatter."""
    p_mm, q_mm = plane.correct(placed.p_mm, placed.q_mm, shift_mm, solution.mean_rotation)
    gap = plane.gap_rms_mm(solution, placed.slide_mm, p_mm - placed.p_mm, q_mm - placed.q_mm)
    row: JointCentresRow = {
        "gap_rms_mm": gap if model.planes.cut else solution.gap_rms_mm,
        "covariance_mm2": placed.covariance_mm2.ravel().tolist(),
        "sd_mm": plane.centre_sd_mm(placed.covariance_mm2),
        "slide_mm": placed.slide_mm,
        "axis_plane_deg": placed.axis_plane_deg,
    }
    row |= vector_columns("parent_", p_mm, "_mm") | vector_columns("child_", q_mm, "_mm")
    return row


def _whole_error(
    joint: Joint, layout: Layout, placed: Projection, solution: JointSolution
) -> JointCentresRow:
    """Columns of the total error, scatter plus unseen errors, with the scatter alone in scatter_sd_mm."""
    unseen_mm2 = unseen_covariance(
        joint,
        layout,
        placed,
        (solution.null_parent, solution.null_child),
        solution.mean_rotation,
        solution.gap_rms_free_mm,
        solution.range_deg,
    )
    covariance_mm2 = placed.covariance_mm2 + unseen_mm2
    return {
        "scatter_sd_mm": plane.centre_sd_mm(placed.covariance_mm2),
        "sd_mm": plane.centre_sd_mm(covariance_mm2),
        "covariance_mm2": covariance_mm2.ravel().tolist(),
    }


def _doubts(joint: Joint, row: JointCentresRow, model: SkeletonModel) -> dict[str, Values]:
    """Doubts about the centre, by kind, with the numbers that they quote."""
    doubts: dict[str, Values] = {}
    if joint.compound:
        doubts[ACROSS] = {"segment": joint.parent, "receiver": joint.parent_receiver}
    angle_deg = row["axis_plane_deg"]
    if angle_deg is not None and angle_deg < model.planes.parallel_limit_deg:
        doubts[AXIS_IN_PLANE] = {"axis_plane_deg": angle_deg, "slide_mm": abs(row["slide_mm"])}
    return doubts
