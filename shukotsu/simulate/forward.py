"""Forward kinematics of the simulated hand: poses of all bones from joint angles, for all frames at once."""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Array
from shukotsu.hand import rotations
from shukotsu.simulate import random_hand
from shukotsu.simulate.random_hand import ABDUCTION, AXIAL, BONES, FLEXION, JOINTS, PARENT, RandomHand
from shukotsu.simulate.realism import Realism

PoseArrays = tuple[Array, Array]
"""Positions (T, N, 3), mm, and quaternions (T, N, 4) of N bones or receivers in the transmitter frame."""


def coupled_angles(voluntary_rad: Array, hand: RandomHand, realism: Realism) -> Array:
    """Compute joint angles from voluntary flexion and abduction and the hand's couplings.

    Parameters
    ----------
    voluntary_rad : array, shape (T, J, 3)
        Voluntary flexion and abduction; the third column is not used.
    hand : RandomHand
        The hand.
    realism : Realism
        Which motions are locked.

    Returns
    -------
    array, shape (T, J, 3)
        Flexion, abduction and axial rotation, rad; locked motions are 0.

    """
    flexion, abduction = voluntary_rad[..., FLEXION], voluntary_rad[..., ABDUCTION]
    bent = 1.0 - np.cos(flexion)
    per_abduction, per_flexion, wobble_abduction, wobble_axial = hand.coupling.T
    axial = per_abduction * abduction + per_flexion * flexion + wobble_axial * bent
    angles = np.stack([flexion, abduction + wobble_abduction * bent, axial], -1)
    angles[:, random_hand.FINGER_CMC, ABDUCTION] = 0.0
    if realism.paper_joints:
        angles[..., ABDUCTION:] = 0.0
        angles[:, random_hand.FINGER_CMC] = 0.0
    return angles


def relaxed_angles(hand: RandomHand, realism: Realism) -> Array:
    """Return the joint angles (J, 3) of the relaxed hand: flexion, abduction and axial rotation, rad."""
    voluntary = np.zeros((1, len(JOINTS), 3))
    voluntary[0, :, FLEXION] = hand.relaxed_rad
    return np.asarray(coupled_angles(voluntary, hand, realism)[0])


def bone_poses(
    hand: RandomHand, angles_rad: Array, root_position_mm: Array, root_quaternion: Array
) -> PoseArrays:
    """Compute the poses of all bones.

    Parameters
    ----------
    hand : RandomHand
        The hand.
    angles_rad : array, shape (T, J, 3)
        Flexion, abduction and axial rotation.
    root_position_mm : array, shape (T, 3)
        Wrist centre in the transmitter frame, mm.
    root_quaternion : array, shape (T, 4)
        Unit quaternions (w, x, y, z), forearm to transmitter frame.

    Returns
    -------
    position_mm : array, shape (T, B, 3)
        Origins of the bones in the transmitter frame, mm.
    quaternion : array, shape (T, B, 4)
        Unit quaternions (w, x, y, z), bone to transmitter frame.

    """
    n_frames = len(angles_rad)
    position = np.empty((n_frames, len(BONES), 3))
    quaternion = np.empty((n_frames, len(BONES), 4))
    position[:, 0], quaternion[:, 0] = root_position_mm, root_quaternion
    for level in random_hand.LEVELS:
        parents, bones = PARENT[level], slice(level.start + 1, level.stop + 1)
        axes, angles, skew = hand.axes[level], angles_rad[:, level], hand.skew_mm[level]
        joints, (first, second) = np.arange(len(parents)), hand.order[level].T
        carrying = rotations.about_axis(axes[joints, first], angles[:, joints, first])
        carried = rotations.about_axis(axes[joints, second], angles[:, joints, second])
        turned = rotations.multiply(carrying, carried)
        turned = rotations.multiply(turned, rotations.about_axis(axes[:, AXIAL], angles[..., AXIAL]))
        bent = (angles[..., FLEXION] - hand.relaxed_rad[level])[..., None]
        glide = hand.glide_mm[level]
        origin = hand.origin_mm[level] + ((1.0 - np.cos(bent)) * glide[:, 0] + np.sin(bent) * glide[:, 1])
        if skew.any():  # the two axes pass the centre at half the skew on either side
            origin = origin - skew / 2 + rotations.rotate(carrying, skew) - rotations.rotate(turned, skew / 2)
        above = quaternion[:, parents]
        position[:, bones] = position[:, parents] + rotations.rotate(above, origin)
        quaternion[:, bones] = rotations.multiply(rotations.multiply(above, turned), hand.rest[level])
    return position, quaternion


def poses_in_hand(hand: RandomHand, angles_rad: Array) -> PoseArrays:
    """Compute the poses of all bones in the hand's frame, with the wrist fixed.

    Parameters
    ----------
    hand : RandomHand
        The hand.
    angles_rad : array, shape (T, A)
        Joint angles.

    Returns
    -------
    tuple of array
        Positions, mm, and rotations, with shapes as in `bone_poses`.

    """
    n_frames = len(angles_rad)
    still = angles_rad.copy()
    still[:, random_hand.WRIST] = 0.0
    return bone_poses(hand, still, np.zeros((n_frames, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (n_frames, 1)))


def flexion_axis(hand: RandomHand, joint: int, angles_rad: Array, bone_quaternion: Array) -> Array:
    """Compute a joint's flexion axis in the transmitter frame, which abduction carries if it comes first.

    Parameters
    ----------
    hand : RandomHand
        The hand.
    joint : int
        Index in JOINTS.
    angles_rad : array, shape (T, J, 3)
        Flexion, abduction and axial rotation.
    bone_quaternion : array, shape (T, B, 4)
        Bones, bone to transmitter frame.

    Returns
    -------
    array, shape (T, 3)
        Unit vectors.

    """
    axis = hand.axes[joint, FLEXION]
    if hand.order[joint, 0] == ABDUCTION:
        abducted = rotations.about_axis(hand.axes[joint, ABDUCTION], angles_rad[:, joint, ABDUCTION])
        axis = rotations.rotate(abducted, axis)
    return np.asarray(rotations.rotate(bone_quaternion[:, PARENT[joint]], axis))
