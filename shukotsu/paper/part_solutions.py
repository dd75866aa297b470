"""Joint solutions of all parts of a subject; each recording is read, and each solver run, once per hand."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.errors import TableError, join_reasons
from shukotsu.paper.joint_solution import JointSolution, is_solvable, solve_closed, solve_stacked
from shukotsu.paper.moments import BLOCK_FRAMES, JointMoments, relative_poses
from shukotsu.study.layout import Joint, Layout
from shukotsu.study.model import JointSolving
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.parts import Part
from shukotsu.tables.poses import Poses, frame_count, pose_blocks, read_poses, usable_poses
from shukotsu.tables.typed_table import vector_columns, vector_of
from shukotsu.translation import listed

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointSolutionsRow


@dataclass(frozen=True)
class StreamedRecordings:
    """Result of one pass over recordings: moments of every solvable joint, and segments with any valid pose.

    Attributes
    ----------
    paths : tuple of Path
        The poses files.
    layout : Layout
        Layout of the hand.
    moments : JointMoments
        Moments of the joints in layout.solvable, in their order.
    seen : mapping
        Segment -> whether it has a valid pose in any frame.

    """

    paths: tuple[Path, ...]
    layout: Layout
    moments: JointMoments
    seen: Mapping[str, bool]


def stream_recordings(paths: Sequence[Path], layout: Layout) -> StreamedRecordings:
    """Read recordings once, keeping only moments in memory.

    Parameters
    ----------
    paths : sequence of Path
        Poses files.
    layout : Layout
        Layout of the hand.

    Returns
    -------
    StreamedRecordings
        Moments of all solvable joints.

    Raises
    ------
    InputError
        If a file is not a poses table.

    """
    moments = JointMoments(len(layout.solvable), sum(map(frame_count, paths)))
    seen = dict.fromkeys(layout.measured, False)
    for path in paths:
        for block in pose_blocks(path, layout.measured, BLOCK_FRAMES):
            add_block(moments, block, layout.solvable)
            for index, segment in enumerate(block.segments):
                seen[segment] |= bool(block.valid[:, index].any())
    return StreamedRecordings(tuple(paths), layout, moments, seen)


def solve_recordings(
    recordings: StreamedRecordings, settings: JointSolving
) -> dict[str, JointSolution | str]:
    """Solve every joint between two receivers (Eq. 1-7).

    Parameters
    ----------
    recordings : StreamedRecordings
        One hand's recordings.
    settings : JointSolving
        Solver and number of singular values.

    Returns
    -------
    dict
        Joint -> its solution, or the reason why it could not be solved.

    """
    solutions: dict[str, JointSolution | str] = {}
    for index, joint in enumerate(recordings.layout.solvable):
        if not is_solvable(recordings.moments, index):
            n_frames = int(recordings.moments.count[index])
            solutions[joint.name] = _reason(joint, recordings.seen, n_frames)
            continue
        solution = solve_closed(recordings.moments, index, settings.singular_values)
        if settings.solver == "stacked-svd":
            solution = _by_stack(solution, recordings.paths, joint, settings.singular_values)
        solutions[joint.name] = solution
    return solutions


def add_block(moments: JointMoments, block: Poses, joints: Sequence[Joint]) -> None:
    """Add a block of poses to the moments of joints.

    Parameters
    ----------
    moments : JointMoments
        Moments of the joints, changed in place.
    block : Poses
        Some frames of a recording.
    joints : sequence of Joint
        The joints, in the order of the moments.

    """
    parents = np.array([block.index(joint.parent_receiver) for joint in joints])
    children = np.array([block.index(joint.child) for joint in joints])
    moments.add(relative_poses(block.quaternion, block.position_mm, block.valid, parents, children))


def _by_stack(
    closed: JointSolution, paths: Sequence[Path], joint: Joint, n_singular_values: int
) -> JointSolution:
    """Solve the joint by the stacked SVD; precision and range of motion come from the closed solution."""
    pairs = [read_poses(path, (joint.parent_receiver, joint.child)) for path in paths]
    valid = np.concatenate([pair.valid.all(1) for pair in pairs])
    quaternion = np.concatenate([pair.quaternion for pair in pairs])[valid]
    position_mm = np.concatenate([pair.position_mm for pair in pairs])[valid]
    stacked = solve_stacked(
        quaternion[:, 0], position_mm[:, 0], quaternion[:, 1], position_mm[:, 1], n_singular_values
    )
    sign = 1.0 if stacked.null_child @ closed.null_child >= 0 else -1.0
    nulls = {"null_parent": sign * stacked.null_parent, "null_child": sign * stacked.null_child}
    return replace(closed, **vars(stacked) | nulls)


def _reason(joint: Joint, seen: Mapping[str, bool], n_frames: int) -> str:
    """Return the reason why the joint could not be solved."""
    dead = [segment for segment in (joint.parent_receiver, joint.child) if not seen[segment]]
    if dead:
        return f"no valid pose of {listed(dead)}; check that receiver"
    if n_frames < 2:
        ends = f"{joint.parent_receiver} and {joint.child}"
        return f"{ends} have {n_frames} valid frames in common; expected 2 or more"
    return "the joint did not move, so its centre cannot be found; record it moving"


def solve_parts(plan: SubjectPlan) -> dict[Part, list[JointSolutionsRow] | Exception]:
    """Solve all parts of a subject; every recording is read and every solver run once for each hand.

    Parameters
    ----------
    plan : SubjectPlan
        Plan of the subject.

    Returns
    -------
    dict
        Part -> its rows of joint_solutions, or the exception with which it failed.

    Raises
    ------
    TableError
        If a file is not a poses table.

    """
    groups: dict[tuple[str, tuple[Path, ...]], list[Part]] = {}
    for part in plan.parts():
        calibration = plan.calibrating(part.hand, part.model, part.made_without)
        groups.setdefault((part.hand, tuple(map(plan.poses, calibration))), []).append(part)
    outcomes: dict[Part, list[JointSolutionsRow] | Exception] = {}
    for (hand, poses), parts in groups.items():
        settings = {part: plan.models[part.model].solving for part in parts}
        try:
            rows = _rows_by_settings(plan.layouts[hand], poses, settings.values())
        except TableError:
            raise
        except Exception as error:  # even a bug must not stop the study's other hands
            outcomes |= dict.fromkeys(parts, error)
        else:
            outcomes |= {part: rows[setting] for part, setting in settings.items()}
    return outcomes


def _rows_by_settings(
    layout: Layout, poses: Sequence[Path], settings: Iterable[JointSolving]
) -> dict[JointSolving, list[JointSolutionsRow]]:
    """Return the rows of joint_solutions of one hand's recordings for every solver setting."""
    usable, reasons = usable_poses(poses)
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    recordings = stream_recordings(usable, layout)
    rows = {
        each: solution_rows(layout, solve_recordings(recordings, each)) for each in dict.fromkeys(settings)
    }
    if not usable:
        why = f"no calibration recording: {join_reasons(reasons) or 'the study names none'}"
        rows = {setting: [{**row, "message": why} for row in failed] for setting, failed in rows.items()}
    return rows


def solution_rows(layout: Layout, solutions: Mapping[str, JointSolution | str]) -> list[JointSolutionsRow]:
    """Build a row for every solvable joint, except failed joints at an optional receiver not worn."""
    rows = []
    for joint in layout.solvable:
        solution = solutions[joint.name]
        optional = layout.segments[joint.parent_receiver].optional or layout.segments[joint.child].optional
        if not (optional and isinstance(solution, str)):
            rows.append(solution_row(joint, solution))
    return rows


def solution_row(joint: Joint, solution: JointSolution | str) -> JointSolutionsRow:
    """Build the row of joint_solutions of one joint; `solution` is the reason if the joint failed."""
    row: JointSolutionsRow = {
        "joint": joint.name,
        "parent_segment": joint.parent_receiver,
        "child_segment": joint.child,
        "reason_values": "",
    }
    if isinstance(solution, str):
        return row | {"status": "failed", "message": solution, "n_frames": 0}
    row |= vector_columns("parent_", solution.p_mm, "_mm") | vector_columns("child_", solution.q_mm, "_mm")
    row |= vector_columns("null_parent_", solution.null_parent)
    row |= vector_columns("null_child_", solution.null_child)
    for axis, turned in zip("xyz", solution.mean_rotation, strict=True):
        row |= vector_columns(f"mean_rotation_{axis}", turned)
    row |= {
        "singular_values": solution.singular_values.tolist(),
        "covariance_mm2": solution.covariance_mm2.ravel().tolist(),
        "status": "ok",
        "message": "",
    }
    numbers: Any = {name: getattr(solution, name) for name in _NUMBERS}
    row |= numbers
    return row


_NUMBERS = (
    *("gap_rms_mm", "gap_rms_free_mm", "slide_to_free_mm", "range_deg", "spread_deg", "axis_sd_deg"),
    *("n_frames", "n_effective"),
)
"""Numbers of a solution that are columns of the same name."""


def solution_of(row: JointSolutionsRow) -> JointSolution:
    """Convert a row of joint_solutions that did not fail to a solution; inverse of `solution_row`."""
    numbers: Any = row
    return JointSolution(
        p_mm=vector_of(row, "parent_", "_mm"),
        q_mm=vector_of(row, "child_", "_mm"),
        null_parent=vector_of(row, "null_parent_"),
        null_child=vector_of(row, "null_child_"),
        mean_rotation=np.array([vector_of(row, f"mean_rotation_{axis}") for axis in "xyz"]),
        singular_values=np.array(row["singular_values"]),
        covariance_mm2=np.reshape(row["covariance_mm2"], (6, 6)),
        **{name: numbers[name] for name in _NUMBERS},
    )
