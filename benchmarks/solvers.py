"""Joint solvers of the stage solve_joints on arrays of poses: the closed form."""

from __future__ import annotations

from collections.abc import Sequence

from shukotsu.schemas.layout import Joint, Layout
from shukotsu.schemas.poses import Poses
from shukotsu.stages.solve_joints.closed import JointSolution, solve_closed
from shukotsu.stages.solve_joints.moments import BLOCK_FRAMES, JointMoments
from shukotsu.stages.solve_joints.solve import add_block


def solved_joints(layout: Layout, poses: Poses) -> list[Joint]:
    """Joints between two receivers that were worn."""
    worn = set(poses.segments)
    return [joint for joint in layout.solvable if {joint.parent_receiver, joint.child} <= worn]


def moments(poses: Poses, joints: Sequence[Joint]) -> JointMoments:
    """The pass over the data, all joints at once, in blocks of frames as the stage does."""
    total = JointMoments(len(joints))
    for start in range(0, len(poses.frame), BLOCK_FRAMES):
        add_block(total, poses.take(slice(start, start + BLOCK_FRAMES)), joints)
    return total


def closed(poses: Poses, joints: Sequence[Joint], n_singular_values: int) -> list[JointSolution]:
    """Every joint by the closed form."""
    total = moments(poses, joints)
    return [solve_closed(total, index, n_singular_values) for index in range(len(joints))]
