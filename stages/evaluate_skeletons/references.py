"""Rows that every model stands beside: the distal receiver as it is, and the true skeleton."""

from __future__ import annotations

import numpy as np

from shukotsu.schemas.layout import Digit
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.tables import vector_of
from shukotsu.skeleton.digit_chain import Rows, all_valid, carried_mm
from shukotsu.skeleton.rotations import Array, conjugate, rotate
from shukotsu.stages.evaluate_skeletons.scored_skeleton import Row
from shukotsu.stages.evaluate_skeletons.scores import (
    EvaluatedRecording,
    mean_and_p95,
    true_tip_numbers,
    wrist_mcp_sd,
)
from shukotsu.stages.evaluate_skeletons.truth import at_frames

DISTAL_RECEIVER, TRUE_SKELETON = "distal-receiver", "true-skeleton"


def distal_receiver_row(recording: EvaluatedRecording, digit: Digit) -> Row:
    """The tip taken to be where the distal receiver is: no tip error, and the true tip as far as it is."""
    row, poses = recording.row(digit.name, DISTAL_RECEIVER), recording.poses
    if poses is None:
        return row
    true = recording.truth.get(digit.name)
    valid, index = all_valid(poses, (digit.tip,)), poses.index(digit.tip)
    row["n_frames"] = int(valid.sum())
    if row["n_frames"]:
        row |= {"replay_mean_mm": 0.0, "replay_p95_mm": 0.0}
    if true is not None:
        row |= true_tip_numbers(poses.position_mm[valid, index], poses.frame[valid], true)
    return row


def true_skeleton_row(recording: EvaluatedRecording, digit: Digit) -> Row | None:
    """The true skeleton replayed by the receivers as any other: skin and tracker are all that is off.

    The metacarpal is the true one in every frame; the true tip stays where it was on average in the distal
    receiver's frame. None where the truth knows no such digit.
    """
    true, truth, poses = recording.truth.get(digit.name), recording.stated_truth, recording.poses
    if true is None or truth is None or poses is None or not digit.metacarpal:
        return None
    joints, bones = truth.stated.joints, truth.stated.bones
    needed = [joints.get(name, {}).get("child_x_mm") for name in digit.joints[1:]]
    needed += [bones.get(name, {}).get("x_mm") for name in digit.segments[1:]]
    if None in needed:
        return None
    measured = [name for name in digit.segments if recording.layout.segments[name].measured]
    usable = all_valid(poses, (digit.base, *measured))
    bone = true.metacarpal_mm * at_frames(true.metacarpal, true.frame, poses.frame)
    replayed = carried_mm(poses, digit.base, _true_base(digit, joints, bone, poses)) + bone
    for segment in digit.segments[1:-1]:
        replayed = replayed + rotate(
            poses.quaternion[:, poses.index(segment)], vector_of(bones[segment], "", "_mm")
        )
    last = poses.index(digit.tip)
    own = vector_of(joints[digit.joints[-1]], "child_", "_mm")
    replayed = replayed - rotate(poses.quaternion[:, last], own)
    error = np.where(usable, np.linalg.norm(replayed - poses.position_mm[:, last], axis=-1), np.nan)
    row = recording.row(digit.name, TRUE_SKELETON) | {"n_frames": int(np.isfinite(error).sum())}
    row |= mean_and_p95("replay", error) | mean_and_p95("left_out", error)
    row["wrist_mcp_sd_mm"] = wrist_mcp_sd(poses, digit, recording.layout, joints)
    row["metacarpal_deg"] = 0.0
    tip_mm = carried_mm(poses, digit.tip, own + vector_of(bones[digit.tip], "", "_mm"))
    valid = poses.valid[:, last]
    return row | true_tip_numbers(np.where(valid[:, None], tip_mm, np.nan), poses.frame, true)


def _true_base(digit: Digit, joints: Rows, bone: Array, poses: Poses) -> Array:
    """The digit's first joint (3,) in the base receiver's frame, or where the true bone starts in mean."""
    first = joints.get(digit.joints[0])
    if first is not None and first["parent_x_mm"] is not None:
        return vector_of(first, "parent_", "_mm")
    back = rotate(conjugate(poses.quaternion[:, poses.index(digit.base)]), bone)
    seen = poses.valid[:, poses.index(digit.base)] & np.isfinite(bone[:, 0])
    if not seen.any():
        return np.full(3, np.nan)
    return np.asarray(vector_of(joints[digit.joints[1]], "parent_", "_mm") - back[seen].mean(0))
