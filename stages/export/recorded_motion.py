"""A recording's skeleton and motion from a subject's tables, whatever the skeleton model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from anatomy.neutral_bones import neutral_rotations, to_nail_side
from schemas.errors import InputError
from schemas.files import file_sha256
from schemas.layout import Layout
from schemas.plan import SubjectPlan
from schemas.poses import Poses, frame_count, pose_blocks
from schemas.study import Recording
from skeleton.posed_recording import posed_bones
from skeleton.posing import PosedBones, axes_turned_about
from skeleton.rotations import Array, conjugate, mean_rotation, multiply, rotate
from stages.export.long_arrays import chosen_points, empty
from stages.export.motion import (
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

BLOCK_FRAMES = 1 << 16
"""Frames that are posed at a time."""


def read_motion(
    plan: SubjectPlan, recording: Recording, model_name: str, licence: str = ""
) -> SkeletonMotion:
    """Read one hand's skeleton under one model and its motion in one recording.

    licence : the terms of use, to go into every file. Digits whose joints failed, or that have no pose in any
    frame, are left out, and a note says so. Raises InputError where a table is absent or its making failed,
    where no digit is left, or where the layout's digits do not hang together.
    """
    layout = plan.layouts[recording.hand.hand]
    poses = _read_poses(plan.poses(recording), layout)
    bones = _posed_bones(plan, recording, model_name, poses)
    where = f"{plan.folder}: {recording.hand.hand} hand, model {model_name}"
    if bones.root_failure:
        raise InputError(f"{where}: {bones.root_failure}, and it is the skeleton's root")
    _check_tree(bones, layout)
    _check_lengths(bones, where)
    bones, unseen = _seen_digits(_without_unknown_skin(bones))
    left_out = {**bones.left_out, **unseen}
    notes = tuple(f"{digit} left out: {reason}" for digit, reason in left_out.items())
    if len(bones.joints) < 2:
        reasons = "; ".join(notes) or "the layout has none"
        raise InputError(f"{where}: no digit of {recording.name} can be exported: {reasons}")
    return motion_of(bones, poses, layout, _origin(plan, recording, model_name, licence), notes)


def _read_poses(path: Path, layout: Layout) -> Poses:
    """A recording's poses, whole; what is large of them is on the disk."""
    count, segments = frame_count(path), layout.measured
    position, turn = empty(count, len(segments), 3), empty(count, len(segments), 4)
    frame, time_s, valid = np.empty(count, np.int64), np.empty(count), np.empty((count, len(segments)), bool)
    start = 0
    for block in pose_blocks(path, segments, BLOCK_FRAMES):
        rows = slice(start, start + len(block.frame))
        frame[rows], time_s[rows], valid[rows] = block.frame, block.time_s, block.valid
        position[rows], turn[rows] = block.position_mm, block.quaternion
        start = rows.stop
    return Poses(segments, frame, time_s, position, turn, valid)


def _posed_bones(plan: SubjectPlan, recording: Recording, model_name: str, poses: Poses) -> PosedBones:
    """Poses of all bones over the recording, made a block of frames at a time."""
    count = len(poses.frame)
    position = turn = np.empty((0, 0, 0))
    for start in range(0, max(count, 1), BLOCK_FRAMES):
        rows = slice(start, start + BLOCK_FRAMES)
        bones = posed_bones(plan, recording, model_name, poses.take(rows))
        if not start:
            position, turn = (empty(count, len(bones.joints), width) for width in (3, 4))
        position[rows], turn[rows] = bones.position_mm, bones.quaternion
    bones = replace(bones, position_mm=position, quaternion=turn)
    if plan.models[model_name].fitting is not None:
        return replace(bones, axis=axes_turned_about(bones))
    joints = (replace(j, name=f"{j.digit}{RECEIVER_TIP}") if j.tip else j for j in bones.joints)
    return replace(bones, joints=tuple(joints))


def motion_of(
    bones: PosedBones, poses: Poses, layout: Layout, origin: Origin, notes: tuple[str, ...] = ()
) -> SkeletonMotion:
    """The motion of bones that were posed in a recording, in WebXR frames, a thumb's facing its nail.

    bones : one tree, every digit with a pose in some frame. Numbers of bones and poses are written over.
    """
    joints, quaternion, axis = bones.joints, bones.quaternion, bones.axis.copy()
    for index, change in to_nail_side(layout, origin.hand, joints, quaternion).items():
        quaternion[:, index] = multiply(quaternion[:, index], change)
        axis[index] = rotate(conjugate(change), axis[index])
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
    return _only(
        bones,
        [
            index
            for index, joint in enumerate(bones.joints)
            if not joint.name.endswith(SKIN_TIP) or np.isfinite(bones.position_mm[:, index]).any()
        ],
    )


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
    return _only(bones, kept), unseen


def _only(bones: PosedBones, kept: list[int]) -> PosedBones:
    """Some of the joints, and with each its parent."""
    if len(kept) == len(bones.joints):
        return bones
    place = {-1: -1} | {old: new for new, old in enumerate(kept)}
    return replace(
        bones,
        joints=tuple(
            replace(bones.joints[index], parent=place[bones.joints[index].parent]) for index in kept
        ),
        position_mm=chosen_points(bones.position_mm, kept),
        quaternion=chosen_points(bones.quaternion, kept),
        rest_offset_mm=bones.rest_offset_mm[kept],
        axis=bones.axis[kept],
    )


def _rest(bones: PosedBones) -> tuple[Array, Array]:
    """Rest offsets (J, 3) and rotations (J, 4) in our bone frames; of digits' first bones as on average."""
    offset = bones.rest_offset_mm.copy()
    rest = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(offset), 1))
    for index, joint in enumerate(bones.joints):
        if joint.parent < 0 or not np.isnan(offset[index]).all():
            continue
        back = conjugate(bones.quaternion[:, joint.parent])
        seen = rotate(back, bones.position_mm[:, index] - bones.position_mm[:, joint.parent])
        seen = seen[np.isfinite(seen).all(-1)]
        offset[index] = seen.mean(0) if len(seen) else 0.0
        relative = multiply(back, bones.quaternion[:, index])
        rest[index] = mean_rotation(relative[np.isfinite(relative).all(-1)])
    return offset, rest


def _receivers(poses: Poses) -> Receivers:
    position, turn = poses.position_mm, poses.quaternion
    for index in range(len(poses.segments)):
        valid = poses.valid[:, index, None]
        position[:, index] = np.where(valid, position[:, index], np.nan)
        turn[:, index] = continuous_series(np.where(valid, turn[:, index], np.nan))
    return Receivers(poses.segments, position, turn, poses.valid)


def _origin(plan: SubjectPlan, recording: Recording, model_name: str, licence: str) -> Origin:
    hand = recording.hand.hand
    files = [plan.table("joint_centres"), plan.table("bone_lengths")]
    if plan.models[model_name].fitting is None:
        files.append(plan.table("metacarpals"))
    else:
        files += [plan.fit_table(hand, model_name, name) for name in ("bone_poses", "posed_tips")]
    inputs = {
        file.relative_to(plan.folder.parent).as_posix(): file_sha256(file)
        for file in [plan.poses(recording), *files]
        if file.is_file()
    }
    return Origin(
        plan.subject,
        hand,
        recording.task,
        recording.trial,
        model_name,
        plan.layouts[hand].name,
        inputs,
        licence,
        plan.session,
    )
