"""Joints of which no anatomy is known: a wrist's with a receiver on the forearm, and what a layout has above.

The receivers are the bones here, since nothing says how they sit on them. A joint's centre may be anywhere
within reach; what axes it turns about, and its mean posture, are read off the recording beforehand.

Where on its axis a hinge has its centre, its motion does not say. What turns off the axis is skin, which
turns a receiver where it sits; were it a turn of the joint, a degree of skin would seem to fix the centre to
8 mm, which is 23 mm off (simulated). So the sd along the axis is that of the layout's plane
(`measurements.planes`), or of the reach where it gives none.

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
"""Sd of a joint's axes about those that the recording shows at first sight."""

ANGLE_SD_DEG = ((60.0, 4.0, 4.0), (60.0, 60.0, 5.0), (60.0, 60.0, 60.0))
"""Sd of rotation about the first, second, third axis of a joint with one, two, three degrees of freedom. The
second and third of a hinge are skin's, about the receiver on the far side."""


@dataclass(frozen=True)
class FreeJoint:
    """A joint walked between receivers, outward as in the layout, or (a wrist) inward.

    mean : (3, 3) rotation from the far receiver's frame to the near one's; axes : (3, 3) columns in the near
    one, about which most, less, least was turned.
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
        Joints that anatomy covers.
    frames : Frames
        Frames of the fit, by which their axes are guessed.
    receivers : sequence of str
        Receivers of those frames.

    Returns
    -------
    list of FreeJoint
        Joints that can be reached.

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
        if (
            in_child[np.argmax(np.abs(in_child))] < 0
        ):  # as in the joint solve: its largest component counts up
            axes = axes * [-1.0, 1.0, -1.0]
        walked.append(FreeJoint(joint, near, far, mean, axes))


def _start(frames: Frames, near: int, far: int) -> tuple[Array, Array]:
    """Mean rotation and main axes of the far receiver's turning in the near one's frame."""
    both = frames.valid[:, near] & frames.valid[:, far]
    if not both.any():
        return np.eye(3), np.eye(3)
    relative = np.swapaxes(frames.rotation[both, near], -1, -2) @ frames.rotation[both, far]
    mean = nearest_rotation(relative.mean(0))
    turns = log_rotation(relative @ mean.T)
    _, vectors = np.linalg.eigh(turns.T @ turns)
    first, second = vectors[:, 2], vectors[:, 1]
    return mean, np.stack([first, second, np.cross(first, second)], -1)
