"""One hand put together: joints solved and fitted, its wrist point, its bones, its metacarpals over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.schemas.catalogue import DISTAL_RECEIVER
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.poses import PosesReader
from shukotsu.schemas.verdict import LEAST_KNUCKLES_MM, TOO_CLOSE, UNJUDGED, Doubts, judged_bone, judged_joint
from shukotsu.skeleton.digit_chain import Rows, digit_chain
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.estimate_metacarpals.bones import (
    LENGTHS,
    MetacarpalBone,
    digit_bones,
    metacarpal_mode,
    with_fitted_lengths,
)
from shukotsu.stages.estimate_metacarpals.metacarpals import metacarpal_columns, neutral_posture
from shukotsu.stages.estimate_metacarpals.wrist import wrist_row

Row = dict[str, Any]
Index = npt.NDArray[np.int64]

_OF_JOINT_ALONE = ("gap_rms_free_mm", "n_frames", "n_effective")
"""Columns that only the frames joint by joint say."""

_KEPT_OF_FAILED = ("subject", "hand", "model", "joint", "parent_segment", "child_segment", "dof", "n_frames")


@dataclass(frozen=True)
class BuiltHand:
    """Rows of joint_centres and bone_lengths, and the digits whose metacarpal is posed."""

    joints: list[Row]
    bones: list[Row]
    metacarpals: list[MetacarpalBone]


def build_hand(
    rows: Rows,
    layout: Layout,
    model: SkeletonModel,
    calibration: PosesReader,
    fitted_bones: Rows | None = None,
) -> BuiltHand:
    """Add the wrist point to a hand's joints and measure its bones.

    rows : joint_centres by joint. fitted_bones : rows of a whole-hand fit's bone_lengths by segment. A digit
    with a failed joint has bones without lengths that say so, but for what the fit knows.
    """
    joints = {name: dict(row) for name, row in rows.items()}
    wrist = wrist_row(rows, layout, model, calibration)
    if wrist is not None:
        joints[wrist["joint"]] = {"covariance_mm2": None} | wrist
    bones: list[Row] = []
    metacarpals = []
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, model, joints)
        if isinstance(chain, str):
            unknown = {"starts_at": "", "ends_at": "", "length_mm": None, "driven_by": "", "message": chain}
            for segment in digit.segments:
                fitted = (fitted_bones or {}).get(segment, {})
                lengths = {name: fitted[name] for name in LENGTHS if name in fitted}
                bones.append({"digit": digit.name, "bone": segment, **unknown, **lengths})
            continue
        mode = metacarpal_mode(chain, layout, model)
        measured = digit_bones(chain, mode, joints, layout, calibration)
        if mode != "none":
            metacarpals.append(MetacarpalBone(chain, mode, measured[0]))
        if fitted_bones is not None:
            measured = [with_fitted_lengths(bone, fitted_bones.get(bone.segment)) for bone in measured]
        bones += [{"digit": digit.name, **bone.row()} for bone in measured]
    return BuiltHand(list(joints.values()), bones, metacarpals)


def pose_metacarpals(
    hand: BuiltHand,
    layout: Layout,
    model: SkeletonModel,
    recording: PosesReader,
    fitted: Callable[[str, Index], Array | None] | None = None,
) -> Iterator[dict[str, Any]]:
    """Columns of metacarpals by digit and block; fitted : quaternions (T, 4) of a segment at frames."""
    for metacarpal in hand.metacarpals:
        neutral = neutral_posture(metacarpal, layout, model, recording)
        for poses in recording(metacarpal.chain.digit.base, *metacarpal.chain.receivers):
            posed = None if fitted is None else fitted(metacarpal.bone.segment, poses.frame)
            columns = metacarpal_columns(metacarpal, layout, model, poses, neutral, posed)
            yield {"digit": metacarpal.chain.digit.name, **columns}


def merge_fitted(
    fitted_rows: Sequence[Mapping[str, Any]], projected_rows: Sequence[Mapping[str, Any]]
) -> list[Row]:
    """Rows of joint_centres: each projected joint as the fit has it, where it does, then the fit's others."""
    fitted = {row["joint"]: dict(row) for row in fitted_rows}
    projected = {row["joint"]: dict(row) for row in projected_rows}
    merged = [
        {**fitted[joint], **{name: row[name] for name in _OF_JOINT_ALONE}} if joint in fitted else row
        for joint, row in projected.items()
    ]
    return [*merged, *(row for joint, row in fitted.items() if joint not in projected)]


def failed_joints(projected_rows: Sequence[Mapping[str, Any]], message: str) -> list[Row]:
    """Rows of joint_centres of a hand whose fit failed: the projected joints without numbers."""
    failed = {"source": "fit of the whole hand", **UNJUDGED, "status": "failed", "message": message}
    return [{name: row[name] for name in _KEPT_OF_FAILED} | failed for row in projected_rows]


def judged(hand: BuiltHand, layout: Layout, suspicion: Doubts) -> BuiltHand:
    """The hand with the verdict on every joint and bone; suspicion : of a suspect recording, or empty."""
    wanted_mm = layout.wanted_mm
    close = knuckles_too_close({row["joint"]: row for row in hand.joints}, layout)
    joints = {
        row["joint"]: judged_joint(row, wanted_mm, {**suspicion, **close.get(row["joint"], {})})
        for row in hand.joints
    }
    bones = [judged_bone(bone, joints, wanted_mm, is_whole=is_whole(bone, layout)) for bone in hand.bones]
    return replace(hand, joints=[*joints.values()], bones=bones)


def knuckles_too_close(joints: Mapping[str, Row], layout: Layout) -> dict[str, Doubts]:
    """The doubt, by joint, of neighbouring MCP centres that are nearer to each other than any hand's."""
    knuckles = [digit.joints[1] for digit in layout.digits.values() if layout.is_hand and digit.joints[1:]]
    doubts: dict[str, Doubts] = {}
    for pair in pairwise(joint for joint in knuckles if joint in joints):
        first, second = (
            np.array([joints[joint].get(f"parent_{axis}_mm") for axis in "xyz"], float) for joint in pair
        )
        apart_mm = float(np.linalg.norm(first - second))
        receivers = {layout.joints[joint].parent_receiver for joint in pair}
        if len(receivers) == 1 and apart_mm < LEAST_KNUCKLES_MM:
            doubts |= {joint: {TOO_CLOSE: {"joints": [*pair], "mm": apart_mm}} for joint in pair}
    return doubts


def is_whole(bone: Mapping[str, Any], layout: Layout) -> bool:
    """Whether a row of bone_lengths is of the bone itself: not one from the wrist, or to a receiver."""
    joint_of = {joint.child: name for name, joint in layout.joints.items()}
    return bool(bone["starts_at"] == joint_of.get(bone["bone"]) and bone["ends_at"] != DISTAL_RECEIVER)
