"""Input of every export format: one hand's skeleton and its motion over a recording, in WebXR frames.

Bone frames. Every joint has the frame of the bone that starts there, as WebXR Hand Input and OpenXR define
it: -Z along the bone, away from the wrist; +Y out of the back of the bone (for a thumb, the nail's side); +X
= Y x Z, which points to the right for both hands when the hand points forward with its back up. No frame is
mirrored; a left hand differs in the positions of its joints. In terms of the frames of our tables (x distal,
z dorsal, y = z x x), X = -y, Y = z and Z = -x: `BONE_TO_WEBXR`.

World. Positions and rotations are in the transmitter's frame, mm, as measured; `registry.prepare` rotates
them to the axes that a format expects.

Tree. Bone 0 is the root, the wrist of a hand. A digit ends in tips, which have its last bone's rotation. For
a fitted hand these are `<digit>_tip`, the end of the bone, and after it `<digit>_skin_tip`, the end of the
digit including skin; for other skeletons `<digit>_receiver_tip`, the origin of the distal receiver
(docs/conventions.md). At rest, digits are straight, and the first bone of each is in its average orientation.

Translations. Bones have the lengths in the tables (`rest_offset_mm`), but two bones do not meet exactly at
joint centres that were solved one by one, nor, because of skin motion, in a fitted hand. In each frame the
difference from the rest offset is a small translation of the joint. `position_mm` includes it, so that every
joint is where the tables have it. `stiffen` removes it and keeps only rotations.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Index
from shukotsu.errors import InputError
from shukotsu.hand.neutral_bones import at_rest
from shukotsu.hand.posed_recording import RecordingReader
from shukotsu.hand.posing import PosedRecording, rigid_positions
from shukotsu.hand.recorded_movement import assumed_angles
from shukotsu.hand.rotations import conjugate, continuous, from_matrix, multiply, rotate
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.study.layout import Layout
from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from shukotsu.tables.device_clock import nominal_rate_hz
from shukotsu.tables.digests import file_sha256
from shukotsu.tables.poses import Poses, joined_poses
from shukotsu.tables.subjects import SubjectSession, path_token

BONE_TO_WEBXR = from_matrix(np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Quaternion (4,) from a bone's WebXR frame to its frame in our tables: q_webxr = q_bone * BONE_TO_WEBXR."""

BONE_FRAME = (
    "-Z along the bone away from the wrist, +Y out of its dorsal side (thumb: nail side), +X = Y x Z "
    "(WebXR Hand Input)"
)

DISTAL = np.array([0.0, 0.0, -1.0])
"""Direction along a bone in its WebXR frame."""

SKIN_TIP, RECEIVER_TIP = "_skin_tip", "_receiver_tip"
"""Suffixes of tips that are not the end of a bone."""

BLOCK_FRAMES = 4096
"""Frames per block of a table."""

MOVES_MM = 1e-5
"""A joint that leaves its rest offset by more than this is said to move relative to the bone before it."""

ALONE_HZ = 60.0
"""Rate written to a file with a single frame, which has no rate, if the format requires one."""

MOST_FRAMES = 100_000
"""Largest number of frames in an export, seven minutes at 240 Hz, for which 2 GB of memory suffice."""

Range = tuple[int | None, int | None]


def read_motion(reader: RecordingReader, licence: str = "", frames: Range = (None, None)) -> PosedRecording:
    """Read one hand's skeleton under one model and its motion in one recording.

    If there are more than MOST_FRAMES, only every n-th frame is read. Digits whose joints failed, or that
    have no pose in any frame, are left out. Notes report both.

    licence : terms of use to state in every file. frames : recorded numbers of the first and last frame to
    read; None for the recording's start or end. Raises InputError if a table is missing or failed, if no
    frame is in the range, if no digit is left, or if the layout's digits are not connected to one tree.
    """
    poses, thinned = _poses(reader, frames)
    bones = reader.bones(poses)
    if not reader.is_fitted:
        assumed = assumed_angles(reader)
        joints = (
            replace(j, name=f"{j.digit}{RECEIVER_TIP}")
            if j.tip
            else replace(j, assumed=assumed.get(j.name, ""))
            for j in bones.joints
        )
        bones = replace(bones, joints=tuple(joints))
    folder = reader.tables(JOINT_CENTRES.name).parent
    where = f"{folder}: {reader.part.hand} hand, model {reader.model.name}"
    if bones.root_failure:
        raise InputError(f"{where}: {bones.root_failure}, and it is the skeleton's root")
    for joint in (joint for joint in bones.joints[1:] if joint.parent < 0):
        raise InputError(
            f"digit {joint.digit} is attached to {reader.layout.digits[joint.digit].base}, which is not a "
            "bone of the skeleton; an export needs one tree, so describe each part by a separate layout"
        )
    bones, unseen = _seen_digits(bones)
    for joint, offset in zip(bones.joints, bones.rest_offset_mm, strict=True):
        # the motion gives the length of bones before a digit's first joint
        if joint.parent > 0 and not np.isnan(offset).all() and not offset[0] > 0:
            raise InputError(
                f"{where}: bone {bones.joints[joint.parent].segment} is {offset[0]} mm long in bone_lengths; "
                "expected a length above 0, so look at its joints' status"
            )
    notes = []
    for digit, reason in {**bones.left_out, **unseen}.items():
        why = reader.unmeasured(reader.layout.digits[digit].joints[0])
        notes.append(f"{digit} left out: {why or reason}")
    if beyond := [bones.names[index] for index in np.flatnonzero(beyond_receivers(bones))]:
        notes.append(f"measured by no receiver: {', '.join(beyond)}")
    if unmeasured := {joint.name: joint.assumed for joint in bones.joints if joint.assumed}:
        notes.append(f"angles not measured: {', '.join(unmeasured)} ({next(iter(unmeasured.values()))})")
    if len(bones.joints) < 2:
        reasons = "; ".join(notes) or "the layout has none"
        raise InputError(f"{where}: no digit of {reader.recording.name} can be exported: {reasons}")
    of_model = (BONE_POSES, POSED_TIPS) if reader.is_fitted else (METACARPALS,)
    tables = (reader.tables(table.name) for table in (JOINT_CENTRES, BONE_LENGTHS, *of_model))
    files, top = [file for file in (reader.poses_file, *tables) if file.is_file()], folder.parent
    names = (file.relative_to(top).as_posix() if file.is_relative_to(top) else file.name for file in files)
    inputs = dict(zip(names, map(file_sha256, files), strict=True))
    origin = replace(bones.origin, inputs=inputs, licence=licence)
    motion = in_webxr(replace(bones, origin=origin, notes=(*notes, *thinned)), reader.layout)
    if frames == (None, None):
        return motion
    inside = _inside(motion.frame, frames)
    if not len(inside):
        first, last = ("" if end is None else end for end in frames)
        whole = f"; it has {motion.frame[0]} to {motion.frame[-1]}" if len(motion.frame) else ""
        raise InputError(f"--frames: no frame of the recording is in {first}:{last}{whole}")
    motion = motion.take(inside)
    return motion.noting(f"frames {motion.frame[0]} to {motion.frame[-1]} only, as requested")


def _poses(reader: RecordingReader, frames: Range) -> tuple[Poses, list[str]]:
    """Return the receivers' poses in at most MOST_FRAMES of the range, and a note if frames are skipped."""
    every = -(-reader.n_frames // MOST_FRAMES)
    if every > 1 and frames != (None, None):
        poses = joined_poses([block.take(_inside(block.frame, frames)) for block in reader.pose_blocks()])
        every = -(-len(poses.frame) // MOST_FRAMES)
        poses = poses.take(slice(None, None, every or 1))
    else:
        poses = reader.poses(every)
    some = f"one frame in {every}, since at most {MOST_FRAMES} are exported; --frames exports all of a part"
    return poses, [some] if every > 1 else []


def _inside(frame: Index, frames: Range) -> Index:
    """Return the indices of the frames (T,) in the range."""
    first, last = frames
    low, high = -np.inf if first is None else first, np.inf if last is None else last
    return np.flatnonzero((frame >= low) & (frame <= high))


def in_webxr(bones: PosedRecording, layout: Layout) -> PosedRecording:
    """Return the motion in WebXR frames, with +Y of a thumb towards its nail, and with continuous rotations.

    bones : one tree, in which every digit has a pose in some frame.
    """
    unsaid = np.asarray(np.isnan(bones.rest_offset_mm).all(-1))  # digits' first bones: their average is used
    bones = at_rest(layout, bones)
    offset_mm = np.where(unsaid[:, None], np.nan_to_num(bones.rest_offset_mm), bones.rest_offset_mm)
    rest = np.where(unsaid[:, None], bones.rest, [1.0, 0.0, 0.0, 0.0])
    back, there = conjugate(BONE_TO_WEBXR), bones.receivers
    valid = there.valid[..., None]
    return replace(
        bones,
        quaternion=continuous(multiply(bones.quaternion, BONE_TO_WEBXR)),
        receivers=replace(
            there,
            position_mm=np.where(valid, there.position_mm, np.nan),
            quaternion=continuous(np.where(valid, there.quaternion, np.nan)),
        ),
        rest_offset_mm=rotate(back, offset_mm),
        axis=rotate(back, bones.axis),
        rest=multiply(back, multiply(rest, BONE_TO_WEBXR)),
        neutral=multiply(back, multiply(bones.neutral, BONE_TO_WEBXR)),
        rate_hz=nominal_rate_hz(there.frame, there.time_s),
    )


def _seen_digits(bones: PosedRecording) -> tuple[PosedRecording, dict[str, str]]:
    """Remove digits in which a joint has no pose in any frame; return the remaining bones and the reasons.

    Everything attached to such a digit is removed as well. If only the end of the skin is unknown, as in
    digits of unknown anatomy, only that tip is removed. Bones beyond a digit's last receiver remain, without
    poses.
    """
    seen = np.asarray(bones.known.any(0)) | beyond_receivers(bones)
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


def beyond_receivers(motion: PosedRecording) -> Bools:
    """Return which joints (B,) never have a pose and come after the last joint of their digit with one."""
    seen: Bools = np.asarray(motion.known.any(0))
    beyond: Bools = ~seen & np.isfinite(motion.rest_offset_mm).all(-1)
    for digit in {joint.digit for joint in motion.joints}:
        of_digit = np.array([joint.digit == digit for joint in motion.joints])
        last = int(np.flatnonzero(of_digit & seen).max(initial=-1))
        beyond &= ~of_digit | ((np.arange(len(seen)) > last) & (last >= 0))
    return beyond


def with_unmeasured_at_rest(motion: PosedRecording) -> PosedRecording:
    """Extend each digit straight beyond its last receiver, and add a note that names these bones.

    This is for programs that need every bone of a finger in every frame.
    """
    beyond = np.flatnonzero(beyond_receivers(motion))
    if not len(beyond):
        return motion
    position, turn = motion.position_mm.copy(), motion.quaternion.copy()
    for index in beyond:
        above = motion.joints[index].parent
        position[:, index] = position[:, above] + rotate(turn[:, above], motion.rest_offset_mm[index])
        turn[:, index] = multiply(turn[:, above], motion.rest[index])
    names = ", ".join(motion.names[index] for index in beyond)
    posed = replace(motion, position_mm=position, quaternion=turn)
    return posed.noting(f"not measured and therefore at rest in this file: {names}")


def blocks(motion: PosedRecording) -> Iterator[PosedRecording]:
    """Yield the motion in blocks of BLOCK_FRAMES frames."""
    for start in range(0, len(motion.frame), BLOCK_FRAMES):
        yield motion.take(slice(start, start + BLOCK_FRAMES))


def carrier(motion: PosedRecording, tip: int) -> tuple[int, Array]:
    """Return the index of the joint whose bone carries a tip, and the tip's rest position on it (3,), mm."""
    offset_mm, above = motion.rest_offset_mm[tip], motion.joints[tip].parent
    while motion.joints[above].tip:  # a tip has the rotation of its bone
        offset_mm, above = offset_mm + motion.rest_offset_mm[above], motion.joints[above].parent
    return above, offset_mm


def with_seen_receivers(motion: PosedRecording) -> tuple[PosedRecording, tuple[str, ...]]:
    """Remove receivers without a pose in any frame; return the motion and a sentence on them, if any.

    A layout may contain receivers that were not worn, such as the forearm's.
    """
    there = motion.receivers
    seen, segments = there.valid.any(0), np.array(there.segments, object)
    if seen.all():
        return motion, ()
    arrays = (there.position_mm[:, seen], there.quaternion[:, seen], there.valid[:, seen])
    worn = Poses(tuple(segments[seen]), there.frame, there.time_s, *arrays)
    absent = ", ".join(segments[~seen])
    return replace(motion, receivers=worn), (f"receivers that have no pose in any frame: {absent}",)


def local_motion(motion: PosedRecording) -> tuple[Array, Array]:
    """Return each joint's pose in its parent's bone frame, and the root's in the world: (T, J, 3), (T, J, 4).

    The offset, mm, is the rest offset plus the joint's translation in that frame. Quaternions have continuous
    signs. Both are NaN in gaps of either bone.
    """
    parents, position, turn = motion.parents, motion.position_mm, motion.quaternion
    back = conjugate(turn[:, parents])
    offset, local = rotate(back, position - position[:, parents]), multiply(back, turn)
    offset[:, parents < 0], local[:, parents < 0] = position[:, parents < 0], turn[:, parents < 0]
    return offset, continuous(local)


def rest_pose(motion: PosedRecording) -> tuple[Array, Array]:
    """Return positions (B, 3) mm and rotations (B, 4) of bone frames at rest, in the root's bone frame."""
    position, turn = np.zeros((len(motion.joints), 3)), motion.rest.copy()
    for index, joint in enumerate(motion.joints[1:], 1):
        above = turn[joint.parent]
        position[index] = position[joint.parent] + rotate(above, motion.rest_offset_mm[index])
        turn[index] = multiply(above, motion.rest[index])
    return position, turn


def stiffen(motion: PosedRecording) -> PosedRecording:
    """Return the motion with joints at their rest offsets, so that only the root has translations.

    This is for programs in which bones cannot stretch. A note states the largest displacement of a joint. For
    a skeleton that is not a fitted hand, the result is the replay with the least-squares binding, with the
    tips of the tips table.
    """
    position = rigid_positions(motion)
    moved_mm = np.linalg.norm(position - motion.position_mm, axis=-1)
    note = "bone lengths kept constant"
    if np.isfinite(moved_mm).any():
        largest = np.nan_to_num(moved_mm, nan=-1.0).max(0)
        note += (
            f", which moves joints by up to {largest.max():.3f} mm ({motion.names[int(largest.argmax())]}), "
            f"rms {np.sqrt(np.nanmean(moved_mm**2)):.3f} mm"
        )
    return replace(motion, position_mm=position).noting(note)


def require_whole(motion: PosedRecording, path: Path, name: str) -> None:
    """Raise InputError if there is no frame or a pose is missing; name : the format, for the message."""
    if not len(motion.frame) or not motion.whole.all():
        raise InputError(
            f"{path}: {name} needs at least one frame, and a pose in every frame; choose --gaps hold, "
            "cut or interpolate"
        )


def require_rate(motion: PosedRecording, path: Path, name: str) -> None:
    """Raise InputError if there are several frames of unknown rate; name : the format, for the message."""
    if len(motion.frame) > 1 and not isfinite(motion.rate_hz):
        raise InputError(
            f"{path}: the recording has no device time, and {name} needs a rate; give rate_hz in a mapping"
        )


def require_times(
    motion: PosedRecording, times: npt.NDArray[np.floating], where: Path | str, name: str
) -> None:
    """Raise InputError if device times are missing or do not increase.

    times : (T,), as the format stores them. where, name : a file and its format, or an option and its use,
    for the message.
    """
    if len(times) < 2:
        return
    if not np.isfinite(motion.time_s).all():
        raise InputError(
            f"{where}: the recording has no device time, and {name} needs it; give its rate_hz in a mapping"
        )
    still = np.flatnonzero(~(np.diff(times) > 0))
    if len(still):
        raise InputError(
            f"{where}: device time does not increase from frame {motion.frame[still[0]]} to the next, as "
            f"{name} requires; choose --frames that leave this out"
        )


def file_stem(who: SubjectSession, hand: str, task: str, trial: str, model: str) -> str:
    """Return a file's name without extension, such as sub-01_hand-right_task-opposition_model-whole-hand.

    Letters of any script are kept; characters that file names cannot contain become %XX (`path_token`).
    """
    parts = {"hand": hand, "task": task, "trial": trial, "model": model}
    named = [f"{key}-{path_token(value)}" for key, value in parts.items() if value]
    return "_".join([f"sub-{who.token}", *named])


def ascii_name(name: str) -> str:
    """Return a name in ASCII letters, digits and `_ - : .`, for formats in which names cannot be quoted.

    Any other character is replaced by its code, so that in practice different names stay different.
    """
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-:.") else f"_u{ord(c):04x}" for c in name)


def plain_names(names: Iterable[str]) -> list[str]:
    """Return unique names of ASCII letters, digits and underscores, which XML, OpenSim and scripts accept."""
    taken: list[str] = []
    for original in names:
        name = plain = re.sub(r"\W", "_", ascii_name(original), flags=re.ASCII)
        number = 2
        while name in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.append(name)
    return taken


def facts(motion: PosedRecording, unit: str, up: str, dropped: Sequence[str] = ()) -> dict[str, Any]:
    """Return facts about a file in JSON types and a fixed order, without a date or an absolute path.

    unit : unit of length. up : the axis that points up, or empty in the transmitter's frame. dropped :
    sentences on what the file lacks.
    """
    origin, name = motion.origin, motion.origin.recording
    turned = f", rotated so that {up} is up" if up else ""
    return {
        "program": f"{PROGRAM} {VERSION}",
        "subject": name.subject,
        **({"session": name.session} if name.session else {}),
        "hand": name.hand,
        "task": name.task,
        "trial": name.trial,
        "model": origin.model,
        "layout": origin.layout,
        "licence": origin.licence,
        "frames": len(motion.frame),
        "rate_hz": round(motion.rate_hz, 9) if isfinite(motion.rate_hz) else None,
        "length_unit": unit,
        "world": f"the transmitter's frame{turned}; motion is relative to the transmitter",
        "bone_frame": BONE_FRAME,
        "notes": list(motion.notes),
        "not_in_the_file": list(dropped),
        "inputs_sha256": dict(origin.inputs),
    }


def facts_text(motion: PosedRecording, unit: str, up: str, dropped: Sequence[str]) -> str:
    """Return the facts as lines of text, for formats that cannot contain them."""
    lines = []
    for key, value in facts(motion, unit, up, dropped).items():
        if isinstance(value, list):
            lines += [f"{key}: {sentence}" for sentence in value]
        elif isinstance(value, dict):
            lines += [f"{key}: {digest}  {name}" for name, digest in value.items()]
        elif value not in ("", None):
            lines.append(f"{key}: {value}")
    return "\n".join(lines) + "\n"
