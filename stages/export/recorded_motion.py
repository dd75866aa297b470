"""A recording's skeleton and motion from a subject's tables, whatever the skeleton model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.anatomy.neutral_bones import neutral_rotations, to_nail_side, zeros_facing
from shukotsu.errors import InputError
from shukotsu.files.long_arrays import chosen_points, empty
from shukotsu.files.whole_files import file_sha256
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.posed_recording import PosedRecording
from shukotsu.skeleton.posing import PosedBones, axes_turned_about
from shukotsu.skeleton.rotations import Array, conjugate, multiply, rotate
from shukotsu.stages.export.motion import (
    BONE_TO_WEBXR,
    RECEIVER_TIP,
    SKIN_TIP,
    Origin,
    Receivers,
    SkeletonMotion,
    continuous_series,
    known_points,
    nominal_rate_hz,
)


def read_motion(posed: PosedRecording, licence: str = "") -> SkeletonMotion:
    """Read one hand's skeleton under one model and its motion in one recording.

    licence : the terms of use, to go into every file. Digits whose joints failed, or that have no pose in any
    frame, are left out, and a note says so. Raises InputError where a table is absent or its making failed,
    where no digit is left, or where the layout's digits do not hang together.
    """
    poses, bones = _posed(posed)
    where = f"{posed.tables.joint_centres.parent}: {posed.part.hand} hand, model {posed.model.name}"
    if bones.root_failure:
        raise InputError(f"{where}: {bones.root_failure}, and it is the skeleton's root")
    _check_tree(bones, posed.layout)
    _check_lengths(bones, where)
    bones, unseen = _seen_digits(_without_unknown_skin(bones))
    left_out = {**bones.left_out, **unseen}
    notes = tuple(f"{digit} left out: {reason}" for digit, reason in left_out.items())
    if len(bones.joints) < 2:
        reasons = "; ".join(notes) or "the layout has none"
        raise InputError(f"{where}: no digit of {posed.recording.name} can be exported: {reasons}")
    return motion_of(bones, poses, posed.layout, _origin(posed, licence), notes)


def _posed(posed: PosedRecording) -> tuple[Poses, PosedBones]:
    """Receivers and bones over the recording, read in blocks; what is large of them is on the disk."""
    count, segments = posed.n_frames, posed.layout.measured
    frame, time_s, valid = np.empty(count, np.int64), np.empty(count), np.empty((count, len(segments)), bool)
    receivers = [empty(count, len(segments), width) for width in (3, 4)]
    start, placed = 0, receivers
    for block, bones in posed.blocks():
        rows = slice(start, start + len(block.frame))
        if not start:
            placed = [empty(count, len(bones.joints), width) for width in (3, 4)]
        frame[rows], time_s[rows], valid[rows] = block.frame, block.time_s, block.valid
        receivers[0][rows], receivers[1][rows] = block.position_mm, block.quaternion
        placed[0][rows], placed[1][rows] = bones.position_mm, bones.quaternion
        start = rows.stop
    bones = replace(bones, position_mm=placed[0], quaternion=placed[1])
    poses = Poses(segments, frame, time_s, receivers[0], receivers[1], valid)
    if posed.is_fitted:
        return poses, replace(bones, axis=axes_turned_about(bones))
    joints = (replace(j, name=f"{j.digit}{RECEIVER_TIP}") if j.tip else j for j in bones.joints)
    return poses, replace(bones, joints=tuple(joints))


def motion_of(
    bones: PosedBones, poses: Poses, layout: Layout, origin: Origin, notes: tuple[str, ...] = ()
) -> SkeletonMotion:
    """The motion of bones that were posed in a recording, in WebXR frames, a thumb's facing its nail.

    bones : one tree, every digit with a pose in some frame. Numbers of bones and poses are written over.
    """
    joints, quaternion, axis = bones.joints, bones.quaternion, bones.axis.copy()
    facing = to_nail_side(layout, origin.hand, joints, quaternion)
    for index, change in facing.items():
        quaternion[:, index] = multiply(quaternion[:, index], change)
        axis[index] = rotate(conjugate(change), axis[index])
    joints = zeros_facing(joints, facing, origin.hand)
    offset, rest = _rest(bones)
    for index in range(len(joints)):
        quaternion[:, index] = continuous_series(multiply(quaternion[:, index], BONE_TO_WEBXR))
    back = conjugate(BONE_TO_WEBXR)
    neutral = neutral_rotations(layout, origin.hand, joints)
    return SkeletonMotion(
        joints,
        rotate(back, offset),
        multiply(back, multiply(rest, BONE_TO_WEBXR)),
        multiply(back, multiply(neutral, BONE_TO_WEBXR)),
        rotate(back, axis),
        poses.frame,
        poses.time_s,
        nominal_rate_hz(poses.frame, poses.time_s),
        bones.position_mm,
        quaternion,
        _receivers(poses),
        origin,
        notes,
    )


def _check_tree(bones: PosedBones, layout: Layout) -> None:
    for joint in bones.joints[1:]:
        if joint.parent < 0:
            raise InputError(
                f"digit {joint.digit} hangs from {layout.digits[joint.digit].base}, which is no bone of the "
                "skeleton; an export needs one tree, so give each part a layout of its own"
            )


def _check_lengths(bones: PosedBones, where: str) -> None:
    """Refuse a bone without a length; of those before a digit's first joint the motion tells."""
    for joint, offset in zip(bones.joints, bones.rest_offset_mm, strict=True):
        known = joint.parent <= 0 or np.isnan(offset).all()
        if not known and not offset[0] > 0:
            raise InputError(
                f"{where}: bone {bones.joints[joint.parent].segment} is {offset[0]} mm long in bone_lengths; "
                "expected a length above 0, so look at its joints' status"
            )


def _without_unknown_skin(bones: PosedBones) -> PosedBones:
    """The bones without ends of skin that are known in no frame: those of digits without known anatomy."""
    kept = [
        index
        for index, joint in enumerate(bones.joints)
        if not joint.name.endswith(SKIN_TIP) or np.isfinite(bones.position_mm[:, index]).any()
    ]
    return bones if len(kept) == len(bones.joints) else bones.only(kept, chosen_points)


def _seen_digits(bones: PosedBones) -> tuple[PosedBones, dict[str, str]]:
    """The bones without the digits of which a joint has no pose in any frame, and the reasons.

    What hangs from such a digit goes with it.
    """
    known = known_points(bones.position_mm, bones.quaternion)
    unseen: dict[str, str] = {}
    for index, joint in enumerate(bones.joints[1:], 1):
        lost = bones.joints[joint.parent].digit in unseen
        if len(known) and (lost or not known[:, index].any()):
            unseen.setdefault(joint.digit, f"{joint.name} has no pose in any frame")
    if not unseen:
        return bones, unseen
    kept = [index for index, joint in enumerate(bones.joints) if joint.digit not in unseen]
    return bones.only(kept, chosen_points), unseen


def _rest(bones: PosedBones) -> tuple[Array, Array]:
    """Rest offsets (J, 3) and rotations (J, 4) in our bone frames; of digits' first bones as on average."""
    first = np.asarray(np.isnan(bones.rest_offset_mm).all(-1))
    offset, rest = bones.constant_part()
    rest[~first] = (1.0, 0.0, 0.0, 0.0)
    return np.where(first[:, None], np.nan_to_num(offset), bones.rest_offset_mm), rest


def _receivers(poses: Poses) -> Receivers:
    position, turn = poses.position_mm, poses.quaternion
    for index in range(len(poses.segments)):
        valid = poses.valid[:, index, None]
        position[:, index] = np.where(valid, position[:, index], np.nan)
        turn[:, index] = continuous_series(np.where(valid, turn[:, index], np.nan))
    return Receivers(poses.segments, position, turn, poses.valid)


def _origin(posed: PosedRecording, licence: str) -> Origin:
    recording, tables = posed.recording, posed.tables
    of_model = (tables.bone_poses, tables.posed_tips) if posed.is_fitted else (tables.metacarpals,)
    inputs = {
        file.relative_to(tables.joint_centres.parent.parent).as_posix(): file_sha256(file)
        for file in (posed.poses_file, tables.joint_centres, tables.bone_lengths, *of_model)
        if file.is_file()
    }
    return Origin(
        posed.part.subject,
        posed.part.hand,
        recording.task,
        recording.trial,
        posed.model.name,
        posed.layout.name,
        inputs,
        licence,
        posed.part.session,
    )
