"""A recording's skeleton and motion from a subject's tables, whatever the skeleton model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.anatomy.neutral_bones import neutral_rotations, to_nail_side, zeros_facing
from shukotsu.errors import InputError
from shukotsu.files.whole_files import file_sha256
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import Poses, joined_poses
from shukotsu.skeleton.posed_recording import PosedRecording
from shukotsu.skeleton.posing import PosedBones
from shukotsu.skeleton.rotations import conjugate, multiply, rotate
from shukotsu.stages.export.motion import (
    BONE_TO_WEBXR,
    RECEIVER_TIP,
    SKIN_TIP,
    Origin,
    Receivers,
    SkeletonMotion,
    Whole,
    continuous,
    known_points,
    nominal_rate_hz,
)

MOST_FRAMES = 100_000
"""That are exported of a recording, seven minutes at 240 Hz: within 2 GB of memory."""

Range = tuple[int | None, int | None]


def read_motion(posed: PosedRecording, licence: str = "", frames: Range = (None, None)) -> SkeletonMotion:
    """Read one hand's skeleton under one model and its motion in one recording.

    licence : the terms of use, to go into every file. frames : the first and the last to read by their
    recorded numbers; None: to that end. Of more than MOST_FRAMES one in so many is read. Digits whose joints
    failed, or that have no pose in any frame, are left out. Notes say so. Raises InputError where a table is
    absent or its making failed, where no frame is in the range, where no digit is left, or where the layout's
    digits do not hang together.
    """
    poses, thinned = _poses(posed, frames)
    bones = posed.bones(poses)
    if not posed.is_fitted:
        joints = (replace(j, name=f"{j.digit}{RECEIVER_TIP}") if j.tip else j for j in bones.joints)
        bones = replace(bones, joints=tuple(joints))
    where = f"{posed.tables.joint_centres.parent}: {posed.part.hand} hand, model {posed.model.name}"
    if bones.root_failure:
        raise InputError(f"{where}: {bones.root_failure}, and it is the skeleton's root")
    for joint, offset in zip(bones.joints[1:], bones.rest_offset_mm[1:], strict=True):
        if joint.parent < 0:
            raise InputError(
                f"digit {joint.digit} hangs from {posed.layout.digits[joint.digit].base}, which is no bone "
                "of the skeleton; an export needs one tree, so give each part a layout of its own"
            )
        # of bones before a digit's first joint the motion tells the length
        if joint.parent > 0 and not np.isnan(offset).all() and not offset[0] > 0:
            raise InputError(
                f"{where}: bone {bones.joints[joint.parent].segment} is {offset[0]} mm long in bone_lengths; "
                "expected a length above 0, so look at its joints' status"
            )
    bones, unseen = _seen_digits(bones)
    notes = [f"{digit} left out: {reason}" for digit, reason in {**bones.left_out, **unseen}.items()]
    if len(bones.joints) < 2:
        reasons = "; ".join(notes) or "the layout has none"
        raise InputError(f"{where}: no digit of {posed.recording.name} can be exported: {reasons}")
    origin = _origin(posed, licence)
    motion = motion_of(bones, poses, posed.layout, origin, (*notes, *thinned))
    return motion if frames == (None, None) else _in_range(motion, frames)


def _poses(posed: PosedRecording, frames: Range) -> tuple[Poses, list[str]]:
    """Read receivers, of a long recording in that range and no more than MOST_FRAMES; and a note on these."""
    every = -(-posed.n_frames // MOST_FRAMES)
    if every > 1 and frames != (None, None):
        poses = joined_poses([block.take(_inside(block.frame, frames)) for block in posed.pose_blocks()])
        every = -(-len(poses.frame) // MOST_FRAMES)
        poses = poses.take(slice(None, None, every or 1))
    else:
        poses = posed.poses(every)
    some = f"one frame in {every}, as no more than {MOST_FRAMES} are exported; --frames has all of a part"
    return poses, [some] if every > 1 else []


def _inside(frame: Whole, frames: Range) -> Whole:
    """Return the rows of frames (T,) that are in the range."""
    first, last = frames
    low, high = -np.inf if first is None else first, np.inf if last is None else last
    return np.flatnonzero((frame >= low) & (frame <= high))


def _in_range(motion: SkeletonMotion, frames: Range) -> SkeletonMotion:
    """Return the frames in the range, with a note; InputError where there is none."""
    inside = _inside(motion.frame, frames)
    if not len(inside):
        first, last = ("" if end is None else end for end in frames)
        whole = f"; it has {motion.frame[0]} to {motion.frame[-1]}" if len(motion.frame) else ""
        raise InputError(f"--frames: no frame of the recording is in {first}:{last}{whole}")
    out = motion.take(inside)
    return out.noting(f"frames {out.frame[0]} to {out.frame[-1]} only, as asked")


def motion_of(
    bones: PosedBones, poses: Poses, layout: Layout, origin: Origin, notes: tuple[str, ...] = ()
) -> SkeletonMotion:
    """Return the motion of bones that were posed in a recording, in WebXR frames, a thumb's facing its nail.

    bones : one tree, every digit with a pose in some frame.
    """
    joints, quaternion, axis = bones.joints, bones.quaternion.copy(), bones.axis.copy()
    facing = to_nail_side(layout, origin.hand, joints, quaternion)
    for index, change in facing.items():
        quaternion[:, index] = multiply(quaternion[:, index], change)
        axis[index] = rotate(conjugate(change), axis[index])
    joints = zeros_facing(joints, facing, origin.hand)
    unsaid = np.asarray(np.isnan(bones.rest_offset_mm).all(-1))  # of digits' first bones: as on average
    offset, rest = replace(bones, quaternion=quaternion).constant_part()
    rest[~unsaid] = (1.0, 0.0, 0.0, 0.0)
    offset = np.where(unsaid[:, None], np.nan_to_num(offset), bones.rest_offset_mm)
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
        continuous(multiply(quaternion, BONE_TO_WEBXR)),
        Receivers(
            poses.segments,
            np.where(poses.valid[..., None], poses.position_mm, np.nan),
            continuous(np.where(poses.valid[..., None], poses.quaternion, np.nan)),
            poses.valid,
        ),
        origin,
        notes,
    )


def _seen_digits(bones: PosedBones) -> tuple[PosedBones, dict[str, str]]:
    """Return the bones without the digits of which a joint has no pose in any frame, and the reasons.

    What hangs from such a digit goes with it. An end of the skin that is known in no frame, as of digits
    without known anatomy, goes alone.
    """
    seen = np.asarray(known_points(bones.position_mm, bones.quaternion).any(0))
    some = bool(len(bones.position_mm))
    unseen: dict[str, str] = {}
    kept = [0]
    for index, joint in enumerate(bones.joints[1:], 1):
        if joint.name.endswith(SKIN_TIP) and not np.isfinite(bones.position_mm[:, index]).any():
            continue
        kept.append(index)
        if some and (bones.joints[joint.parent].digit in unseen or not seen[index]):
            unseen.setdefault(joint.digit, f"{joint.name} has no pose in any frame")
    kept = [index for index in kept if bones.joints[index].digit not in unseen]
    return (bones if len(kept) == len(bones.joints) else bones.only(kept)), unseen


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
