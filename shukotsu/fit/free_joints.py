"""Joints without known anatomy: a wrist with a receiver on the forearm, and joints farther from the hand.

The receivers represent the bones here, since their placement on the bones is unknown. A joint's centre may be
anywhere within reach. Its axes and mean posture are first estimated from the recording.

The motion of a hinge does not determine the position of its centre along the axis. Rotation off the axis is
due to skin, which turns a receiver in place. If it were modelled as rotation of the joint, one degree of it
would seem to determine the centre to 8 mm although it is 23 mm off (simulated). So the sd along the axis is
that of the layout's plane (`measurements.planes`), or that of the reach if the layout has no plane.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.fit.normal_equations import Frames, log_rotation
from shukotsu.hand.rotations import Array, nearest_rotation
from shukotsu.study.layout import Joint, Layout

REACH_SD_MM = 200.0
"""Sd of a joint's centre about a receiver: segments of an arm are 250 to 350 mm long."""

WRIST_SD_MM = 2.0
"""Sd of the wrist's centre about the origin of the hand's frame, in which digits' bases are given."""

AXIS_SD_RAD = float(np.radians(30.0))
"""Sd of a joint's axes about the first estimate from the recording."""

ANGLE_SD_DEG = ((60.0, 4.0, 4.0), (60.0, 60.0, 5.0), (60.0, 60.0, 60.0))
"""Sd of rotation about the first, second and third axis of a joint with one, two and three degrees of
freedom. The second and third of a hinge are skin motion of the receiver on the far side."""


@dataclass(frozen=True)
class FreeJoint:
    """A joint between two receivers, passed outward from parent to child, or inward (a wrist).

    Attributes
    ----------
    joint : Joint
        The joint in the layout.
    near, far : str
        Segments of the receivers, `near` towards the root of the chains.
    mean : array, shape (3, 3)
        Mean rotation from the far receiver's frame to the near one's.
    axes : array, shape (3, 3)
        Columns are the axes in the near receiver's frame, in order of decreasing rotation about them.

    """

    joint: Joint
    near: str
    far: str
    mean: Array
    axes: Array


def free_joints(
    layout: Layout, root: str, taken: Sequence[str], frames: Frames, receivers: Sequence[str]
) -> list[FreeJoint]:
    """List the joints without known anatomy, in the order in which a chain reaches them from the root.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    root : str
        Segment from which chains start.
    taken : sequence of str
        Joints of known anatomy, which are skipped.
    frames : Frames
        Frames of the fit, from which the axes are estimated.
    receivers : sequence of str
        Receivers of those frames.

    Returns
    -------
    list of FreeJoint
        Joints that can be reached from the root.

    """
    walked: list[FreeJoint] = []
    reached, waiting = {root}, [j for j in layout.solvable if j.name not in taken]
    while True:
        step = next(
            (
                (joint, near, far)
                for joint in waiting
                for near, far in ((joint.parent_receiver, joint.child), (joint.child, joint.parent_receiver))
                if near in reached and far in receivers and far not in reached
            ),
            None,
        )
        if step is None:
            return walked
        joint, near, far = step
        waiting.remove(joint)
        reached.add(far)
        mean, axes = _start(frames, receivers.index(near), receivers.index(far))
        in_child = axes[:, 0] if near == joint.child else mean.T @ axes[:, 0]
        # as in the joint solve, the largest component of the axis is positive
        if in_child[np.argmax(np.abs(in_child))] < 0:
            axes = axes * [-1.0, 1.0, -1.0]
        walked.append(FreeJoint(joint, near, far, mean, axes))


def _start(frames: Frames, near: int, far: int) -> tuple[Array, Array]:
    """Return the far receiver's mean rotation and its main rotation axes in the near receiver's frame."""
    both = frames.valid[:, near] & frames.valid[:, far]
    if not both.any():
        return np.eye(3), np.eye(3)
    relative = np.swapaxes(frames.rotation[both, near], -1, -2) @ frames.rotation[both, far]
    mean = nearest_rotation(relative.mean(0))
    turns = log_rotation(relative @ mean.T)
    _, vectors = np.linalg.eigh(turns.T @ turns)
    first, second = vectors[:, 2], vectors[:, 1]
    return mean, np.stack([first, second, np.cross(first, second)], -1)
