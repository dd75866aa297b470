"""Poses of a skeleton's bones in a recording, read from the tables of its subject."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, POSED_TIPS
from schemas.errors import InputError
from schemas.parts import read_part, read_recording
from schemas.plan import SubjectPlan
from schemas.poses import Poses
from schemas.study import Recording
from schemas.tables import Table, rows_of
from skeleton.posing import Motion, PosedBones, Skeleton, pose_bones
from skeleton.rotations import Array

_QUATERNION = ("qw", "qx", "qy", "qz")


def posed_bones(
    plan: SubjectPlan, recording: Recording, model_name: str, poses: Poses, made_without: str = ""
) -> PosedBones:
    """Poses of all bones of a subject's hand under a model, over the frames of one of its recordings.

    poses : of the recording, whole or some of its frames. made_without : the task that the skeleton was made
    without. Raises InputError where a table is absent or its making failed, and where it has no row of the
    recording.
    """
    skeleton = read_skeleton(plan, recording.hand.hand, model_name, made_without)
    return pose_bones(skeleton, poses, read_motion(plan, recording, model_name, poses.frame, made_without))


def read_skeleton(plan: SubjectPlan, hand: str, model_name: str, made_without: str = "") -> Skeleton:
    """One hand under one model. Raises InputError where a table is absent or its making failed."""
    part = plan.part(hand, model_name, made_without)
    joints, bones = (
        list(rows_of(read_part(plan.table(table.name), table, part)))
        for table in (JOINT_CENTRES, BONE_LENGTHS)
    )
    return Skeleton(
        plan.layouts[hand],
        plan.models[model_name],
        {row["joint"]: row for row in joints},
        {(row["digit"], row["bone"]): row for row in bones},
    )


def read_motion(
    plan: SubjectPlan,
    recording: Recording,
    model_name: str,
    frame: npt.NDArray[np.int64],
    made_without: str = "",
) -> Motion:
    """What moves a skeleton's bones beside the receivers, at those frames (T,); NaN where a table has no row.

    Raises InputError where a table is absent or its making failed, and where it has no row of the recording.
    """
    hand = recording.hand.hand
    part = plan.part(hand, model_name, made_without)
    ends = (int(frame.min()), int(frame.max())) if len(frame) else None

    def series(path: Path, table: Table, by: str, columns: Sequence[str]) -> dict[str, Array]:
        named = (recording.task, recording.trial, by, ["frame", *columns])
        found = read_recording(path, table, part, *named, between=ends)
        if len(frame) and not found:
            raise InputError(
                f"{path}: has no row of {recording.name}; only recordings of role evaluation or both are "
                "posed, so give it one of these roles in the recordings sheet and run the study again"
            )
        return {name: _at_frames(rows, frame) for name, rows in found.items()}

    if plan.models[model_name].fitting is not None:
        bones, tips = (plan.fit_table(hand, model_name, table.name) for table in (BONE_POSES, POSED_TIPS))
        prefixes = ("tip", "skin_tip")
        both = series(tips, POSED_TIPS, "digit", [f"{p}_{axis}_mm" for p in prefixes for axis in "xyz"])
        return Motion(
            bone_poses=series(bones, BONE_POSES, "segment", ("x_mm", "y_mm", "z_mm", *_QUATERNION)),
            tips={digit: ends[:, :3] for digit, ends in both.items()},
            skin_tips={digit: ends[:, 3:] for digit, ends in both.items()},
        )
    if not any(digit.metacarpal for digit in plan.layouts[hand].digits.values()):
        return Motion()
    return Motion(metacarpals=series(plan.table(METACARPALS.name), METACARPALS, "digit", _QUATERNION))


def _at_frames(rows: Array, frame: npt.NDArray[np.int64]) -> Array:
    """Columns (T, C) at those frames, of rows (N, 1 + C) that begin with theirs; NaN where there is none."""
    if len(rows) == len(frame) and (rows[:, 0] == frame).all():
        return rows[:, 1:]
    out = np.full((len(frame), rows.shape[1] - 1), np.nan)
    _, here, there = np.intersect1d(frame, rows[:, 0], return_indices=True)
    out[here] = rows[there, 1:]
    return out
