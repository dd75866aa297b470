"""One recording of a hand under a skeleton model, whichever, as the tables of its subject have it.

All that shows, measures or exports a hand in motion reads it here: receivers and bones block by block, and
the numbers of every table that has rows frame by frame (joint angles, tips, errors), at the frames asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError, joined
from shukotsu.schemas.catalogue import (
    BONE_LENGTHS,
    BONE_POSES,
    JOINT_CENTRES,
    METACARPALS,
    MOVED_RECEIVERS,
    POSED_TIPS,
)
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.parts import Part, open_parts, read_part
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import Poses, frame_count, pose_blocks, read_every
from shukotsu.schemas.results import FIT_TABLES
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import Table, rows_of
from shukotsu.skeleton.posing import BoneMotion, PosedBones, Skeleton, pose_bones
from shukotsu.skeleton.rotations import Array

Index = npt.NDArray[np.int64]

BLOCK_FRAMES = 1 << 14
"""Frames that are posed at a time."""

QUATERNION = ("qw", "qx", "qy", "qz")


@dataclass(frozen=True)
class SkeletonTables:
    """Files of the tables that a hand's skeleton and its motion under a model are in.

    Those of a fit are there only where the model fits the whole hand.
    """

    joint_centres: Path
    bone_lengths: Path
    metacarpals: Path
    tips: Path
    bone_poses: Path
    posed_tips: Path
    joint_angles: Path
    moved_receivers: Path

    @classmethod
    def in_folders(cls, subject: Path, fit: Path) -> SkeletonTables:
        """Files of a subject's folder and of the folder of a fit in it."""
        names = [field.name for field in fields(cls)]
        return cls(**{own: (fit if own in FIT_TABLES else subject) / f"{own}.parquet" for own in names})

    def path(self, table: Table) -> Path:
        """The file of a table."""
        return Path(getattr(self, table.name))


def read_skeleton(
    joint_centres: Path, bone_lengths: Path, layout: Layout, model: SkeletonModel, part: Part
) -> Skeleton:
    """Read one hand under one model. Raises InputError where a table is absent or its making failed."""
    joints, bones = (
        list(rows_of(read_part(path, table, part)))
        for path, table in ((joint_centres, JOINT_CENTRES), (bone_lengths, BONE_LENGTHS))
    )
    return Skeleton(
        layout,
        model,
        {row["joint"]: row for row in joints},
        {(row["digit"], row["bone"]): row for row in bones},
    )


@dataclass(frozen=True)
class PosedRecording:
    """A recording of a hand and where to read it under one model.

    poses_file : the recording's poses table. part : whose rows of the tables. What it reads raises InputError
    where a table is absent or its making failed, and where it has no row of the recording.
    """

    recording: Recording
    layout: Layout
    model: SkeletonModel
    part: Part
    poses_file: Path
    tables: SkeletonTables

    @property
    def is_fitted(self) -> bool:
        """Return whether the model fits the whole hand, so that tables have its bones' poses."""
        return self.model.fitting is not None

    @cached_property
    def skeleton(self) -> Skeleton:
        """Joints and bones."""
        tables = self.tables
        return read_skeleton(tables.joint_centres, tables.bone_lengths, self.layout, self.model, self.part)

    @cached_property
    def moved(self) -> list[Mapping[str, Any]]:
        """Rows of moved_receivers of the recording: what sits elsewhere in it than in the calibration."""
        if not self.is_fitted:
            return []
        rows = rows_of(read_part(self.tables.moved_receivers, MOVED_RECEIVERS, self.part))
        return [
            row for row in rows if (row["task"], row["trial"]) == (self.recording.task, self.recording.trial)
        ]

    def unbelieved(self, column: str, name: str) -> str:
        """Why a joint (column joints) or a digit's tip (digits) is not believed here; empty where it is."""
        rows = [row for row in self.moved if name in row[column].split(";")]
        return joined(f"{row['segment']}: {row['message']}" for row in rows)

    @cached_property
    def n_frames(self) -> int:
        """Number of frames of the recording."""
        return frame_count(self.poses_file)

    def poses(self, every: int = 1) -> Poses:
        """Read the receivers' poses, of all frames or one in `every`."""
        return read_every(self.poses_file, self.layout.measured, every)

    def pose_blocks(self) -> Iterator[Poses]:
        """Read the receivers' poses so many frames at a time, at least one block, which may be empty."""
        return pose_blocks(self.poses_file, self.layout.measured, BLOCK_FRAMES)

    def blocks(self) -> Iterator[tuple[Poses, PosedBones]]:
        """Read receivers and bones so many frames at a time."""
        for poses in self.pose_blocks():
            yield poses, self.bones(poses)

    def bones(self, poses: Poses) -> PosedBones:
        """Pose all bones at the frames of the recording's poses, or of some of them."""
        return pose_bones(self.skeleton, poses, self.bone_motion(poses))

    def numbers(
        self, table: Table, columns: Sequence[str], frames: Index | None = None, name: str = ""
    ) -> dict[str, Array]:
        """Read columns (T, C) of a frame-by-frame table, by its segments, digits or joints.

        frames : at which, rising, NaN where the table has no row; None for all, of which each must have one.
        name : of one segment, digit or joint alone. Gives nothing where there is no row of the recording.
        """
        by = next(own for own in ("segment", "joint", "digit") if own in table.key)
        own = self.recording
        count = self.n_frames if frames is None else None
        with open_parts(self.tables.path(table), table) as parts:
            return parts.recording(self.part, own.task, own.trial, by, columns, count, frames, name)

    def series(self, table: Table, columns: Sequence[str]) -> dict[str, Callable[[], Array]]:
        """Return readers of columns (T, C) of one segment, digit or joint each, as `numbers` of all frames.

        Raises InputError where the table has no row of the recording.
        """
        names = self.numbers(table, (), next(self.pose_blocks()).frame[:1])
        if not names:
            raise InputError(f"the {table.name} table has no row of this recording")
        return {name: partial(self._one, table, columns, name) for name in names}

    def _one(self, table: Table, columns: Sequence[str], name: str) -> Array:
        return self.numbers(table, columns, name=name)[name]

    def bone_motion(self, poses: Poses) -> BoneMotion:
        """Read what moves the bones beside the receivers, at the frames of poses."""
        if self.is_fitted:
            bones = self._posed(BONE_POSES, ("x_mm", "y_mm", "z_mm", *QUATERNION), poses)
            ends = self._posed(
                POSED_TIPS, [f"{end}_{axis}_mm" for end in ("tip", "skin_tip") for axis in "xyz"], poses
            )
            tips, skin_tips = ({digit: end[:, own] for digit, end in ends.items()} for own in _ENDS)
            return BoneMotion(bone_poses=bones, tips=tips, skin_tips=skin_tips)
        if not any(digit.metacarpal for digit in self.layout.digits.values()):
            return BoneMotion()
        return BoneMotion(metacarpals=self._posed(METACARPALS, QUATERNION, poses))

    def _posed(self, table: Table, columns: Sequence[str], poses: Poses) -> dict[str, Array]:
        found = self.numbers(table, columns, poses.frame)
        if len(poses.frame) and not found:
            why = "nothing of it could be posed; the study's table of problems says why"
            if self.recording.role == "calibration":
                why = "only recordings of role evaluation or both are posed; give it one of these roles"
            raise InputError(f"{self.tables.path(table)}: has no row of {self.recording.name}; {why}")
        return found


_ENDS = (slice(0, 3), slice(3, 6))
"""Columns of the ends of a bone and of the skin."""


def posed_recording(plan: SubjectPlan, recording: Recording, model: str) -> PosedRecording:
    """Return a recording of a plan under one of its models."""
    hand = recording.hand.hand
    return PosedRecording(
        recording,
        plan.layouts[hand],
        plan.models[model],
        plan.part(hand, model),
        plan.poses(recording),
        SkeletonTables.in_folders(plan.folder, plan.fits(hand, model)),
    )
