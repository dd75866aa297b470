"""Results for notebooks: tables as data frames, posed hands of recordings, and hands bent to joint angles.

Tables of a study are found by name, over all subjects, with the study's factors as columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.errors import InputError, TableError, count_of, guess, list_names
from shukotsu.hand.joint_angles import joint_rotation
from shukotsu.hand.neutral_bones import angle_axes, at_rest
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import Array, multiply, rotate
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import plan_of_results, read_plan
from shukotsu.study.results import FIT_TABLES, SUBJECT_TABLES, Results
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import read_metadata, read_table

if TYPE_CHECKING:
    import pandas as pd

WHOSE = ["subject", "session"]
WHICH = [*WHOSE, "hand", "task", "trial"]

Angles = float | Sequence[float] | Array
"""Angles of a joint, deg: flexion alone, the three angles (3,), or the three angles over time (T, 3)."""


def read_file(path: Path) -> pd.DataFrame:
    """Read any Parquet table of a study, with the same checks as in the stages.

    Parameters
    ----------
    path : Path
        A table's file.

    Returns
    -------
    pandas.DataFrame
        The table, with gaps as pandas' missing values; integer and boolean columns that may have gaps have
        pandas' nullable types. `attrs` has `table` (its name), `key` (the columns that identify a row),
        `units` and `descriptions` by column.

    Raises
    ------
    InputError
        If the file does not exist, is damaged, was written by another program or version, or contains only
        the reason why it could not be made.

    """
    import pandas as pd
    import pyarrow as pa

    name = read_metadata(path)["schema"]
    if name not in TABLES:
        raise TableError(f"{path}: is a {name} table, which this program does not know; make it again")
    table = TABLES[name]
    data = read_table(path, table)
    frame = data.to_pandas()
    nullable = {pa.bool_(): pd.BooleanDtype(), pa.int8(): pd.Int8Dtype(), pa.int64(): pd.Int64Dtype()}
    for column in table.columns:
        if column.nullable and column.type in nullable:
            frame[column.name] = data.column(column.name).to_pandas(types_mapper=nullable.get)
    frame.attrs = {
        "table": name,
        "key": list(table.key),
        "units": {column.name: column.unit for column in table.columns},
        "descriptions": {column.name: column.description for column in table.columns},
    }
    return frame


class StudyTables(Mapping[str, "pd.DataFrame"]):
    """A study's tables by name, each read on access.

    A table has the rows of all subjects and a column for each of the study's factors. Rows of skeletons that
    were made without a task are left out. Files that could not be made are in `attrs["left_out"]`, with the
    reason.
    """

    def __init__(self, folder: Path) -> None:
        plans = [read_plan(path) for path in sorted(folder.glob("sub-*/plan.json"))]
        if not plans:
            raise InputError(f"{folder}: has no results of a study; expected a folder such as results/demo")
        self.folder = folder
        self._people = [plan.who._asdict() | dict(plan.factors) for plan in plans]
        self._recordings = [
            recording.key | dict(plan.factors) | dict(recording.factors)
            for plan in plans
            for recording in plan.recordings
        ]

    def __iter__(self) -> Iterator[str]:
        return (name for name in TABLES if self._files(name))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __getitem__(self, name: str) -> pd.DataFrame:
        import pandas as pd

        files = self._files(name) if name in TABLES else []
        if not files:
            raise InputError(f"{self.folder}: has no table {name!r}; {guess(name, list(self))}")
        frames, left_out = [], {}
        for path in files:
            try:
                frames.append(read_file(path))
            except TableError:
                raise
            except InputError as error:
                left_out[str(path)] = error.message
        if not frames:
            raise InputError(next(iter(left_out.values())))
        frame = pd.concat([each for each in frames if len(each)] or frames[:1], ignore_index=True)
        if "made_without" in frame:
            frame = frame[frame["made_without"] == ""].reset_index(drop=True)
        attributes = frames[0].attrs | {"left_out": left_out}
        on, rows = (WHICH, self._recordings) if set(WHICH) <= set(frame) else (WHOSE, self._people)
        if set(on) <= set(frame):
            levels = pd.DataFrame(rows).drop_duplicates(on)
            new = [column for column in levels if column in on or column not in frame]
            frame = frame.merge(levels[new], how="left", on=on)
        frame.attrs = attributes
        return frame

    def _files(self, name: str) -> list[Path]:
        """Return the files of a table: the study-wide one if it exists, otherwise those of all subjects."""
        if (whole := self.folder / f"{name}.parquet").is_file():
            return [whole]
        if name in FIT_TABLES:
            return sorted(self.folder.glob(f"sub-*/fits/*/*/{name}.parquet"))
        return sorted(self.folder.glob(f"sub-*/{name}.parquet")) if name in SUBJECT_TABLES else []


def read(path: str | Path) -> Any:
    """Read a study's results: one table, or all tables of a study by name.

    Parameters
    ----------
    path : str or Path
        Any table of a study, or the study's folder, such as results/demo; it may have been moved.

    Returns
    -------
    pandas.DataFrame or StudyTables
        For a file, the table, with gaps as pandas' missing values; `attrs` has `table` (its name), `key` (the
        columns that identify a row), `units` and `descriptions` by column. For a folder, such tables by name.

    Raises
    ------
    InputError
        If the file or study does not exist, or the file is not a table of this program.

    """
    return StudyTables(Path(path)) if Path(path).is_dir() else read_file(Path(path))


def pose(
    results: str | Path,
    subject: str,
    hand: str,
    task: str,
    *,
    model: str = "whole-hand",
    trial: str = "",
    session: str = "",
) -> PosedRecording:
    """Read the posed bones of a hand in one of its recordings, from a study's results under a model.

    Parameters
    ----------
    results : str or Path
        The study's folder, such as results/demo; it may have been moved.
    subject, hand, task, trial, session : str
        The recording as the study names it; hand is right or left.
    model : str
        One of the study's models.

    Returns
    -------
    PosedRecording
        Joints and bones of every frame, in the transmitter frame.

    Raises
    ------
    InputError
        If the study has no such subject, recording or model, or a table does not exist or could not be made.

    """
    plan = plan_of_results(Results(Path(results)).plan(subject, session))
    recording = _recording(plan, hand, task, trial)
    if model not in plan.models:
        raise InputError(f"model {model!r} is not in study {plan.study}; {guess(model, list(plan.models))}")
    reader = recording_reader(plan, recording, model)
    return at_rest(reader.layout, reader.bones(reader.poses()))


def bend(posed: PosedRecording, angles_deg: Mapping[str, Angles]) -> PosedRecording:
    """Bend a hand to joint angles (docs/movement.md), in the frame of its root bone.

    Bones keep their lengths, and each digit starts at its mean position in the recording.

    Parameters
    ----------
    posed : PosedRecording
        The hand, as `pose` returns it.
    angles_deg : mapping of str to float, (3,) or (T, 3)
        By joint: flexion alone, or flexion, deviation and axial rotation, or these over time. All angles of
        other joints are zero.

    Returns
    -------
    PosedRecording
        The same hand over T frames, numbered from 0; time_s is NaN.

    Raises
    ------
    InputError
        If the hand lacks a joint, or two series differ in length.

    """
    turns = {posed.index(joint): _series(joint, angles) for joint, angles in angles_deg.items()}
    counts = {len(turn) for turn in turns.values()} - {1}
    if len(counts) > 1:
        raise InputError(
            f"angles over {' and '.join(count_of(n, 'frame') for n in sorted(counts))}; expected the same "
            "number for all joints"
        )
    count = max(counts, default=1)
    position = np.zeros((count, len(posed.joints), 3))
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (count, len(posed.joints), 1))
    neutral = np.where(np.isfinite(posed.neutral), posed.neutral, posed.rest)
    for index, (joint, parent) in enumerate(zip(posed.joints, posed.parents, strict=True)):
        if parent < 0:
            continue
        turn = neutral[index]
        if index in turns:
            turn = joint_rotation(turns[index], posed.hand, turn, angle_axes(joint, posed.hand))
        quaternion[:, index] = multiply(quaternion[:, parent], turn)
        position[:, index] = position[:, parent] + rotate(quaternion[:, parent], posed.rest_offset_mm[index])
    nothing = np.empty((count, 0, 3)), np.empty((count, 0, 4)), np.empty((count, 0), bool)
    receivers = Poses((), np.arange(count), np.full(count, np.nan), *nothing)
    return replace(posed, receivers=receivers, position_mm=position, quaternion=quaternion)


def _series(joint: str, angles_deg: Angles) -> Array:
    """Convert the angles of a joint to shape (T, 3), deg."""
    angles = np.asarray(angles_deg, float)
    if angles.ndim == 0:
        return np.array([[float(angles), 0.0, 0.0]])
    if angles.ndim > 2 or angles.shape[-1] != 3:
        raise InputError(
            f"{joint}: angles of shape {angles.shape}; expected flexion alone, three angles, or (frames, 3)"
        )
    return angles.reshape(-1, 3)


def _recording(plan: SubjectPlan, hand: str, task: str, trial: str) -> Recording:
    names = {each.key_in_session: each for each in plan.recordings}
    if recording := names.get((hand, task, trial)):
        if recording.exclude:
            raise InputError(f"{recording.name}: is excluded ({recording.exclude})")
        return recording
    there = [" ".join(filter(None, name)) for name in names]
    wanted = " ".join(filter(None, (hand, task, trial)))
    raise InputError(
        f"subject {plan.who.subject} has no recording {wanted}; expected one of {list_names(there)}"
    )
