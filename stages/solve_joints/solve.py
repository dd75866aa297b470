"""Every joint of a hand, from one streaming pass over its calibration recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shukotsu.schemas.layout import Joint, Layout
from shukotsu.schemas.model import JointSolving
from shukotsu.schemas.poses import Poses, frame_count, pose_blocks, read_poses
from shukotsu.sentences.messages import message_of
from shukotsu.stages.solve_joints.anatomical import HandSample, WeighedHand, solutions, weigh_hand
from shukotsu.stages.solve_joints.closed import JointSolution, is_solvable, solve_closed
from shukotsu.stages.solve_joints.moments import BLOCK_FRAMES, JointMoments, RelativePoses, relative_poses
from shukotsu.stages.solve_joints.stacked import solve_stacked

ANATOMICAL = "anatomical"
"""The solver that weighs joints against anatomy, for which frames are sampled."""


@dataclass(frozen=True)
class HandDescription:
    """Whose anatomy to expect: the side, right or left, and the length where it was measured."""

    side: str
    length_mm: float | None = None


@dataclass(frozen=True)
class StreamedRecordings:
    """Recordings read once: moments of every solvable joint, and which segments had a valid pose.

    sample : frames spread over the postures; None where they were not sampled.
    """

    paths: tuple[Path, ...]
    layout: Layout
    moments: JointMoments
    seen: Mapping[str, bool]
    sample: HandSample | None

    def weigh(self, hand: HandDescription) -> WeighedHand | None:
        """Weigh the sample against anatomy, see `anatomical.weigh_hand`."""
        if self.sample is None:
            raise ValueError("the frames were not sampled")
        return weigh_hand(self.sample, self.moments, self.layout, hand.side, hand.length_mm)


def stream_recordings(paths: Sequence[Path], layout: Layout, *, sample_frames: bool) -> StreamedRecordings:
    """Go through recordings once; only moments and samples stay in memory.

    sample_frames : whether to sample frames of the layout's solvable joints along the way. Raises InputError
    where a file is no poses table.
    """
    moments = JointMoments(len(layout.solvable), sum(map(frame_count, paths)))
    sample = HandSample(layout.solvable) if sample_frames else None
    seen = dict.fromkeys(layout.measured, False)
    for path in paths:
        for block in pose_blocks(path, layout.measured, BLOCK_FRAMES):
            relative = add_block(moments, block, layout.solvable)
            if sample is not None:
                sample.add(relative)
            for index, segment in enumerate(block.segments):
                seen[segment] |= bool(block.valid[:, index].any())
    return StreamedRecordings(tuple(paths), layout, moments, seen, sample)


def solve_recordings(
    recordings: StreamedRecordings, settings: JointSolving, hand: HandDescription
) -> dict[str, JointSolution | str]:
    """Solve every joint between two receivers; a joint without an answer has the reason instead.

    hand : for the solver `anatomical` alone.
    """
    if settings.solver == ANATOMICAL:
        solved = solutions(recordings.weigh(hand), recordings.moments)
    else:
        solved = {
            joint.name: _solve_joint(recordings, index, joint, settings)
            for index, joint in enumerate(recordings.layout.solvable)
            if is_solvable(recordings.moments, index)
        }
    return {
        joint.name: solved.get(joint.name)
        or _reason(joint, recordings.seen, int(recordings.moments.count[index]))
        for index, joint in enumerate(recordings.layout.solvable)
    }


def _solve_joint(
    recordings: StreamedRecordings, index: int, joint: Joint, settings: JointSolving
) -> JointSolution:
    solution = solve_closed(recordings.moments, index, settings.singular_values)
    if settings.solver == "stacked-svd":
        return _by_stack(solution, recordings.paths, joint, settings.singular_values)
    return solution


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
        return message_of("no-valid-pose", segments=dead)
    if n_frames < 2:
        ends = {"segment": joint.parent_receiver, "segment_2": joint.child}
        return message_of("few-frames", count=n_frames, **ends)
    return message_of("not-moved")
