"""One hand put together: its wrist point, its bones, and its metacarpals over every recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinematics.recordings import BLOCK_FRAMES, Recordings
from kinematics.skeleton import Rows, digit_chain
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, recording_name
from schemas.table_rows import constant
from stages.estimate_metacarpals.bones import as_fitted, digit_bones, metacarpal_mode
from stages.estimate_metacarpals.fitted import Fitted
from stages.estimate_metacarpals.recording import Placed, metacarpal_blocks
from stages.estimate_metacarpals.wrist_row import wrist_row


@dataclass(frozen=True)
class BuiltHand:
    """Rows of joint_centres and bone_lengths, and the digits whose metacarpal is posed."""

    joints: list[dict[str, Any]]
    bones: list[dict[str, Any]]
    metacarpals: list[Placed]
    fitted: Fitted | None


def build_hand(
    rows: Rows,
    layout: Layout,
    model: SkeletonModel,
    calibration: Iterable[Poses],
    fitted: Fitted | None = None,
) -> BuiltHand:
    """Add the wrist point to a hand's joints and measure its bones.

    rows : joint_centres of one hand and model, by joint. calibration : poses in blocks of frames, which are
    gone through more than once. fitted : of a model that fits the whole hand. A
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
            posed.append(Placed(chain, mode, found[0]))
    return BuiltHand(list(joints.values()), bones, posed, fitted)


def pose_metacarpals(
    built: BuiltHand,
    layout: Layout,
    model: SkeletonModel,
    recordings: Sequence[Path],
    block_frames: int = BLOCK_FRAMES,
) -> Iterator[dict[str, Any]]:
    """Give the columns of the metacarpals table: recording by recording, digit by digit, in blocks."""
    for path in recordings:
        name, recording = recording_name(path), Recordings([path], layout.measured, block_frames)
        words = {"subject": name.subject, "hand": name.hand, "task": name.task, "trial": name.trial}
        for placed in built.metacarpals:
            fitted = None
            if placed.mode == "fitted":
                assert built.fitted is not None, "a model with fitted metacarpals fits the hand"
                fitted = built.fitted.poses.of(name.task, name.trial, placed.bone.segment)
            of_digit = words | {"model": model.name, "digit": placed.chain.digit.name}
            for block in metacarpal_blocks(placed, layout, model, recording, fitted):
                count = len(block["frame"])
                yield {key: constant(word, count) for key, word in of_digit.items()} | block
