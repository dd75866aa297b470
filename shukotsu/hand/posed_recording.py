"""Reader of a hand's recording under any skeleton model, from the tables of its subject.

Display, measurement and export of a moving hand all use it. It reads receivers and bones block by block, and
the columns of every frame-by-frame table (joint angles, tips, errors) at requested frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from shukotsu.arrays import Array, Index
from shukotsu.errors import InputError, TableError, join_reasons
from shukotsu.hand.measured import not_measured_text, not_worn
from shukotsu.hand.posing import Origin, PosedRecording, Skeleton, fitted_bones, receiver_bones
from shukotsu.study.findings import moved_finding
from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import (
    BONE_LENGTHS,
    BONE_POSES,
    JOINT_CENTRES,
    METACARPALS,
    MOVED_RECEIVERS,
    POSED_TIPS,
)
from shukotsu.tables.parts import Opened, Part, open_parts, read_part
from shukotsu.tables.poses import Poses, RecordingName, frame_count, pose_blocks, read_every, seen_segments
from shukotsu.tables.typed_table import Table, rows_of

BLOCK_FRAMES = 1 << 14
"""Number of frames that are posed at a time."""

QUATERNION = ("qw", "qx", "qy", "qz")

T = TypeVar("T")


def part_rows(tables: Callable[[str], Path], opened: Opened, table: Table, part: Part) -> list[Any]:
    """Read a part's rows of a short table; tables, opened : as in `RecordingReader`."""
    with opened(tables(table.name), table) as parts:
        return parts.rows(part)


def read_skeleton(
    tables: Callable[[str], Path], opened: Opened, layout: Layout, model: SkeletonModel, part: Part
) -> Skeleton:
    """Read one hand's skeleton under one model.

    Parameters
    ----------
    tables, opened : callable
        As in `RecordingReader`.
    layout, model : Layout, SkeletonModel
        Layout of the hand, and skeleton model.
    part : Part
        Hand, model, and the task left out.

    Returns
    -------
    Skeleton
        Joints and bones.

    Raises
    ------
    InputError
        If a table does not exist or contains only the reason why it could not be made.

    """
    joints, bones = (part_rows(tables, opened, table, part) for table in (JOINT_CENTRES, BONE_LENGTHS))
    by_bone = {(row["digit"], row["bone"]): row for row in bones}
    return Skeleton(layout, model, {row["joint"]: row for row in joints}, by_bone)


@dataclass(frozen=True)
class RecordingReader:
    """Reader of one recording of a hand under one model.

    Its methods raise InputError if a table does not exist, contains only the reason why it could not be made,
    or has no row of the recording.

    Attributes
    ----------
    recording : Recording
        The recording.
    layout, model : Layout, SkeletonModel
        Layout of the hand, and skeleton model.
    part : Part
        Keys of the rows to read: hand, model, and the task left out.
    poses_file : Path
        The recording's poses table.
    tables : callable
        Name of a table -> its file.
    opened : callable
        Opens a table.

    """

    recording: Recording
    layout: Layout
    model: SkeletonModel
    part: Part
    poses_file: Path
    tables: Callable[[str], Path]
    opened: Opened = open_parts

    @property
    def is_fitted(self) -> bool:
        """Whether the model fits the whole hand, so that a table has its bones' poses."""
        return self.model.fitting is not None

    @cached_property
    def skeleton(self) -> Skeleton:
        """Joints and bones of the hand."""
        return read_skeleton(self.tables, self.opened, self.layout, self.model, self.part)

    @cached_property
    def moved(self) -> list[Any]:
        """Rows of moved_receivers: receivers displaced in this recording relative to the calibration."""
        if not self.is_fitted:
            return []
        rows = rows_of(read_part(self.tables(MOVED_RECEIVERS.name), MOVED_RECEIVERS, self.part))
        key = self.recording.task, self.recording.trial
        return [row for row in rows if (row["task"], row["trial"]) == key]

    def unbelieved(self, column: str, name: str) -> str:
        """Return why a joint (column joints) or a digit's tip (digits) is not believed; empty if it is."""
        rows = [row for row in self.moved if name in row[column].split(";")]
        return join_reasons(moved_finding(row).message for row in rows)

    @cached_property
    def seen(self) -> set[str]:
        """Segments whose receivers have a pose in at least one frame."""
        return seen_segments(self.poses_file)

    def unmeasured(self, joint: str) -> str:
        """Return why no frame of the recording can measure a joint; empty if one may."""
        lacking = not_worn(self.layout, joint, self.seen)
        return not_measured_text(lacking) if lacking else ""

    @cached_property
    def n_frames(self) -> int:
        """Number of frames of the recording."""
        return frame_count(self.poses_file)

    def poses(self, every: int = 1) -> Poses:
        """Read the receivers' poses.

        Parameters
        ----------
        every : int
            Read every n-th frame; 1 for all.

        Returns
        -------
        Poses
            Poses of the layout's measured segments.

        Raises
        ------
        InputError
            If the poses table does not exist or contains only the reason why it could not be made.

        """
        return read_every(self.poses_file, self.layout.measured, every)

    def pose_blocks(self) -> Iterator[Poses]:
        """Read the receivers' poses in blocks of frames; there is at least one block, which may be empty."""
        if self.n_frames <= BLOCK_FRAMES:
            return iter((self.poses(),))
        return pose_blocks(self.poses_file, self.layout.measured, BLOCK_FRAMES)

    def bones(self, poses: Poses, skeleton: Skeleton | None = None) -> PosedRecording:
        """Pose all bones in some or all frames of the recording.

        Digits with a failed joint, or that the fit does not pose, are left out.

        Parameters
        ----------
        poses : Poses
            T frames of the recording.
        skeleton : Skeleton, optional
            The skeleton, if it was read already.

        Returns
        -------
        PosedRecording
            Bones in the transmitter frame.

        Raises
        ------
        InputError
            If a table does not exist, could not be made, or has no row of the recording.

        """
        skeleton = skeleton or self.skeleton
        if self.is_fitted:
            bone_poses = self._posed(BONE_POSES, ("x_mm", "y_mm", "z_mm", *QUATERNION), poses)
            columns = [f"{end}_{axis}_mm" for end in ("tip", "skin_tip") for axis in "xyz"]
            posed = fitted_bones(skeleton, poses, bone_poses, self._posed(POSED_TIPS, columns, poses))
        else:
            turned = any(digit.metacarpal for digit in self.layout.digits.values())
            metacarpals = self._posed(METACARPALS, QUATERNION, poses) if turned else {}
            posed = receiver_bones(skeleton, poses, metacarpals)
        origin = Origin(RecordingName(**self.recording.key), self.model.name, self.layout.name)
        return replace(posed, origin=origin)

    def numbers(
        self,
        table: Table,
        columns: Sequence[str],
        frames: Index | None = None,
        name: str = "",
        *,
        every: bool = True,
    ) -> dict[str, Array]:
        """Read columns of a frame-by-frame table, by its segments, digits or joints.

        Parameters
        ----------
        table : Table
            The table.
        columns : sequence of str
            Names of C columns.
        frames : array of int, shape (T,), optional
            Ascending frame numbers to read; all frames if omitted.
        name : str
            Segment, digit or joint to read; all if empty.
        every : bool
            Whether, without `frames`, each frame must have a row.

        Returns
        -------
        dict
            Segment, digit or joint -> array (T, C), NaN for frames without a row; empty if the table has no
            row of the recording.

        Raises
        ------
        InputError
            If the table does not exist or could not be made.

        """
        key = self.part, self.recording.task, self.recording.trial
        count = self.n_frames if frames is None and every else None
        with self.opened(self.tables(table.name), table) as parts:
            return parts.recording(*key, columns, count, frames, name)

    def numbers_at(self, table: Table, columns: Sequence[str], frames: Index) -> dict[str, Array]:
        """Return `numbers` at frames; raise InputError if the table has no row of the recording."""
        if numbers := self.numbers(table, columns, frames):
            return numbers
        raise InputError(f"the {table.name} table has no row of this recording")

    def series(self, table: Table, columns: Sequence[str]) -> dict[str, Callable[[], Array]]:
        """Return a function for each segment, digit or joint that reads its columns (T, C) in all frames.

        Raise InputError if the table has no row of the recording.
        """
        names = self.numbers_at(table, (), next(self.pose_blocks()).frame[:1])

        def read(name: str) -> Array:
            return self.numbers(table, columns, name=name)[name]

        return {name: partial(read, name) for name in names}

    def _posed(self, table: Table, columns: Sequence[str], poses: Poses) -> dict[str, Array]:
        numbers = self.numbers(table, columns, poses.frame)
        if len(poses.frame) and not numbers:
            raise InputError(
                f"{self.tables(table.name)}: has no row of {self.recording.name}; no frame of it could be "
                "posed; the study's table of problems states why"
            )
        return numbers


def readable(read: Callable[[], T], reasons: list[str]) -> T | None:
    """Return the result of `read`; if it raises InputError, append the message to `reasons` and return None.

    TableError is passed on.
    """
    try:
        return read()
    except TableError:
        raise
    except InputError as error:
        reasons.append(error.message)
        return None


def recording_reader(
    plan: SubjectPlan, recording: Recording, model: str, opened: Opened = open_parts
) -> RecordingReader:
    """Return the reader of a plan's recording under one of its models."""
    hand = recording.hand.hand
    tables = partial(plan.table, hand=hand, model=model)
    of_hand = recording, plan.layouts[hand], plan.models[model]
    return RecordingReader(*of_hand, plan.part(hand, model), plan.poses(recording), tables, opened)
