"""A simulated recording's truth: bones, tips, and joints as the receivers see them.

A joint centre is stated where it was on average over the recording, in the receiver's frame as the receiver
rode on the skin; axes and the bones' directions likewise. Tracker and field have no part in that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shukotsu.schemas.layout import Layout
from shukotsu.skeleton import rotations
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.forward import flexion_axis
from shukotsu.stages.simulate.mounts import Mounts
from shukotsu.stages.simulate.random_hand import DIGITS, FLEXION, JOINTS, TIP_BONES, Hand
from shukotsu.stages.simulate.realism import Realism


@dataclass(frozen=True)
class TrueJoint:
    """A joint between two receivers: its centre and flexion axis in their frames, in the mean; NaN without a
    parent's.

    range_deg : of flexion. gap_mm : (T,) distance between the two centres in the recording.
    """

    name: str
    parent_segment: str
    child_segment: str
    dof: int
    parent_mm: Array
    child_mm: Array
    axis_parent: Array
    axis_child: Array
    range_deg: float
    gap_mm: Array


@dataclass(frozen=True)
class Truth:
    """Everything that the simulation knows.

    angles_rad : (T, J, 3). bone_position_mm (T, B, 3), bone_quaternion (T, B, 4) : in the transmitter frame.
    tip_mm, skin_tip_mm : (T, 5, 3) tips of the bones, and of the digits. along : (S, 3) where the bone of
    each receiver points, in its frame.
    """

    hand: Hand
    mounts: Mounts
    angles_rad: Array
    bone_position_mm: Array
    bone_quaternion: Array
    tip_mm: Array
    skin_tip_mm: Array
    joints: Mapping[str, TrueJoint]
    along: Array

    @classmethod
    def of(
        cls,
        layout: Layout,
        hand: Hand,
        mounts: Mounts,
        angles_rad: Array,
        bones: tuple[Array, Array],
        ridden: tuple[Array, Array],
        recorded: tuple[Array, Array],
        realism: Realism,
    ) -> Truth:
        """The truth of a recording; ridden, recorded : receivers on the skin, and as the tracker has them."""
        joints = {}
        for joint in layout.solvable:
            index = JOINTS.index(joint.name)
            centre_mm = bones[0][:, index + 1]
            axis = flexion_axis(hand, index, angles_rad, bones[1])
            child = mounts.segments.index(joint.child)
            child_mm, axis_child = _in_receiver(ridden, child, centre_mm, axis)
            parent_mm, axis_parent, gap_mm = (
                np.full(3, np.nan),
                np.full(3, np.nan),
                np.full(len(axis), np.nan),
            )
            worn = joint.parent_receiver in mounts.segments
            if worn:
                parent = mounts.segments.index(joint.parent_receiver)
                parent_mm, axis_parent = _in_receiver(ridden, parent, centre_mm, axis)
                apart = _to_transmitter(recorded, parent, parent_mm) - _to_transmitter(
                    recorded, child, child_mm
                )
                gap_mm = np.linalg.norm(apart, axis=-1)
            joints[joint.name] = TrueJoint(
                joint.name,
                joint.parent_receiver if worn else "",
                joint.child,
                1 if realism.hinges_only else joint.dof,
                parent_mm,
                child_mm,
                axis_parent,
                axis_child,
                float(np.degrees(np.ptp(angles_rad[:, index, FLEXION]))),
                gap_mm,
            )
        tip_mm = _ends_mm(hand.length_mm[TIP_BONES], *bones)
        skin_tip_mm = _ends_mm(hand.length_mm[TIP_BONES] + hand.soft_tip_mm, *bones)
        pointing = rotations.rotate(bones[1][:, mounts.bone], np.array([1.0, 0.0, 0.0]))
        along = rotations.unit(rotations.rotate(rotations.conjugate(ridden[1]), pointing).mean(0))
        return cls(hand, mounts, angles_rad, *bones, tip_mm, skin_tip_mm, joints, along)


def _ends_mm(length_mm: Array, bone_position_mm: Array, bone_quaternion: Array) -> Array:
    """Points (T, 5, 3) in the transmitter frame, so far (5,) along the last bones from their joints."""
    along = np.zeros((len(DIGITS), 3))
    along[:, 0] = length_mm
    return bone_position_mm[:, TIP_BONES] + rotations.rotate(bone_quaternion[:, TIP_BONES], along)


def _in_receiver(
    poses: tuple[Array, Array], receiver: int, point_mm: Array, axis: Array
) -> tuple[Array, Array]:
    """Mean over the frames of points and axes (T, 3) seen from a receiver."""
    back = rotations.conjugate(poses[1][:, receiver])
    place = rotations.rotate(back, point_mm - poses[0][:, receiver]).mean(0)
    return place, rotations.unit(rotations.rotate(back, axis).mean(0))


def _to_transmitter(poses: tuple[Array, Array], receiver: int, point_mm: Array) -> Array:
    return np.asarray(poses[0][:, receiver] + rotations.rotate(poses[1][:, receiver], point_mm))
