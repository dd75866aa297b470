"""Receiver poses as arrays: the poses table, read whole or a block of frames at a time.

The table is a full grid: every segment has a row for every frame, so a block of frames is the same slice
of every segment, and a recording need never be in memory at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.tables import column_array, open_table, read_metadata

Array = npt.NDArray[np.float64]

BLOCK_FRAMES = 1 << 16
_NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


@dataclass(frozen=True)
class RecordingName:
    """Whose hand it is and what it did."""

    subject: str
    hand: str
    task: str
    trial: str = ""

    def __str__(self) -> str:
        words = [f"subject {self.subject}", f"{self.hand} hand", self.task, self.trial]
        return ", ".join(word for word in words if word)


@dataclass(frozen=True)
class Poses:
    """Poses of S receivers over T frames; first dimension is time.

    frame : (T,) int; time_s : (T,), of the first segment that has one, NaN where none has; position_mm :
    (T, S, 3), quaternion : (T, S, 4) unit (w, x, y, z), receiver to transmitter frame; valid : (T, S)
    bool. Where not valid, numbers may be NaN.
    """

    segments: tuple[str, ...]
    frame: npt.NDArray[np.int64]
    time_s: Array
    position_mm: Array
    quaternion: Array
    valid: npt.NDArray[np.bool_]

    def index(self, segment: str) -> int:
        """Position of the segment in the second dimension."""
        return self.segments.index(segment)

    def take(self, rows: slice | npt.NDArray[np.int64]) -> Poses:
        """Only some of the frames."""
        return Poses(
            self.segments,
            self.frame[rows],
            self.time_s[rows],
            self.position_mm[rows],
            self.quaternion[rows],
            self.valid[rows],
        )


def recording_name(path: Path) -> RecordingName:
    """Give the recording's name from a poses file's metadata, also where its making failed."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a {POSES.name} table")
    metadata = read_metadata(path)
    if metadata["schema"] != POSES.name:
        raise InputError(f"{path}: is a {metadata['schema']} table; expected {POSES.name}")
    parameters = metadata.get("parameters", {})
    try:
        return RecordingName(
            parameters["subject"], parameters["hand"], parameters["task"], parameters["trial"]
        )
    except KeyError as error:
        raise InputError(f"{path}: its metadata lacks {error}; make it with stages.capture") from error


def read_poses(path: Path, segments: Sequence[str]) -> Poses:
    """Read the poses of those segments, whole; a segment that the file lacks is never valid."""
    blocks = list(pose_blocks(path, segments, block_frames=None))
    return blocks[0]


def pose_blocks(
    path: Path, segments: Sequence[str], block_frames: int | None = BLOCK_FRAMES
) -> Iterator[Poses]:
    """Read the poses of those segments in blocks of at most `block_frames` frames (None: one block).

    Gives at least one block, which is empty where the recording has no frame. Raises InputError where
    the file is no poses table or its segments do not share their frames.
    """
    with open_table(path, POSES) as file:
        groups = _row_groups(file)
        known = [segment for segment in segments if segment in groups]
        if not known or not file.metadata.num_rows:
            yield _empty(segments)
            return
        size = block_frames or max(1, file.metadata.num_rows)
        streams = {segment: file.iter_batches(size, row_groups=groups[segment]) for segment in known}
        batches = {segment: next(stream, None) for segment, stream in streams.items()}
        while any(batch is not None for batch in batches.values()):
            yield _block(path, segments, batches)
            batches = {segment: next(stream, None) for segment, stream in streams.items()}


def _row_groups(file: pq.ParquetFile) -> dict[str, list[int]]:
    """Which row groups hold each segment (a row group never holds two)."""
    column = file.schema_arrow.get_field_index("segment")
    groups: dict[str, list[int]] = {}
    for index in range(file.metadata.num_row_groups):
        group = file.metadata.row_group(index)
        if group.num_rows:
            groups.setdefault(group.column(column).statistics.min, []).append(index)
    return groups


def _block(path: Path, segments: Sequence[str], batches: dict[str, pa.RecordBatch | None]) -> Poses:
    tables = {s: pa.Table.from_batches([batch]) for s, batch in batches.items() if batch is not None}
    first = next(iter(tables.values()))
    frame = column_array(first, "frame")
    block = _empty(segments, frame.astype(np.int64), np.full(len(frame), np.nan))
    for index, segment in enumerate(segments):
        table = tables.get(segment)
        if table is None and segment not in batches:
            continue
        if table is None or not np.array_equal(column_array(table, "frame"), frame):
            raise InputError(
                f"{path}: segment {segment} does not have the frames of the others; make it again"
            )
        time_s = column_array(table, "time_s").astype(float)
        np.copyto(block.time_s, time_s, where=np.isnan(block.time_s))
        numbers = [column_array(table, name) for name in _NUMBERS]
        block.position_mm[:, index] = np.stack(numbers[:3], -1)
        block.quaternion[:, index] = np.stack(numbers[3:], -1)
        block.valid[:, index] = column_array(table, "valid")
    return block


def _empty(
    segments: Sequence[str],
    frame: npt.NDArray[np.int64] | None = None,
    time_s: Array | None = None,
) -> Poses:
    frame = np.empty(0, np.int64) if frame is None else frame
    shape = (len(frame), len(segments))
    return Poses(
        tuple(segments),
        frame,
        np.empty(0) if time_s is None else time_s,
        np.full((*shape, 3), np.nan),
        np.full((*shape, 4), np.nan),
        np.zeros(shape, bool),
    )


def one_hand(paths: Sequence[Path], subject: str | None, hand: str | None) -> tuple[str, str]:
    """Give the subject and hand that all the poses files are of, or those given where there is no file.

    Raises InputError where the files disagree with each other or with what is given.
    """
    names = [(path, recording_name(path)) for path in paths]
    if not names and (subject is None or hand is None):
        raise InputError("no poses file, so --subject and --hand must say whose hand it is")
    wanted = (subject or names[0][1].subject, hand or names[0][1].hand)
    for path, name in names:
        if (name.subject, name.hand) != wanted:
            raise InputError(f"{path}: is of {name}; expected subject {wanted[0]}, {wanted[1]} hand")
    return wanted


def usable_poses(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Split poses files into those that can be read and the reasons why the others cannot."""
    usable, reasons = [], []
    for path in paths:
        try:
            open_table(path, POSES).close()
        except InputError as error:
            reasons.append(str(error))
        else:
            usable.append(path)
    return usable, reasons
