"""Every joint of a hand, from one streaming pass over its calibration recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from schemas.layout import Joint, Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, pose_blocks, read_poses
from stages.solve_joints.anatomical import HandSample, solve_hand
from stages.solve_joints.closed import JointSolution, is_solvable, solve_closed
from stages.solve_joints.moments import BATCH_FRAMES, JointMoments, RelativePoses, relative_poses
from stages.solve_joints.stacked import solve_stacked

BLOCK_FRAMES = 4096 * BATCH_FRAMES


def solve_recordings(
    paths: Sequence[Path],
    layout: Layout,
    model: SkeletonModel,
    hand: str = "right",
    hand_length_mm: float | None = None,
) -> dict[str, JointSolution | str]:
    """Solve every joint between two receivers; a joint without an answer has the reason instead.

    hand, hand_length_mm : whose anatomy to expect, for the solver `anatomical` alone.
    """
    joints = layout.solvable
    sample = HandSample(joints) if model.solver == "anatomical" else None
    moments, seen = stream(paths, layout, sample)
    if sample is not None:
        solved = solve_hand(sample, moments, layout, hand, hand_length_mm)
        return {
            joint.name: solved.get(joint.name) or _reason(joint, seen, int(moments.count[index]))
            for index, joint in enumerate(joints)
        }
    found: dict[str, JointSolution | str] = {}
    for index, joint in enumerate(joints):
        if is_solvable(moments, index):
            solution = solve_closed(moments, index, model.singular_values)
            if model.solver == "stacked-svd":
                solution = _by_stack(solution, paths, joint, model.singular_values)
            found[joint.name] = solution
        else:
            found[joint.name] = _reason(joint, seen, int(moments.count[index]))
    return found


def stream(
    paths: Sequence[Path], layout: Layout, sample: HandSample | None
) -> tuple[JointMoments, dict[str, bool]]:
    """Go through recordings once: moments of every joint, and which segments had a valid pose.

    sample : of the layout's solvable joints, to be filled along, or None.
    """
    moments = JointMoments(len(layout.solvable))
    seen = dict.fromkeys(layout.measured, False)
    for path in paths:
        for block in pose_blocks(path, layout.measured, BLOCK_FRAMES):
            relative = add_block(moments, block, layout.solvable)
            if sample is not None:
                sample.add(relative)
            for segment, valid in zip(block.segments, np.any(block.valid, axis=0).tolist(), strict=True):
                seen[segment] |= valid
    return moments, seen


def add_block(moments: JointMoments, block: Poses, joints: Sequence[Joint]) -> RelativePoses:
    """Add a block of poses to the moments of those joints; give the joints' relative poses."""
    parents = np.array([block.index(joint.parent_receiver) for joint in joints])
    children = np.array([block.index(joint.child) for joint in joints])
    relative = relative_poses(block.quaternion, block.position_mm, block.valid, parents, children)
    moments.add(relative)
    return relative


def _by_stack(
    closed: JointSolution, paths: Sequence[Path], joint: Joint, n_singular_values: int
) -> JointSolution:
    """The same joint by the stacked SVD; what only the moments tell (precision, range) is kept."""
    pairs = [read_poses(path, (joint.parent_receiver, joint.child)) for path in paths]
    valid = np.concatenate([pair.valid.all(1) for pair in pairs])
    quaternion = np.concatenate([pair.quaternion for pair in pairs])[valid]
    position_mm = np.concatenate([pair.position_mm for pair in pairs])[valid]
    stacked = solve_stacked(
        quaternion[:, 0], position_mm[:, 0], quaternion[:, 1], position_mm[:, 1], n_singular_values
    )
    sign = 1.0 if stacked.null_child @ closed.null_child >= 0 else -1.0
    return replace(
        closed,
        p_mm=stacked.p_mm,
        q_mm=stacked.q_mm,
        null_parent=sign * stacked.null_parent,
        null_child=sign * stacked.null_child,
        singular_values=stacked.singular_values,
    )


def _reason(joint: Joint, seen: dict[str, bool], n_frames: int) -> str:
    dead = [segment for segment in (joint.parent_receiver, joint.child) if not seen[segment]]
    if dead:
        return f"no valid pose of {' and '.join(dead)}; check that receiver"
    if n_frames < 2:
        return f"{joint.parent_receiver} and {joint.child} have {n_frames} valid frames in common; expected 2"
    return "the joint did not move, so its centre cannot be found; record it moving"
