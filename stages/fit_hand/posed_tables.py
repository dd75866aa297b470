"""A recording posed with the fitted hand, as columns of the tables, a block of frames at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.joint_angles import angles_of_hand, mirrored
from kinematics.rotations import Array, from_matrix, multiply
from schemas.layout import Layout
from schemas.poses import Poses, RecordingName, frame_count, pose_blocks, recording_name
from stages.fit_hand.building import KINDS
from stages.fit_hand.chain import known_digits, rest_rotations
from stages.fit_hand.fingertips import Fingertips
from stages.fit_hand.fit import HandFit
from stages.fit_hand.replaying import PosedHand, pose_hand

BLOCK_FRAMES = 1 << 14
LEFT_OUT_FRAMES = 512
"""Frames of a recording, evenly spaced, that are posed without the distal receivers' positions as well."""

Columns = dict[str, Any]


@dataclass(frozen=True)
class PosedBlock:
    """Columns of joint_angles, bone_poses and posed_tips for some frames of one recording."""

    angles: Columns
    bones: Columns
    tips: Columns


def posed_blocks(tips: Fingertips, model: str, recordings: Sequence[Path]) -> Iterator[PosedBlock]:
    """Pose every recording, in blocks of frames."""
    segments = tips.fit.evidence.layout.measured
    for path in recordings:
        name = recording_name(path)
        step = max(1, -(-frame_count(path) // LEFT_OUT_FRAMES))
        first = 0
        for poses in pose_blocks(path, segments, BLOCK_FRAMES):
            tried = np.arange((-first) % step, len(poses.frame), step)
            yield _block(tips, name, model, poses, tried)
            first += len(poses.frame)


def _block(
    tips: Fingertips, name: RecordingName, model: str, poses: Poses, tried: npt.NDArray[np.int64]
) -> PosedBlock:
    fit = tips.fit
    posed = pose_hand(fit, poses)
    words = {
        "subject": name.subject,
        "hand": name.hand,
        "task": name.task,
        "trial": name.trial,
        "model": model,
    }
    return PosedBlock(
        angle_columns(words, fit, posed, poses),
        _bone_columns(words, posed, poses),
        _tip_columns(words, tips, posed, poses, tried),
    )


def _repeated(
    words: dict[str, str], key: str, names: Sequence[str], frame: npt.NDArray[np.int64], n: int
) -> Columns:
    """Key columns of n names after each other, every one over all frames."""
    columns: Columns = {word: [value] * (n * len(frame)) for word, value in words.items()}
    return columns | {key: np.repeat(np.array(names, object), len(frame)), "frame": np.tile(frame, n)}


def _stacked(values: Array) -> Array:
    """(T, N, ...) as (N T, ...), name after name."""
    return np.swapaxes(values, 0, 1).reshape(-1, *values.shape[2:])


def angle_columns(words: dict[str, str], fit: HandFit, posed: PosedHand, poses: Poses) -> Columns:
    """Columns of joint_angles for the frames of poses, joint after joint; words : the other key columns."""
    evidence = fit.evidence
    hand = "left" if evidence.convention.left else "right"
    bones, rests = _facing_nails(fit, posed, hand)
    angles = _turns(posed, evidence.layout)
    angles |= angles_of_hand(posed.bones, bones, bones[:, 0], evidence.layout, hand, rests)
    joints = tuple(angles)
    n_frames = len(poses.frame)
    stacked = np.concatenate([angles[joint] for joint in joints]) if joints else np.empty((0, 3))
    columns = _repeated(words, "joint", joints, poses.frame, len(joints))
    assert len(stacked) == len(joints) * n_frames
    for index, part in enumerate(("flexion", "abduction", "rotation")):
        columns[f"{part}_deg"] = stacked[:, index]
    return columns


def _turns(posed: PosedHand, layout: Layout) -> dict[str, Array]:
    """Turns (T, 3) in degrees about the three axes of each joint of which no anatomy is known.

    An axis that the joint lacks gives NaN.
    """
    known = {joint for digit in known_digits(layout) for joint in digit.joints}
    turns: dict[str, Array] = {}
    for index, (joint, kind) in enumerate(posed.angle_names):
        if joint not in known:
            own = turns.setdefault(joint, np.full((len(posed.posed), 3), np.nan))
            own[:, KINDS.index(kind)] = np.degrees(posed.angles_rad[:, index])
    return turns


def _facing_nails(fit: HandFit, posed: PosedHand, hand: str) -> tuple[Array, dict[str, Array]]:
    """Bones' postures (T, B, 4) and rests with the thumb's metacarpal facing as its phalanges do.

    So that its angles bear the right names, whichever way its receiver faces.
    """
    layout, own, bones = fit.evidence.layout, fit.evidence.model.anatomy, posed.bone_quaternion.copy()
    nails = {name: replace(digit, faces_nail=digit.second_axis is not None) for name, digit in own.items()}
    for digit in known_digits(layout):
        turn = from_matrix(own[digit.name].frames()[0].T @ nails[digit.name].frames()[0])
        index = posed.bones.index(digit.segments[0])
        bones[:, index] = multiply(bones[:, index], mirrored(turn) if hand == "left" else turn)
    return bones, rest_rotations(layout, hand, nails)


def _bone_columns(words: dict[str, str], posed: PosedHand, poses: Poses) -> Columns:
    columns = _repeated(words, "segment", posed.bones, poses.frame, len(posed.bones))
    place, turn = _stacked(posed.bone_position_mm), _stacked(posed.bone_quaternion)
    columns |= {f"{axis}_mm": place[:, index] for index, axis in enumerate("xyz")}
    return columns | {f"q{part}": turn[:, index] for index, part in enumerate("wxyz")}


def _tip_columns(
    words: dict[str, str], tips: Fingertips, posed: PosedHand, poses: Poses, tried: npt.NDArray[np.int64]
) -> Columns:
    layout = tips.fit.evidence.layout
    digits = [digit for digit in layout.digits.values() if digit.tip in posed.receivers]
    receivers = [posed.receivers.index(digit.tip) for digit in digits]
    measured = poses.position_mm[:, [poses.index(digit.tip) for digit in digits]]
    valid = poses.valid[:, [poses.index(digit.tip) for digit in digits]]
    left_out = np.full(valid.shape, np.nan)
    blind = pose_hand(tips.fit, poses.take(tried), {digit.tip: (0.0, 1.0) for digit in digits})
    error = np.linalg.norm(posed.receiver_mm[:, receivers] - measured, axis=-1)
    left_out[tried] = np.linalg.norm(blind.receiver_mm[:, receivers] - measured[tried], axis=-1)
    columns = _repeated(words, "digit", [digit.name for digit in digits], poses.frame, len(digits))
    columns["time_s"] = np.tile(poses.time_s, len(digits))
    tip = _stacked(_tips_mm(tips, posed, poses, [digit.name for digit in digits]))
    columns |= {f"tip_{axis}_mm": tip[:, index] for index, axis in enumerate("xyz")}
    columns["error_mm"] = _stacked(np.where(valid, error, np.nan))
    columns["error_left_out_mm"] = _stacked(np.where(valid, left_out, np.nan))
    columns["residual_mm"] = np.tile(posed.residual_mm, len(digits))
    return columns


def _tips_mm(tips: Fingertips, posed: PosedHand, poses: Poses, digits: Sequence[str]) -> Array:
    """Ends of the digits' distal bones, (T, D, 3); NaN where the layout's anatomy is not known.

    Carried by the distal receiver, which follows its bone better than the whole hand says; by the posed
    bone where that receiver is not valid.
    """
    out = np.full((len(poses.frame), len(digits), 3), np.nan)
    carried = tips.in_transmitter(poses)
    for index, digit in enumerate(digits):
        if digit in posed.tips and digit in tips.digits:
            own = carried[:, list(tips.digits).index(digit)]
            bone = posed.tip_mm[:, posed.tips.index(digit)]
            out[:, index] = np.where(np.isfinite(own), own, bone)
    return out
