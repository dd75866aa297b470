"""Neutral poses of bones: which way a thumb's metacarpal faces, and the zero of joint angles.

The dorsal direction of a thumb's metacarpal can be defined in two ways, some 100 deg apart about its long
axis. In our tables it is that of the receiver on it. A rig driven by these frames needs a single definition,
which is the nail's side, as for the phalanges.

A thumb's phalanges are unambiguous: y is their axis of flexion, z points to the nail's side. If the
metacarpal faces the nail's side, y is nearest the MCP joint's axis of flexion. If it faces the back of the
hand, y is nearest the axis that musculoskeletal models (MyoHand) call the CMC joint's flexion, although about
it the thumb leaves the palm. A receiver is placed where the thumb has room for it, so the data determine
which way it faces. The MCP joint flexes and deviates but hardly turns about the long axis, so that the twist
between the two receivers shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shukotsu.hand.average_hand import DIGITS
from shukotsu.hand.joint_angles import joint_angles, joint_rotation, mirror_rotations
from shukotsu.hand.known_digits import known_digits, rest_rotations
from shukotsu.hand.posing import PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import Array, conjugate, from_matrix, matrix, mean_rotation, multiply, rotate
from shukotsu.study.layout import Layout


def to_nail_side(
    layout: Layout, hand: str, joints: Sequence[SkeletonJoint], quaternion: Array
) -> dict[int, Array]:
    """Find the rotation to its nail's side of a thumb's metacarpal that faces the back of the hand.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    hand : str
        right or left.
    joints : sequence of SkeletonJoint, length B
        The bones.
    quaternion : array, shape (T, B, 4)
        Bone to transmitter frame, NaN in gaps.

    Returns
    -------
    dict
        Index of the metacarpal -> quaternion (4,) in its bone frame; empty if it faces the nail's side.

    """
    places = {(joint.digit, joint.segment): i for i, joint in enumerate(joints) if not joint.tip}
    thumbs = [d for d in known_digits(layout) if d.name == "thumb" and ("thumb", d.segments[0]) in places]
    if not thumbs:
        return {}
    metacarpal, proximal = (places["thumb", segment] for segment in thumbs[0].segments[:2])
    relative = multiply(conjugate(quaternion[:, metacarpal]), quaternion[:, proximal])
    relative = relative[np.isfinite(relative).all(-1)]
    frames = [replace(DIGITS["thumb"], faces_nail=nail).frames() for nail in (True, False)]
    rests = [_of_hand(from_matrix(bones[0].T @ bones[1]), hand) for bones in frames]
    if not len(relative) or faces_nail(matrix(relative), *(matrix(rest) for rest in rests)):
        return {}
    return {metacarpal: _of_hand(from_matrix(frames[1][0].T @ frames[0][0]), hand)}


def bone_angles_deg(
    layout: Layout, hand: str, bones: PosedRecording, facing: Mapping[int, Array]
) -> dict[str, Array]:
    """Compute the angles of joints of known anatomy (docs/movement.md).

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    hand : str
        right or left.
    bones : PosedRecording
        The hand over T frames.
    facing : mapping
        Rotation of the thumb's metacarpal, as returned by `to_nail_side`.

    Returns
    -------
    dict
        Joint -> flexion, deviation and axial rotation (T, 3), deg; NaN in gaps.

    """
    rests, quaternion = neutral_rotations(layout, hand, bones.joints), bones.quaternion.copy()
    for index, change in facing.items():
        quaternion[:, index] = multiply(quaternion[:, index], change)
    return {
        joint.name: joint_angles(quaternion[:, joint.parent], quaternion[:, index], hand, rests[index])
        for index, joint in enumerate(bones.joints)
        if not joint.tip and joint.parent >= 0 and np.isfinite(rests[index]).all()
    }


def at_rest(layout: Layout, bones: PosedRecording) -> PosedRecording:
    """Add offsets, rest and neutral rotations to a posed hand, its thumb's metacarpal facing the nail's side.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    bones : PosedRecording
        The hand over T frames.

    Returns
    -------
    PosedRecording
        The hand. Rest rotations are means over time, and so are offsets that bone lengths do not determine
        (NaN without a frame). The root has zero offset and no rotation.

    """
    hand, quaternion, axis = bones.hand, bones.quaternion.copy(), bones.axis.copy()
    facing = to_nail_side(layout, hand, bones.joints, quaternion)
    for index, change in facing.items():
        quaternion[:, index] = multiply(quaternion[:, index], change)
        axis[index] = rotate(conjugate(change), axis[index])
    offset_mm = bones.rest_offset_mm.copy()
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (len(bones.joints), 1))
    for index, joint in enumerate(bones.joints):
        if joint.parent < 0:
            continue
        back = conjugate(quaternion[:, joint.parent])
        turn = multiply(back, quaternion[:, index])
        rest[index] = mean_rotation(turn[np.isfinite(turn).all(-1)])
        if np.isnan(offset_mm[index]).any():
            moved_mm = rotate(back, bones.position_mm[:, index] - bones.position_mm[:, joint.parent])
            moved_mm = moved_mm[np.isfinite(moved_mm).all(-1)]
            offset_mm[index] = moved_mm.mean(0) if len(moved_mm) else np.nan
    joints = zeros_facing(bones.joints, facing, hand)
    neutral = neutral_rotations(layout, hand, joints)
    return replace(
        bones,
        joints=joints,
        quaternion=quaternion,
        rest_offset_mm=offset_mm,
        axis=axis,
        rest=rest,
        neutral=neutral,
    )


def zeros_facing(
    joints: Sequence[SkeletonJoint], facing: Mapping[int, Array], hand: str
) -> tuple[SkeletonJoint, ...]:
    """Express the zeros of joints' angles in rotated bone frames.

    Parameters
    ----------
    joints : sequence of SkeletonJoint
        Joints with their zeros.
    facing : mapping of int to array, shape (4,)
        Rotation of a bone's frame by the joint's index, as `to_nail_side` returns it.
    hand : str
        right or left.

    Returns
    -------
    tuple of SkeletonJoint
        The same joints with their new zeros, deg.

    """
    still, turned = np.array([1.0, 0.0, 0.0, 0.0]), list(joints)
    for index, joint in enumerate(joints):
        if joint.zero_deg and {index, joint.parent} & facing.keys():
            above, below = (conjugate(facing.get(i, still)) for i in (joint.parent, index))
            rest = multiply(multiply(above, neutral_rotation(joint, hand)), conjugate(below))
            axes_deg = joint_angles(still, multiply(below, angle_axes(joint, hand)), hand)[2]
            zero_deg = *joint_angles(still, rest, hand).tolist(), float(axes_deg)
            turned[index] = replace(joint, zero_deg=zero_deg)
    return tuple(turned)


def neutral_rotation(joint: SkeletonJoint, hand: str) -> Array:
    """Return the rotation (4,) of a fitted joint's bone relative to its parent at zero angles."""
    return joint_rotation(np.array(joint.zero_deg[:3]), hand)


def angle_axes(joint: SkeletonJoint, hand: str) -> Array:
    """Return the rotation (4,) from the axes of a joint's angles to the bone's frame; identity by default."""
    return joint_rotation(np.array([0.0, 0.0, *(joint.zero_deg[3:] or (0.0,))]), hand)


def neutral_rotations(layout: Layout, hand: str, joints: Sequence[SkeletonJoint]) -> Array:
    """Return rotations (J, 4) of bones relative to their parents at zero joint angles (`docs/movement.md`).

    They are those of the fitted hand, otherwise those of the average hand, with the thumb's metacarpal facing
    its nail's side. They are NaN for the root, tips, unknown digits and joints without a degree of freedom.
    """
    nails = {name: replace(digit, faces_nail=digit.second_axis is not None) for name, digit in DIGITS.items()}
    rests = rest_rotations(layout, hand, nails)
    moving = {name: rest for name, rest in rests.items() if layout.joints[name].dof}
    moving |= {joint.name: neutral_rotation(joint, hand) for joint in joints if joint.zero_deg}
    return np.stack([moving.get(joint.name, np.full(4, np.nan)) for joint in joints])


def _of_hand(quaternion: Array, hand: str) -> Array:
    """Convert a right hand's rotation between bone frames to that of the hand."""
    return mirror_rotations(quaternion) if hand == "left" else quaternion


def faces_nail(relative: Array, at_nail: Array, at_hand: Array) -> bool:
    """Return whether a thumb's metacarpal faces the nail's side in most frames.

    All three rotations must be of the same hand, as twists of right and left hands are mirrored. Frames have
    x distal and z dorsal.

    Parameters
    ----------
    relative : array, shape (T, 3, 3)
        Rotation from the proximal phalanx's receiver to the metacarpal's, in frames in which both are valid.
    at_nail, at_hand : array, shape (3, 3)
        The same for a straight average thumb whose metacarpal faces the nail's side or the back of the hand.

    Returns
    -------
    bool
        Whether it faces the nail's side; False if T is 0.

    """
    twist = _twist_rad(relative)
    off_nail, off_hand = (
        np.abs(np.angle(np.exp(1j * (twist - _twist_rad(facing))))) for facing in (at_nail, at_hand)
    )
    return bool((off_nail < off_hand).sum() > len(twist) / 2)


def _twist_rad(rotation: Array) -> Array:
    """Return the twist (...), rad, about x of rotations (..., 3, 3) decomposed into swing and twist."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    return np.asarray(2 * np.arctan2(rotation[..., 2, 1] - rotation[..., 1, 2], 1 + trace))
