"""Receiver poses as arrays: the poses table, read whole or a block of frames at a time.

The table is a full grid: every segment has a row for every frame, so a block of frames is the same slice
of every segment, and a recording need never be in memory at once.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

from shukotsu.errors import InputError, TableError
from shukotsu.files.limits import FARTHEST_MM, check_regular
from shukotsu.files.parquet_files import column_ends, naming_damage, open_parquet
from shukotsu.files.text_files import reading
from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.study import Hand
from shukotsu.schemas.tables import column_array, open_table, read_metadata

Array = npt.NDArray[np.float64]

BLOCK_FRAMES = 1 << 16

KEPT_BYTES = 200 * 10**6
"""Of recordings that were read whole, together; one that takes more than a quarter of it is not kept."""

BYTES_A_POSE = 57
_NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


@dataclass(frozen=True)
class RecordingName:
    """Whose hand it is and what it did."""

    subject: str
    hand: str
    task: str
    trial: str = ""
    session: str = ""

    @property
    def of_hand(self) -> Hand:
        """The hand alone."""
        return Hand(self.subject, self.hand, self.session)

    def __str__(self) -> str:
        return ", ".join(word for word in (str(self.of_hand), self.task, self.trial) if word)


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


PosesReader = Callable[..., Iterator[Poses]]
"""Called with names of segments: a hand's recordings in turn, long ones in blocks, with those at least."""


def poses_reader(paths: Sequence[Path], segments: Sequence[str]) -> PosesReader:
    """Return a reader of recordings, of which `segments` are all; it raises InputError as `read_poses` does.

    Short recordings are kept between calls, with all segments; of long ones only what is asked for is read,
    some frames at a time.
    """

    def read(*wanted: str) -> Iterator[Poses]:
        for path in paths:
            if _is_short(path, segments):
                yield read_poses(path, segments)
            else:
                yield from pose_blocks(path, wanted)

    return read


def recording_name(path: Path) -> RecordingName:
    """Return the recording's name from a poses file's metadata, also where its making failed."""
    try:
        with reading(path, f"a {POSES.name} table"):
            check_regular(path, f"a {POSES.name} table")
    except InputError as error:
        raise TableError(str(error)) from error
    metadata = read_metadata(path)
    if metadata["schema"] != POSES.name:
        raise TableError(f"{path}: is a {metadata['schema']} table; expected {POSES.name}")
    parameters = metadata["parameters"]
    names = {name: parameters.get(name) for name in ("subject", "hand", "task", "trial")}
    names["session"] = parameters.get("session", "")  # a recording without one does not name it
    for name, text in names.items():
        if not isinstance(text, str):
            raise TableError(f"{path}: its metadata lacks {name!r}; make it with shukotsu.stages.capture")
    return RecordingName(**names)


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


def read_every(path: Path, segments: Sequence[str], every: int) -> Poses:
    """Read one frame in `every`, from the first on, as `read_poses` reads all."""
    if every <= 1:
        return read_poses(path, segments)
    kept, start = [], 0
    for block in pose_blocks(path, segments):
        kept.append(block.take(np.arange(-start % every, len(block.frame), every)))  # copies
        start += len(block.frame)
    return joined_poses(kept)


def joined_poses(parts: Sequence[Poses]) -> Poses:
    """Return parts of a recording, at least one, as one."""
    arrays = zip(*map(_arrays, parts), strict=True)
    return Poses(parts[0].segments, *(np.concatenate(own) for own in arrays))


_kept: OrderedDict[tuple[Path, int, int, tuple[str, ...]], Poses] = OrderedDict()
"""Recordings by their file's path, size and time, and by segments; last the one that was asked for last."""


def _arrays(poses: Poses) -> tuple[npt.NDArray[Any], ...]:
    return poses.frame, poses.time_s, poses.position_mm, poses.quaternion, poses.valid


def _is_short(path: Path, segments: Sequence[str]) -> bool:
    """Return whether a recording may be in memory as a whole."""
    return frame_count(path) * len(segments) * BYTES_A_POSE <= KEPT_BYTES // 4


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
            for place in (block.index(segment) for segment in segments if segment not in rows):
                block.position_mm[:, place] = block.quaternion[:, place] = np.nan
            for segment, own in rows.items():
                _fill(path, block, segment, own, start, first=segment == next(iter(rows)))
            for own in times.values():
                if not np.isnan(block.time_s).any():
                    break
                for at, piece in own.pieces(start, len(block.frame)):
                    known = block.time_s[at]
                    np.copyto(known, piece["time_s"], where=np.isnan(known))
            yield block


def check_layout(path: Path, layout: Layout) -> None:
    """Raise TableError where a poses file was made with a layout of other segments than this one's.

    A layout that measures fewer of the segments will do, or one of which the recording wore fewer receivers.
    """
    with open_parquet(path, f"a {POSES.name} table") as file:  # also one without rows
        segments = _row_groups(path, file)
    made_with = read_metadata(path)["parameters"].get("layout", layout.name)
    lacking = [name for name in layout.measured if name not in segments]
    if made_with != layout.name and lacking and not set(segments) <= set(layout.segments):
        raise TableError(
            f"{path}: was imported with layout {made_with} and has no {lacking[0]}; layout {layout.name} "
            f"measures {', '.join(layout.measured)}; import the recording with it"
        )


def frame_count(path: Path) -> int:
    """Return the number of frames of a poses file, which its footer tells."""
    with open_table(path, POSES) as file:
        groups = next(iter(_row_groups(path, file).values()), [])
        return sum(file.metadata.row_group(group).num_rows for group in groups)


class _SegmentRows:
    """Columns of one segment's rows, of which one row group at a time is in memory."""

    def __init__(
        self, path: Path, file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str]
    ) -> None:
        self._path, self._file = path, file
        self._groups, self._columns = groups, list(columns)
        self._ends: list[int] = list(accumulate(file.metadata.row_group(group).num_rows for group in groups))
        self._place = -1
        self._arrays: dict[str, npt.NDArray[Any]] = {}
        self.n_rows: int = self._ends[-1]

    def of(self, columns: Sequence[str]) -> _SegmentRows:
        """Return other columns of the same rows."""
        return _SegmentRows(self._path, self._file, self._groups, columns)

    def pieces(self, start: int, count: int) -> Iterator[tuple[slice, dict[str, npt.NDArray[Any]]]]:
        """Give `count` rows from number `start` on, by row group, and where each piece stands among them."""
        done = 0
        while done < count:
            place = bisect_right(self._ends, start + done)
            if place != self._place:
                self._arrays.clear()  # before the next are read
                self._place, self._arrays = place, self._read(self._groups[place])
            left = self._ends[place] - (start + done)
            more, first = min(count - done, left), len(next(iter(self._arrays.values()))) - left
            rows = {name: array[first : first + more] for name, array in self._arrays.items()}
            yield slice(done, done + more), rows
            done += more

    def _read(self, group: int) -> dict[str, npt.NDArray[Any]]:
        with naming_damage(self._path):
            table = self._file.read_row_group(group, columns=self._columns, use_threads=False)
        return {name: column_array(table, name) for name in self._columns}


def _rows_by_segment(
    path: Path, file: pq.ParquetFile, segments: Sequence[str], columns: Sequence[str]
) -> dict[str, _SegmentRows]:
    """Those of the segments that have a row; InputError where they have not equally many."""
    groups = _row_groups(path, file)
    found = {
        segment: _SegmentRows(path, file, groups[segment], columns)
        for segment in segments
        if segment in groups
    }
    for segment, own in found.items():
        if own.n_rows != next(iter(found.values())).n_rows:
            raise _unshared(path, segment)
    return found


def _row_groups(path: Path, file: pq.ParquetFile) -> dict[str, list[int]]:
    """Which row groups hold each segment. Raises TableError where one holds two, or does not say which."""
    column = file.schema_arrow.get_field_index("segment")
    groups: dict[str, list[int]] = {}
    for index in range(file.metadata.num_row_groups):
        if not file.metadata.row_group(index).num_rows:
            continue
        ends = column_ends(path, file, index, column)
        if ends is None or ends[0] != ends[1]:
            raise TableError(f"{path}: a row group holds several segments; make it with `shukotsu import`")
        groups.setdefault(ends[0], []).append(index)
    return groups


def _unshared(path: Path, segment: str) -> TableError:
    return TableError(f"{path}: segment {segment} does not have the frames of the others; make it again")


def _fill(path: Path, block: Poses, segment: str, rows: _SegmentRows, start: int, *, first: bool) -> None:
    """Put a segment's rows from number `start` on into the block; of the first one the frames, too."""
    column = block.index(segment)
    for at, piece in rows.pieces(start, len(block.frame)):
        if first:
            block.frame[at] = piece["frame"]
        elif not np.array_equal(piece["frame"], block.frame[at]):
            raise _unshared(path, segment)
        for axis, name in enumerate(_NUMBERS):
            if (piece["valid"] & (np.abs(piece[name]) > FARTHEST_MM)).any():  # squares overflow
                raise TableError(f"{path}: column {name} has numbers that no pose has; make it again")
            numbers = block.position_mm if axis < 3 else block.quaternion
            numbers[at, column, axis if axis < 3 else axis - 3] = piece[name]
        block.valid[at, column] = piece["valid"]


def _empty(segments: Sequence[str], n_frames: int) -> Poses:
    """Poses yet to fill in, in memory number by number as the file's columns are; valid nowhere."""
    shape = (n_frames, len(segments))
    return Poses(
        tuple(segments),
        np.empty(n_frames, np.int64),
        np.full(n_frames, np.nan),
        np.empty((*shape, 3), order="F"),
        np.empty((*shape, 4), order="F"),
        np.zeros(shape, bool, order="F"),
    )


def one_hand(paths: Sequence[Path], subject: str | None, session: str | None, hand: str | None) -> Hand:
    """Return the hand that all the poses files are of, or the one given where there is no file.

    Raises InputError where the files disagree with each other or with what is given.
    """
    names = [(path, recording_name(path)) for path in paths]
    if not names and (subject is None or hand is None):
        raise InputError("no poses file, so --subject and --hand must say whose hand it is")
    own = names[0][1] if names else RecordingName("", "", "")
    wanted = Hand(subject or own.subject, hand or own.hand, own.session if session is None else session)
    for path, name in names:
        if name.of_hand != wanted:
            raise InputError(f"{path}: is of {name}; expected {wanted}")
    return wanted


def usable_poses(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Split poses files into those that hold poses and the reasons why others hold none.

    Raises TableError where one is no poses table.
    """
    usable, reasons = [], []
    for path in paths:
        try:
            open_table(path, POSES).close()
        except TableError:
            raise
        except InputError as error:
            reasons.append(error.message)
        else:
            usable.append(path)
    return usable, reasons
