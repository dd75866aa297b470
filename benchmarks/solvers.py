"""Joint solvers of the stage solve_joints on arrays of poses: the closed form and the stack of all frames."""

from __future__ import annotations

from collections.abc import Sequence

from schemas.layout import Joint, Layout
from schemas.poses import Poses
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.moments import BLOCK_FRAMES, JointMoments
from stages.solve_joints.solve import add_block
from stages.solve_joints.stacked import StackedSolution, solve_stacked


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


def stacked(poses: Poses, joints: Sequence[Joint], n_singular_values: int) -> list[StackedSolution]:
    """Every joint by its own stack of all frames."""
    solutions = []
    for joint in joints:
        a, b = poses.index(joint.parent_receiver), poses.index(joint.child)
        q, t_mm = poses.quaternion, poses.position_mm
        solutions.append(solve_stacked(q[:, a], t_mm[:, a], q[:, b], t_mm[:, b], n_singular_values))
    return solutions
