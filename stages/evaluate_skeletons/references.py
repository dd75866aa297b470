"""Rows that every model stands beside: anatomy alone, the distal receiver as it is, and the true skeleton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.long_sample import LongSample
from kinematics.recordings import Recordings
from kinematics.rotations import Array, conjugate, rotate
from kinematics.skeleton import Rows, all_valid, ride
from schemas.errors import InputError
from schemas.layout import Digit, Layout
from schemas.poses import Poses, usable_poses
from stages.evaluate_skeletons.scores import (
    Recording,
    Row,
    known,
    mean_and_p95,
    metacarpal_deg,
    true_tip_numbers,
    wrist_mcp_sd,
)
from stages.evaluate_skeletons.skeleton_folder import Stated
from stages.evaluate_skeletons.truth_folder import TrueDigit, at_frames, directions
from stages.fit_hand.chain import known_digits
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.replaying import PosedHand, pose_hand

PRIOR_ONLY, DISTAL_RECEIVER, TRUE_SKELETON = "prior-only", "distal-receiver", "true-skeleton"

MOST_FRAMES = 200
"""Evenly spaced frames of a recording in which the prior's hand is posed. A motion repeats itself: eight
times as many move the means, which are millimetres, by 0.02 mm.
"""


@dataclass(frozen=True)
class Prior:
    """The hand that anatomy expects. fit : None where it could not be had; message : why."""

    layout: Layout
    fit: HandFit | None
    message: str

    @property
    def stated(self) -> Stated:
        """What it states of its joints and bones; no error, as nothing was weighed."""
        if self.fit is None:
            return Stated({}, {})
        joints: dict[str, Row] = {}
        for joint in self.fit.joints.values():
            joints[joint.name] = {"joint": joint.name, "status": "ok", "sd_mm": None}
            for side, point, axis in (
                ("parent", joint.parent_mm, joint.axis_parent),
                ("child", joint.child_mm, joint.axis_child),
            ):
                joints[joint.name] |= _by_axis(f"{side}_", "_mm", point) | _by_axis(f"axis_{side}_", "", axis)
        wrist = self.layout.wrist
        if wrist is not None:
            found = _by_axis("child_", "_mm", self.fit.reading.wrist_mm)
            joints.setdefault(wrist.joint, {"joint": wrist.joint, "status": "ok", **found})
        bones = {name: {"bone_mm": bone.length_mm} for name, bone in self.fit.bones.items()}
        return Stated(joints, bones)


def fit_prior(
    calibration: Sequence[Path], layout: Layout, hand: str, hand_length_mm: float | None = None
) -> Prior | None:
    """Give the prior's hand for these recordings; None for a layout whose digits have no known anatomy.

    hand_length_mm : wrist crease to the tip of the middle finger, where it was measured.

    The recordings say which receivers were worn and how the hand was held in the mean, which is where a joint
    across a moving palm is read; they do not move a bone, an axis or a receiver.
    """
    if not known_digits(layout):
        return None
    usable, reasons = usable_poses(calibration)
    if not usable:
        return Prior(layout, None, f"no calibration recording: {'; '.join(reasons) or 'none is given'}")
    try:
        recordings = [some_frames(Recordings([path], layout.measured), MOST_FRAMES) for path in usable]
        nothing_moves = Settings(most_steps=0, rounds=0)
        fit = fit_hand(recordings, layout, hand, hand_length_mm=hand_length_mm, settings=nothing_moves)
    except InputError as error:
        return Prior(layout, None, str(error))
    return Prior(layout, fit, "")


def some_frames(recording: Recordings, most: int) -> Poses:
    """Read at most so many frames of a recording, evenly spaced."""
    return recording.every(max(1, -(-recording.n_frames() // most)))


def prior_rows(prior: Prior, recording: Recording) -> list[Row]:
    """Rows of the prior's hand in one recording, a digit each."""
    anatomy = {digit.name for digit in known_digits(recording.layout)}
    rows = [
        recording.row(
            name, PRIOR_ONLY, prior.message if name in anatomy else "no published anatomy of this digit"
        )
        for name in recording.layout.digits
    ]
    if prior.fit is None or recording.poses_in_blocks is None or recording.message:
        return rows
    poses = some_frames(recording.poses_in_blocks, MOST_FRAMES)
    posed = pose_hand(prior.fit, poses)
    tips = [digit.tip for digit in recording.layout.digits.values() if digit.tip in posed.receivers]
    left_out = pose_hand(prior.fit, poses, dict.fromkeys(tips, (0.0, 1.0)))
    joints = prior.stated.joints
    for row in rows:
        digit = recording.layout.digits[row["digit"]]
        if row["digit"] in anatomy and digit.tip in posed.receivers:
            error_mm = known(receiver_error_mm(posed, poses, digit.tip))
            row |= {"n_frames": len(error_mm), "posed_mean_mm": error_mm.mean() if len(error_mm) else None}
            row |= mean_and_p95("left_out", known(receiver_error_mm(left_out, poses, digit.tip)))
            (row["wrist_mcp_sd_mm"],) = wrist_mcp_sd([poses], digit, recording.layout, [joints])
            row |= _prior_against_truth(posed, poses, digit, recording.truth.get(digit.name))
    return rows


def receiver_error_mm(posed: PosedHand, poses: Poses, segment: str) -> Array:
    """Distance (T,) from where the posed hand says that a receiver is to where it is; NaN in its gaps."""
    index = poses.index(segment)
    apart = posed.receiver_mm[:, posed.receivers.index(segment)] - poses.position_mm[:, index]
    return np.where(poses.valid[:, index], np.linalg.norm(apart, axis=-1), np.nan)


def _prior_against_truth(posed: PosedHand, poses: Poses, digit: Digit, true: TrueDigit | None) -> Row:
    if true is None:
        return {}
    found = true_tip_numbers(posed.tip_mm[:, posed.tips.index(digit.name)], poses.frame, true)
    if digit.metacarpal:
        turned = directions(posed.bone_quaternion[:, posed.bones.index(digit.segments[0])])
        found["metacarpal_deg"] = metacarpal_deg(turned, poses.frame, true)
    return found


def distal_receiver_row(recording: Recording, digit: Digit) -> Row:
    """The tip taken to be where the distal receiver is: no tip error, and the true tip as far as it is."""
    row, true = recording.row(digit.name, DISTAL_RECEIVER), recording.truth.get(digit.name)
    off_mm = LongSample()
    for poses in recording.blocks(digit.tip):
        valid = all_valid(poses, (digit.tip,))
        row["n_frames"] += int(valid.sum())
        if true is not None:
            tip_mm = at_frames(true.tip_mm, true.frame, poses.frame)
            apart = np.linalg.norm(poses.position_mm[:, poses.index(digit.tip)] - tip_mm, axis=-1)
            off_mm.add_known(apart[valid])
    if row["n_frames"]:
        row |= {"replay_mean_mm": 0.0, "replay_p95_mm": 0.0}
    return row | mean_and_p95("true_tip", off_mm)


def true_skeleton_row(recording: Recording, digit: Digit, poses: Poses) -> Row | None:
    """The true skeleton replayed by the receivers as any other: skin and tracker are all that is off.

    The metacarpal is the true one in every frame; the tip error is of the replay; the true tip is taken to
    stay where it is in the distal receiver's frame as mounted. poses : of the digit's receivers. None where
    the truth knows no such digit.
    """
    true, truth = recording.truth.get(digit.name), recording.truth_folder
    if true is None or truth is None or not digit.metacarpal or not _knows(truth.stated, digit):
        return None
    joints, bones = truth.stated.joints, truth.stated.bones
    usable = all_valid(poses, poses.segments)
    metacarpal = at_frames(true.metacarpal, true.frame, poses.frame)
    bone = true.metacarpal_mm * directions(metacarpal)
    replayed = ride(poses, digit.base, _true_base(digit, joints, bone, poses)) + bone
    for segment in digit.segments[1:-1]:
        replayed = replayed + rotate(poses.quaternion[:, poses.index(segment)], _point(bones[segment], ""))
    last = poses.index(digit.tip)
    own = _point(joints[digit.joints[-1]], "child_")
    replayed = replayed - rotate(poses.quaternion[:, last], own)
    error = np.where(usable, np.linalg.norm(replayed - poses.position_mm[:, last], axis=-1), np.nan)
    row = recording.row(digit.name, TRUE_SKELETON) | {"n_frames": int(np.isfinite(error).sum())}
    row |= mean_and_p95("replay", known(error)) | mean_and_p95("left_out", known(error))
    (row["wrist_mcp_sd_mm"],) = wrist_mcp_sd([poses], digit, recording.layout, [joints])
    row["metacarpal_deg"] = 0.0
    tip_mm = ride(poses, digit.tip, own + _point(bones[digit.tip], ""))
    valid = poses.valid[:, last]
    return row | true_tip_numbers(np.where(valid[:, None], tip_mm, np.nan), poses.frame, true)


def _true_base(digit: Digit, joints: Rows, bone: Array, poses: Poses) -> Array:
    """The digit's first joint (3,) in the base receiver's frame: where the truth has it, else (a finger's CMC
    joint, which no receiver shows) where the true metacarpal (T, 3) ends at the true MCP joint in the mean.
    """
    first = joints.get(digit.joints[0])
    if first is not None and first["parent_x_mm"] is not None:
        return _point(first, "parent_")
    back = rotate(conjugate(poses.quaternion[:, poses.index(digit.base)]), bone)
    seen = poses.valid[:, poses.index(digit.base)] & np.isfinite(bone[:, 0])
    if not seen.any():
        return np.full(3, np.nan)
    return np.asarray(_point(joints[digit.joints[1]], "parent_") - back[seen].mean(0))


def _knows(stated: Stated, digit: Digit) -> bool:
    """Whether the truth has the digit's joints after the first and its bones, as vectors, after it."""
    joints = [stated.joints.get(name, {}).get("child_x_mm") for name in digit.joints[1:]]
    bones = [stated.bones.get(name, {}).get("x_mm") for name in digit.segments[1:]]
    return None not in (*joints, *bones)


def _point(row: Mapping[str, Any], side: str) -> Array:
    return np.array([row[f"{side}{axis}_mm"] for axis in "xyz"], float)


def _by_axis(prefix: str, suffix: str, values: Array) -> Row:
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", values, strict=True)}
