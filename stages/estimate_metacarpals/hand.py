"""One hand put together: its wrist point, its bones, and its metacarpals over every recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.skeleton import DigitChain, Rows, digit_chain
from schemas.catalogue import METACARPALS
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, read_poses, recording_name
from stages.estimate_metacarpals.bones import Bone, as_fitted, digit_bones, metacarpal_mode
from stages.estimate_metacarpals.fitted import Fitted
from stages.estimate_metacarpals.recording import metacarpal_columns
from stages.estimate_metacarpals.wrist_row import wrist_row


@dataclass(frozen=True)
class BuiltHand:
    """Rows of joint_centres and bone_lengths, and the digits whose metacarpal is posed."""

    joints: list[dict[str, Any]]
    bones: list[dict[str, Any]]
    metacarpals: list[tuple[DigitChain, str, Bone]]
    fitted: Fitted | None


def build_hand(
    rows: Rows,
    layout: Layout,
    model: SkeletonModel,
    calibration: Sequence[Poses],
    fitted: Fitted | None = None,
) -> BuiltHand:
    """Add the wrist point to a hand's joints and measure its bones.

    rows : joint_centres of one hand and model, by joint. fitted : of a model that fits the whole hand. A
    digit with a failed joint has bones without lengths that say so.
    """
    joints = {name: dict(row) for name, row in rows.items()}
    wrist = wrist_row(rows, layout, model, calibration)
    if wrist is not None:
        joints[wrist["joint"]] = {"covariance_mm2": None} | wrist
    bones: list[dict[str, Any]] = []
    posed = []
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, model, joints)
        if isinstance(chain, str):
            bones += [
                {"digit": digit.name, "bone": segment, "driven_by": "", "message": chain}
                for segment in digit.segments
            ]
            continue
        mode = metacarpal_mode(chain, layout, model)
        found = digit_bones(chain, mode, joints, layout, calibration)
        if fitted is not None:
            found = [
                as_fitted(bone, fitted.bones.get(bone.segment), last=bone is found[-1]) for bone in found
            ]
        bones += [{"digit": digit.name, **bone.row()} for bone in found]
        if mode != "none":
            posed.append((chain, mode, found[0]))
    return BuiltHand(list(joints.values()), bones, posed, fitted)


def pose_metacarpals(
    built: BuiltHand, layout: Layout, model: SkeletonModel, recordings: Sequence[Path]
) -> dict[str, Any]:
    """Give the columns of the metacarpals table over all recordings."""
    parts = []
    for path in recordings:
        name, poses = recording_name(path), read_poses(path, layout.measured)
        n = len(poses.frame)
        words = {"subject": name.subject, "hand": name.hand, "task": name.task, "trial": name.trial}
        for chain, mode, bone in built.metacarpals:
            constant = words | {"model": model.name, "digit": chain.digit.name}
            posture = None
            if mode == "fitted":
                assert built.fitted is not None, "a model with fitted metacarpals fits the hand"
                posture = built.fitted.metacarpal(name.task, name.trial, bone.segment)
            parts.append(
                {key: np.full(n, value) for key, value in constant.items()}
                | metacarpal_columns(chain, mode, bone, layout, model, poses, posture)
            )
    names = [column.name for column in METACARPALS.columns]
    return {name: np.concatenate([part[name] for part in parts]) if parts else [] for name in names}
