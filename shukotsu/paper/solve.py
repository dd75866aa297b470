"""Every joint of a hand, from one streaming pass over its calibration recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shukotsu.paper.closed import JointSolution, is_solvable, solve_closed
from shukotsu.paper.moments import BLOCK_FRAMES, JointMoments, relative_poses
from shukotsu.paper.stacked import solve_stacked
from shukotsu.study.layout import Joint, Layout
from shukotsu.study.model import JointSolving
from shukotsu.tables.poses import Poses, frame_count, pose_blocks, read_poses
from shukotsu.translation import listed


@dataclass(frozen=True)
class StreamedRecordings:
    """Recordings read once: moments of every solvable joint, and which segments had a valid pose."""

    paths: tuple[Path, ...]
    layout: Layout
    moments: JointMoments
    seen: Mapping[str, bool]


def stream_recordings(paths: Sequence[Path], layout: Layout) -> StreamedRecordings:
    """Go through recordings once; only moments stay in memory. Raises InputError for no poses table."""
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
    """Solve every joint between two receivers; a joint without an answer has the reason instead."""
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
    """Add a block of poses to the moments of those joints."""
    parents = np.array([block.index(joint.parent_receiver) for joint in joints])
    children = np.array([block.index(joint.child) for joint in joints])
    moments.add(relative_poses(block.quaternion, block.position_mm, block.valid, parents, children))


def _by_stack(
    closed: JointSolution, paths: Sequence[Path], joint: Joint, n_singular_values: int
) -> JointSolution:
    """Solve the same joint by the stacked SVD; what only the moments tell (precision, range) is kept."""
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
    dead = [segment for segment in (joint.parent_receiver, joint.child) if not seen[segment]]
    if dead:
        return f"no valid pose of {listed(dead)}; check that receiver"
    if n_frames < 2:
        ends = f"{joint.parent_receiver} and {joint.child}"
        return f"{ends} have {n_frames} valid frames in common; expected 2 or more"
    return "the joint did not move, so its centre cannot be found; record it moving"
