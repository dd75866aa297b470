"""One recording's tips and tip errors, digit by digit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Array
from kinematics.skeleton import DigitChain, Rows, digit_chain
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, RecordingName, read_poses, recording_name
from stages.evaluate_tips.replay import (
    error_statistics,
    replay_first_frame,
    replay_least_squares,
    tip_error_mm,
)

BINDINGS = ("first-frame", "least-squares")


@dataclass(frozen=True)
class Skeleton:
    """One hand under one model: its tables' rows, ready to be replayed.

    joints : joint_centres by joint; bones : bone_lengths by digit and segment; metacarpals : per (task,
    trial, digit) the quaternions (T, 4), NaN in gaps.
    """

    layout: Layout
    model: SkeletonModel
    joints: Rows
    bones: Mapping[str, Mapping[str, Mapping[str, Any]]]
    metacarpals: Mapping[tuple[str, str, str], Array]


def evaluate_recording(
    path: Path, skeleton: Skeleton, *, held_out: bool
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Give the recording's column blocks of tips and its rows of tip_errors.

    A digit that cannot be replayed, or a recording that cannot be read, has rows without numbers that
    say why.
    """
    name = recording_name(path)
    words = {
        "subject": name.subject,
        "hand": name.hand,
        "task": name.task,
        "trial": name.trial,
        "model": skeleton.model.name,
    }
    common = words | {"held_out": held_out, "n_frames": 0, "n_frames_total": 0, "message": ""}
    try:
        poses = read_poses(path, skeleton.layout.measured)
    except InputError as error:
        return [], _unavailable(common, tuple(skeleton.layout.digits), str(error))
    common["n_frames_total"] = len(poses.frame)
    blocks: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    for digit in skeleton.layout.digits.values():
        chain = digit_chain(digit, skeleton.layout, skeleton.model, skeleton.joints)
        if isinstance(chain, str):
            rows += _unavailable(common, (digit.name,), chain)
            continue
        block, errors = _replay(chain, skeleton, poses, name)
        blocks.append(words | {"digit": digit.name} | block)
        rows += [
            common | {"digit": digit.name, "binding": binding, **_statistics(error_mm, chain)}
            for binding, error_mm in errors.items()
        ]
    return blocks, rows


def _replay(
    chain: DigitChain, skeleton: Skeleton, poses: Poses, name: RecordingName
) -> tuple[dict[str, Any], dict[str, Array]]:
    metacarpal = None
    if chain.digit.metacarpal:
        metacarpal = skeleton.metacarpals[name.task, name.trial, chain.digit.name]
    measured = skeleton.layout.segments[chain.digit.segments[0]].measured
    at_rest = not measured and skeleton.model.unmeasured == "rest"
    bound_first = replay_first_frame(chain, poses, metacarpal, at_rest=at_rest)
    tip = replay_least_squares(chain, skeleton.bones[chain.digit.name], poses, metacarpal)
    errors = dict(
        zip(BINDINGS, (tip_error_mm(found, chain, poses) for found in (bound_first, tip)), strict=True)
    )
    block = {
        "frame": poses.frame,
        "time_s": poses.time_s,
        **{f"tip_{axis}_mm": tip[:, index] for index, axis in enumerate("xyz")},
        "error_mm": errors["least-squares"],
        "error_first_frame_mm": errors["first-frame"],
    }
    return block, errors


def _statistics(error_mm: Array, chain: DigitChain) -> dict[str, Any]:
    found = error_statistics(error_mm)
    if not found["n_frames"]:
        receivers = ", ".join((chain.digit.base, *chain.receivers))
        found["message"] = f"no frame in which all of {receivers} are valid"
    return found


def _unavailable(common: Mapping[str, Any], digits: tuple[str, ...], reason: str) -> list[dict[str, Any]]:
    return [
        {**common, "digit": digit, "binding": binding, "message": reason}
        for digit in digits
        for binding in BINDINGS
    ]


def metacarpals_by_recording(columns: Mapping[str, Any]) -> dict[tuple[str, str, str], Array]:
    """Split the columns of a metacarpals table into quaternions (T, 4) per task, trial and digit.

    The table is written block by block, so each block is found by where its names change.
    """
    names = [np.asarray(columns[key], dtype=object) for key in ("task", "trial", "digit")]
    quaternion = np.stack([columns[f"q{part}"] for part in "wxyz"], -1)
    if not len(quaternion):
        return {}
    changes = np.zeros(len(quaternion), bool)
    changes[0] = True
    for name in names:
        changes[1:] |= name[1:] != name[:-1]
    starts = np.flatnonzero(changes)
    ends = [*starts[1:], len(quaternion)]
    return {
        (str(names[0][a]), str(names[1][a]), str(names[2][a])): quaternion[a:b]
        for a, b in zip(starts, ends, strict=True)
    }
