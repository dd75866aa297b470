"""One hand under one model, as its folder of tables says; what a table cannot give is told in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from kinematics.rotations import Array
from kinematics.skeleton import Rows
from schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS, POSED_TIPS, TIP_ERRORS, TIPS
from schemas.errors import InputError
from schemas.poses import RecordingName
from schemas.study import path_token
from schemas.table_rows import TableRows
from schemas.tables import Table, open_table, read_metadata, read_table, rows_of

Columns = Mapping[str, Array]
"""Numbers (T,) by the name of their column."""

WITHOUT = "without-"
"""A folder of this name and a task holds the skeleton that was made without that task's recordings."""

TABLES = (JOINT_CENTRES, BONE_LENGTHS, METACARPALS, TIPS, TIP_ERRORS, POSED_TIPS)
"""What a folder may hold of what is read here."""


@dataclass(frozen=True)
class Stated:
    """What a skeleton states of itself: joint_centres by joint, bone_lengths by segment, and the first joints
    that are points of their own (own_cmc), whose bone therefore starts at them and not at the wrist.
    """

    joints: Rows
    bones: Mapping[str, Mapping[str, Any]]
    own_cmc: tuple[str, ...] = ()


@dataclass(frozen=True)
class SkeletonFolder:
    """A skeleton as it was read.

    calibrated_on : tasks, or "task, trial", that it was made from; None where its tables do not say.
    without : token of the task that it was made without; empty for the whole skeleton. whole_hand : whether
    the model poses the whole hand. errors : rows of tip_errors by task, trial and digit, of
    either binding. message : what could not be read.
    """

    path: Path
    model: str
    calibrated_on: tuple[str, ...] | None
    without: str
    whole_hand: bool
    stated: Stated
    errors: Mapping[tuple[str, str, str], Mapping[str, Any]]
    message: str

    @property
    def calibrated_text(self) -> str:
        """The column calibrated_on."""
        return ";".join(self.calibrated_on or ())

    @property
    def tasks(self) -> tuple[str, ...]:
        """Tasks that the skeleton was made from."""
        return tuple(words.partition(", ")[0] for words in self.calibrated_on or ())

    def table(self, table: Table) -> Path:
        """A table's file."""
        return self.path / f"{table.name}.parquet"

    def evaluates(self, name: RecordingName) -> bool:
        """Whether the folder's tables are meant to hold this recording."""
        return self.without in ("", path_token(name.task))

    def held_out(self, name: RecordingName) -> bool:
        """Whether the skeleton was made without this recording's task, as far as its tables say."""
        if self.calibrated_on is not None:
            return name.task not in self.tasks
        rows = [row for key, row in self.errors.items() if key[:2] == (name.task, name.trial)]
        return bool(self.without) or any(row["held_out"] for row in rows)


def read_folder(path: Path, subject: str, hand: str) -> SkeletonFolder:
    """Read the small tables of a skeleton's folder.

    Tables that failed or are missing are told in `message`. Raises InputError where a table is of another
    hand than that of `subject`.
    """
    if not path.is_dir():
        nothing = f"{path}: no such folder; expected the tables of a skeleton"
        return SkeletonFolder(path, model_of(path), None, _without(path), False, Stated({}, {}), {}, nothing)
    check_tables(path, TABLES, subject, hand)
    reasons: list[str] = []
    joints, bones, errors = (
        _rows(path, table, reasons) for table in (JOINT_CENTRES, BONE_LENGTHS, TIP_ERRORS)
    )
    made = _parameters(path / f"{JOINT_CENTRES.name}.parquet")
    calibrated = made.get("calibrated_on")
    return SkeletonFolder(
        path=path,
        model=joints[0]["model"] if joints else model_of(path),
        calibrated_on=None if calibrated is None else tuple(calibrated),
        without=_without(path),
        whole_hand=(path / f"{POSED_TIPS.name}.parquet").exists(),
        stated=Stated(
            {row["joint"]: row for row in joints},
            {row["bone"]: row for row in bones},
            tuple(made.get("own_cmc", ())),
        ),
        errors={(row["task"], row["trial"], row["digit"]): row for row in errors},
        message=joined(reasons),
    )


def model_of(path: Path) -> str:
    """The model's name as the path of a folder models/MODEL/sub-SUBJECT/HAND[/without-TASK] has it."""
    place = path.parent if _without(path) else path
    return place.parent.parent.name or path.name


def _without(path: Path) -> str:
    return path.name.removeprefix(WITHOUT) if path.name.startswith(WITHOUT) else ""


def joined(reasons: Sequence[str]) -> str:
    """Reasons as one message, each once; several tables often fail for one."""
    return "; ".join(dict.fromkeys(reason for reason in reasons if reason))


def digit_runs(
    path: Path, table: Table, columns: Sequence[str], name: RecordingName
) -> Iterator[tuple[str, Array]]:
    """Give numeric columns (N, columns) of one recording, some rows of a digit at a time, in the order of the
    file; gaps are NaN.

    table : one that has a row for every recording, digit and frame. Reads those columns alone and skips row
    groups of other recordings. Raises InputError where the table failed or cannot be read.
    """
    rows = TableRows(path, table, ("task", "trial", "digit"), columns)
    for words, numbers in rows.runs(name.task, name.trial):
        yield words[-1], numbers


def read_digits(path: Path, table: Table, columns: Sequence[str], name: RecordingName) -> dict[str, Columns]:
    """Give numeric columns of one recording, by digit; see `digit_runs`."""
    parts: dict[str, list[Array]] = {}
    for digit, numbers in digit_runs(path, table, columns, name):
        parts.setdefault(digit, []).append(numbers)
    return {digit: dict(zip(columns, np.concatenate(found).T, strict=True)) for digit, found in parts.items()}


def stack(columns: Columns, names: Sequence[str]) -> Array:
    """Columns side by side, (T, len(names))."""
    return np.stack([np.asarray(columns[name], float) for name in names], -1)


def check_tables(path: Path, tables: Sequence[Table], subject: str, hand: str) -> None:
    """Raise InputError where a readable table of a folder is of another hand; whoever needs an unreadable
    one tells so.
    """
    for table in tables:
        file = path / f"{table.name}.parquet"
        try:
            opened = open_table(file, table)
        except InputError:
            continue
        with opened:
            found = _whose(opened)
        if found not in (None, (subject, hand)):
            raise InputError(
                f"{file}: is of subject {found[0]}, {found[1]} hand; expected subject "
                f"{subject}, {hand} hand; give one hand's files"
            )


def _whose(file: pq.ParquetFile) -> tuple[str, str] | None:
    """Subject and hand of a table's first row; None where it has none. A row group of one hand says it."""
    if not file.metadata.num_rows:
        return None
    group = file.metadata.row_group(0)
    told = [
        group.column(index).statistics
        for name in ("subject", "hand")
        for index in [file.schema_arrow.get_field_index(name)]
    ]
    if all(one is not None and one.has_min_max and one.min == one.max for one in told):
        return told[0].min, told[1].min
    row = next(file.iter_batches(1, columns=["subject", "hand"])).to_pylist()[0]
    return row["subject"], row["hand"]


def _parameters(path: Path) -> Mapping[str, Any]:
    """Parameters in a table's metadata, also where its making failed; none where it cannot be read."""
    try:
        found: Mapping[str, Any] = read_metadata(path).get("parameters", {})
    except InputError:
        return {}
    return found


def _rows(path: Path, table: Table, reasons: list[str]) -> list[dict[str, Any]]:
    """Rows of a table of a folder; one that cannot be read has none and a reason."""
    try:
        return list(rows_of(read_table(path / f"{table.name}.parquet", table)))
    except InputError as error:
        reasons.append(str(error))
        return []
