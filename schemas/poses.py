"""Receiver poses as arrays: the poses table, read whole or a block of frames at a time.

The table is a full grid: every segment has a row for every frame, so a block of frames is the same slice
of every segment, and a recording need never be in memory at once.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.tables import column_array, open_table, read_metadata

Array = npt.NDArray[np.float64]

BLOCK_FRAMES = 1 << 16

KEPT_BYTES = 200 * 10**6
"""Of recordings that were read whole, together; one that takes more than a quarter of it is not kept."""

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


@dataclass(frozen=True)
class ReceiverSeries:
    """One receiver over T frames, every number an array (T,) of its own, as a table has them.

    position_mm : x, y, z; quaternion : unit, w, x, y, z, receiver to transmitter frame; valid : (T,) bool.
    Where not valid, numbers may be NaN.
    """

    position_mm: tuple[Array, ...]
    quaternion: tuple[Array, ...]
    valid: npt.NDArray[np.bool_]

    def take(self, rows: slice | npt.NDArray[np.int64]) -> ReceiverSeries:
        """Only some of the frames."""
        return ReceiverSeries(
            tuple(number[rows] for number in self.position_mm),
            tuple(number[rows] for number in self.quaternion),
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
    """Read the poses of those segments, whole; a segment that the file lacks is never valid.

    The arrays cannot be written to: whoever reads a short recording next gets the same ones, see KEPT_BYTES.
    """
    stat = path.stat() if path.is_file() else None
    key = None if stat is None else (path.absolute(), stat.st_size, stat.st_mtime_ns, tuple(segments))
    if key is not None and key in _kept:
        _kept.move_to_end(key)
        return _kept[key]
    (poses,) = pose_blocks(path, segments, block_frames=None)
    for array in _arrays(poses):
        array.flags.writeable = False
    if key is not None and _size_bytes(poses) <= KEPT_BYTES // 4:
        _kept[key] = poses
        while sum(map(_size_bytes, _kept.values())) > KEPT_BYTES:
            _kept.popitem(last=False)
    return poses


_kept: OrderedDict[tuple[Path, int, int, tuple[str, ...]], Poses] = OrderedDict()
"""Recordings by their file's path, size and time, and by segments; last the one that was asked for last."""


def _arrays(poses: Poses) -> tuple[npt.NDArray[Any], ...]:
    return poses.frame, poses.time_s, poses.position_mm, poses.quaternion, poses.valid


def _size_bytes(poses: Poses) -> int:
    return sum(array.nbytes for array in _arrays(poses))


def pose_blocks(
    path: Path, segments: Sequence[str], block_frames: int | None = BLOCK_FRAMES
) -> Iterator[Poses]:
    """Read the poses of those segments in blocks of `block_frames` frames (None: one block).

    The last block is shorter. Gives at least one block, which is empty where the recording has no frame.
    Raises InputError where the file is no poses table or its segments do not share their frames.
    """
    with open_table(path, POSES) as file:
        rows = _rows_by_segment(path, file, segments, ("frame", *_NUMBERS, "valid"))
        times = {segment: own.of(("time_s",)) for segment, own in rows.items()}
        n_frames = next((one.n_rows for one in rows.values()), 0)
        size = block_frames or max(1, n_frames)
        for start in range(0, max(1, n_frames), size):
            block = _empty(segments, min(size, n_frames - start))
            for segment, own in rows.items():
                _fill(block, segment, own, start, first=segment == next(iter(rows)))
            for own in times.values():
                if not np.isnan(block.time_s).any():
                    break
                for at, piece in own.pieces(start, len(block.frame)):
                    known = block.time_s[at]
                    np.copyto(known, column_array(piece, "time_s"), where=np.isnan(known))
            yield block


def receiver_series(path: Path, segments: Sequence[str]) -> Iterator[dict[str, ReceiverSeries]]:
    """Read the poses of those segments a row group at a time; numbers stay where the file's reader put them.

    Gives the same frames of every segment that the file has, and nothing where the recording has no frame.
    What was given is emptied when the next is asked for, so that they are not in memory together. Raises
    InputError as `pose_blocks` does.
    """
    with open_table(path, POSES) as file:
        rows = _rows_by_segment(path, file, segments, ("frame", *_NUMBERS, "valid"))
        start, n_frames = 0, next((one.n_rows for one in rows.values()), 0)
        while start < n_frames:
            count = min(one.left_in_group(start) for one in rows.values())
            found, frame = {}, None
            for segment, own in rows.items():
                piece = own.piece(start, count)
                frame = own.shared_frames(piece, frame)
                numbers = [column_array(piece, name) for name in _NUMBERS]
                valid = column_array(piece, "valid")
                found[segment] = ReceiverSeries(tuple(numbers[:3]), tuple(numbers[3:]), valid)
            yield found
            found.clear()
            start += count


def frame_count(path: Path) -> int:
    """Give the number of frames of a poses file, which its footer tells."""
    with open_table(path, POSES) as file:
        groups = next(iter(_row_groups(file).values()), [])
        return sum(file.metadata.row_group(group).num_rows for group in groups)


class _SegmentRows:
    """Columns of one segment's rows, of which one row group at a time is in memory."""

    def __init__(
        self, path: Path, segment: str, file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str]
    ) -> None:
        self._path, self._segment, self._file = path, segment, file
        self._groups, self._columns = groups, list(columns)
        self._ends: list[int] = list(accumulate(file.metadata.row_group(group).num_rows for group in groups))
        self._place, self._table = -1, pa.table({})
        self.n_rows: int = self._ends[-1]

    def of(self, columns: Sequence[str]) -> _SegmentRows:
        """Give other columns of the same rows."""
        return _SegmentRows(self._path, self._segment, self._file, self._groups, columns)

    def left_in_group(self, start: int) -> int:
        """Rows from number `start` to the end of its row group."""
        return self._ends[bisect_right(self._ends, start)] - start

    def piece(self, start: int, count: int) -> pa.Table:
        """Give `count` rows of one row group."""
        place = bisect_right(self._ends, start)
        if place != self._place:
            self._place, self._table = place, pa.table({})
            self._table = self._read(self._groups[place])
        return self._table.slice(self._table.num_rows - self.left_in_group(start), count)

    def pieces(self, start: int, count: int) -> Iterator[tuple[slice, pa.Table]]:
        """Give `count` rows of any row groups, and where each piece stands among them."""
        done = 0
        while done < count:
            more = min(count - done, self.left_in_group(start + done))
            yield slice(done, done + more), self.piece(start + done, more)
            done += more

    def shared_frames(self, piece: pa.Table, others: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
        """Give the piece's frames; raises InputError where they are not those of the segments before."""
        own = column_array(piece, "frame")
        if others is not None and not np.array_equal(own, others):
            raise _unshared(self._path, self._segment)
        return own

    def _read(self, group: int) -> pa.Table:
        try:
            return self._file.read_row_group(group, columns=self._columns, use_threads=False)
        except (OSError, ValueError, pa.ArrowException) as error:
            raise InputError(f"{self._path}: damaged Parquet file ({error}); make it again") from error


def _rows_by_segment(
    path: Path, file: pq.ParquetFile, segments: Sequence[str], columns: Sequence[str]
) -> dict[str, _SegmentRows]:
    """Those of the segments that have a row; InputError where they have not equally many."""
    groups = _row_groups(file)
    found = {
        segment: _SegmentRows(path, segment, file, groups[segment], columns)
        for segment in segments
        if segment in groups
    }
    for segment, own in found.items():
        if own.n_rows != next(iter(found.values())).n_rows:
            raise _unshared(path, segment)
    return found


def _row_groups(file: pq.ParquetFile) -> dict[str, list[int]]:
    """Which row groups hold each segment (a row group never holds two)."""
    column = file.schema_arrow.get_field_index("segment")
    groups: dict[str, list[int]] = {}
    for index in range(file.metadata.num_row_groups):
        group = file.metadata.row_group(index)
        if group.num_rows:
            groups.setdefault(group.column(column).statistics.min, []).append(index)
    return groups


def _unshared(path: Path, segment: str) -> InputError:
    return InputError(f"{path}: segment {segment} does not have the frames of the others; make it again")


def _fill(block: Poses, segment: str, rows: _SegmentRows, start: int, *, first: bool) -> None:
    """Put a segment's rows from number `start` on into the block; of the first one the frames, too."""
    column = block.index(segment)
    for at, piece in rows.pieces(start, len(block.frame)):
        frame = rows.shared_frames(piece, None if first else block.frame[at])
        if first:
            block.frame[at] = frame
        for axis, name in enumerate(_NUMBERS):
            numbers = block.position_mm if axis < 3 else block.quaternion
            numbers[at, column, axis if axis < 3 else axis - 3] = column_array(piece, name)
        block.valid[at, column] = column_array(piece, "valid")


def _empty(segments: Sequence[str], n_frames: int) -> Poses:
    shape = (n_frames, len(segments))
    return Poses(
        tuple(segments),
        np.empty(n_frames, np.int64),
        np.full(n_frames, np.nan),
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
