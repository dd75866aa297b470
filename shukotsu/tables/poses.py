"""Read receiver poses as arrays: the poses table, as a whole or in blocks of frames.

The table is a complete grid: every segment has a row for every frame. A block of frames is therefore the same
slice of every segment, and a recording never has to be in memory as a whole.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, TableError
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.digests import file_state
from shukotsu.tables.limits import FARTHEST_MM
from shukotsu.tables.parquet_files import open_parquet
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import TableFile, column_array, open_table, read_metadata

BLOCK_FRAMES = 1 << 16

KEPT_BYTES = 200 * 10**6
"""Largest total size of cached recordings; one larger than a quarter of it is not cached."""

Columns = dict[str, npt.NDArray[Any]]
"""Columns of the poses table by name."""

BYTES_A_POSE = 57
NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
_COLUMNS = ("frame", "time_s", *NUMBERS, "valid")


@dataclass(frozen=True)
class RecordingName:
    """Name of a recording: subject, session and hand, task and trial."""

    subject: str
    hand: str
    task: str
    trial: str = ""
    session: str = ""

    @property
    def of_hand(self) -> Hand:
        """Subject, session and hand."""
        return Hand(self.subject, self.hand, self.session)

    def __str__(self) -> str:
        return ", ".join(word for word in (str(self.of_hand), self.task, self.trial) if word)


@dataclass(frozen=True)
class Poses:
    """Poses of S receivers over T frames.

    Attributes
    ----------
    segments : tuple of str
        Segments that carry the receivers.
    frame : array of int, shape (T,)
        Frame numbers.
    time_s : array, shape (T,)
        Device time of the first segment that has one in the frame, else NaN.
    position_mm : array, shape (T, S, 3)
        Receiver origins in the transmitter frame.
    quaternion : array, shape (T, S, 4)
        Unit quaternions (w, x, y, z), receiver to transmitter frame.
    valid : array of bool, shape (T, S)
        Whether there is a pose; elsewhere the numbers may be NaN.

    """

    segments: tuple[str, ...]
    frame: Integers
    time_s: Array
    position_mm: Array
    quaternion: Array
    valid: Bools

    def index(self, segment: str) -> int:
        """Return the index of the segment in the second dimension."""
        return self.segments.index(segment)

    def rotation(self, segment: str) -> Array:
        """Return the quaternions (T, 4) of a segment's receiver, NaN where it has no pose."""
        index = self.index(segment)
        return np.where(self.valid[:, index, None], self.quaternion[:, index], np.nan)

    def take(self, rows: slice | Integers) -> Poses:
        """Select frames.

        Parameters
        ----------
        rows : slice or array of int
            Indices of the frames.

        Returns
        -------
        Poses
            The selected frames.

        """
        return Poses(self.segments, *(array[rows] for array in _arrays(self)))


PosesReader = Callable[..., Iterator[Poses]]
"""Function of segment names that yields a hand's recordings with these segments, long ones in blocks."""


def poses_reader(paths: Sequence[Path], segments: Sequence[str]) -> PosesReader:
    """Make a reader of recordings.

    Short recordings are cached with all their segments; of long ones only the requested segments are read,
    block by block.

    Parameters
    ----------
    paths : sequence of Path
        Poses files.
    segments : sequence of str
        All segments that may be requested.

    Returns
    -------
    PosesReader
        Raises InputError as `read_poses` does.

    """

    def read(*wanted: str) -> Iterator[Poses]:
        for path in paths:
            if _is_kept(path, segments):
                yield read_poses(path, segments)
            else:
                yield from pose_blocks(path, wanted)

    return read


def recording_name(path: Path) -> RecordingName:
    """Return the name of a recording from the metadata of its poses file, even if its import failed.

    Raises
    ------
    TableError
        If the file is not a poses table or its metadata lack a name.

    """
    metadata = read_metadata(path, f"a {POSES.name} table")
    if metadata["schema"] != POSES.name:
        raise TableError(f"{path}: is a {metadata['schema']} table; expected {POSES.name}")
    parameters = metadata["parameters"]
    names = {name: parameters.get(name) for name in ("subject", "hand", "task", "trial")}
    names["session"] = parameters.get("session", "")  # only stored if there is one
    for name, text in names.items():
        if not isinstance(text, str):
            raise TableError(f"{path}: its metadata lacks {name!r}; make it with `shukotsu import`")
    return RecordingName(**names)


def read_poses(path: Path, segments: Sequence[str]) -> Poses:
    """Read the poses of the given segments from a whole recording.

    The arrays are read-only, since later readers of a short recording get the same ones (see KEPT_BYTES).

    Parameters
    ----------
    path : Path
        Poses file.
    segments : sequence of str
        Segments; one that the file lacks is never valid.

    Returns
    -------
    Poses
        All frames.

    Raises
    ------
    InputError
        As `pose_blocks`.

    """
    key = (file_state(path), tuple(segments)) if path.is_file() else None
    if key in _kept:
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


def _is_kept(path: Path, segments: Sequence[str]) -> bool:
    """Return whether a recording is short enough to be cached."""
    return frame_count(path) * len(segments) * BYTES_A_POSE <= KEPT_BYTES // 4


def read_every(path: Path, segments: Sequence[str], every: int) -> Poses:
    """Read every n-th frame of a whole recording, from the first on.

    Parameters
    ----------
    path : Path
        Poses file.
    segments : sequence of str
        Segments; one that the file lacks is never valid.
    every : int
        Step between the frames to read; 1 for all.

    Returns
    -------
    Poses
        The selected frames.

    Raises
    ------
    InputError
        As `pose_blocks`.

    """
    if every <= 1:
        return read_poses(path, segments)
    if _is_kept(path, segments):
        return read_poses(path, segments).take(np.arange(0, frame_count(path), every))
    kept, start = [], 0
    for block in pose_blocks(path, segments):
        kept.append(block.take(np.arange(-start % every, len(block.frame), every)))  # copies
        start += len(block.frame)
    return joined_poses(kept)


def joined_poses(parts: Sequence[Poses]) -> Poses:
    """Concatenate parts of a recording.

    Parameters
    ----------
    parts : sequence of Poses
        At least one part, in the order of time.

    Returns
    -------
    Poses
        All frames.

    """
    arrays = zip(*map(_arrays, parts), strict=True)
    return Poses(parts[0].segments, *(np.concatenate(pieces) for pieces in arrays))


_kept: OrderedDict[tuple[tuple[int, ...], tuple[str, ...]] | None, Poses] = OrderedDict()
"""Cached recordings by the file's state and by segments, most recently used last."""


def _arrays(poses: Poses) -> tuple[npt.NDArray[Any], ...]:
    """Return the arrays of the poses, in the order of the constructor."""
    return poses.frame, poses.time_s, poses.position_mm, poses.quaternion, poses.valid


def _size_bytes(poses: Poses) -> int:
    """Return the size of the poses' arrays in memory."""
    return sum(array.nbytes for array in _arrays(poses))


def pose_blocks(
    path: Path, segments: Sequence[str], block_frames: int | None = BLOCK_FRAMES
) -> Iterator[Poses]:
    """Read the poses of the given segments in blocks of frames.

    Parameters
    ----------
    path : Path
        Poses file.
    segments : sequence of str
        Segments; one that the file lacks is never valid.
    block_frames : int or None
        Frames per block, except in the last one; None for a single block.

    Yields
    ------
    Poses
        At least one block, which is empty if the recording has no frames.

    Raises
    ------
    InputError
        If the file is not a poses table, or its segments have different frames.

    """
    with open_table(path, POSES) as file:
        groups = _row_groups(file)
        present = [segment for segment in segments if segment in groups]
        counts = [sum(file.group_rows[group] for group in groups[segment]) for segment in present]
        for segment, count in zip(present, counts, strict=True):
            if count != counts[0]:
                raise _unshared_frames(path, segment)
        n_frames = counts[0] if counts else 0
        size = block_frames or max(1, n_frames)
        pieces = {segment: _pieces(file, groups[segment], size) for segment in present}
        for start in range(0, max(1, n_frames), size):
            block = _empty(segments, min(size, n_frames - start))
            for segment in present:
                filled = 0
                while filled < len(block.frame):
                    rows, columns = next(pieces[segment])
                    _fill(path, block, segment, rows, columns, first=segment == present[0])
                    filled = rows.stop
            yield block


def check_layout(path: Path, layout: str, measured: Sequence[str], segments: Collection[str]) -> None:
    """Raise TableError if a poses file was imported with a layout that has other segments.

    A layout that measures fewer of the segments is accepted, and so is a recording with fewer receivers.

    Parameters
    ----------
    path : Path
        Poses file.
    layout : str
        Name of the layout.
    measured, segments : sequence of str, collection of str
        Segments that the layout measures, and all its segments.

    """
    with open_parquet(path, f"a {POSES.name} table") as file:  # unlike open_table, accepts a failed import
        present = _row_groups(TableFile(path, POSES, file))
    made_with = read_metadata(path)["parameters"].get("layout", layout)
    lacking = [name for name in measured if name not in present]
    if made_with != layout and lacking and not set(present) <= set(segments):
        raise TableError(
            f"{path}: was imported with layout {made_with} and has no {lacking[0]}; layout {layout} "
            f"measures {', '.join(measured)}; import the recording with it"
        )


def seen_segments(path: Path) -> set[str]:
    """Return the segments that have a valid pose in any frame of a poses file, by its footer's statistics."""
    with open_table(path, POSES) as file:
        return {
            segment
            for segment, groups in _row_groups(file).items()
            if any((file.ends(group, "valid") or (False, True))[1] for group in groups)
        }


def frame_count(path: Path) -> int:
    """Return the number of frames of a poses file, from its footer."""
    return _frame_count(path, *(file_state(path) if path.is_file() else ()))


@lru_cache(maxsize=256)
def _frame_count(path: Path, *_: int) -> int:
    """Return the number of frames, see `frame_count`; cached by the file's state."""
    with open_table(path, POSES) as file:
        groups = next(iter(_row_groups(file).values()), [])
        return sum(file.group_rows[group] for group in groups)


def _row_groups(file: TableFile) -> dict[str, list[int]]:
    """Return the row groups of each segment. Raises TableError unless each group is of one known segment."""
    groups: dict[str, list[int]] = {}
    for group, n_rows in enumerate(file.group_rows):
        if not n_rows:
            continue
        ends = file.ends(group, "segment")
        if ends is None or ends[0] != ends[1]:
            raise TableError(f"{file.path}: a row group has several segments; make it with `shukotsu import`")
        groups.setdefault(ends[0], []).append(group)
    return groups


def _pieces(file: TableFile, groups: Sequence[int], size: int) -> Iterator[tuple[slice, Columns]]:
    """Read a segment's columns, one row group at a time, split at the ends of blocks of `size` frames.

    Yields for each piece the slice of its block, and its columns.
    """
    start = 0
    for group in groups:
        table = file.read(_COLUMNS, [group])
        arrays = {name: column_array(table, name) for name in _COLUMNS}
        first, n_rows = 0, table.num_rows
        del table
        while first < n_rows:
            at = start % size
            count = min(n_rows - first, size - at)
            yield slice(at, at + count), {n: array[first : first + count] for n, array in arrays.items()}
            first, start = first + count, start + count


def _unshared_frames(path: Path, segment: str) -> TableError:
    """Return the error for a segment whose frames differ from those of the others."""
    return TableError(f"{path}: segment {segment} has other frames than the other segments; make it again")


def _fill(path: Path, block: Poses, segment: str, rows: slice, columns: Columns, *, first: bool) -> None:
    """Copy a segment's columns into rows of the block; the first segment also sets the frame numbers."""
    index = block.index(segment)
    if first:
        block.frame[rows] = columns["frame"]
    elif not np.array_equal(columns["frame"], block.frame[rows]):
        raise _unshared_frames(path, segment)
    times = block.time_s[rows]
    np.copyto(times, columns["time_s"], where=np.isnan(times))
    for axis, name in enumerate(NUMBERS):
        if (columns["valid"] & (np.abs(columns[name]) > FARTHEST_MM)).any():  # squares overflow
            raise TableError(f"{path}: column {name} has impossible numbers; make it again")
        numbers, component = (block.position_mm, axis) if axis < 3 else (block.quaternion, axis - 3)
        numbers[rows, index, component] = columns[name]
    block.valid[rows, index] = columns["valid"]


def _empty(segments: Sequence[str], n_frames: int) -> Poses:
    """Return poses to be filled in, column-major as in the file, none of them valid."""
    shape = (n_frames, len(segments))
    frame, time_s = np.empty(n_frames, np.int64), np.full(n_frames, np.nan)
    position_mm = np.full((*shape, 3), np.nan, order="F")
    quaternion = np.full((*shape, 4), np.nan, order="F")
    valid = np.zeros(shape, bool, order="F")
    return Poses(tuple(segments), frame, time_s, position_mm, quaternion, valid)


def one_hand(paths: Sequence[Path], subject: str | None, session: str | None, hand: str | None) -> Hand:
    """Return the hand of all poses files, or the given hand if there are no files.

    Raises InputError if the files disagree with each other or with the given subject, session and hand.
    """
    names = [(path, recording_name(path)) for path in paths]
    if not names and (subject is None or hand is None):
        raise InputError("without a poses file, --subject and --hand must state whose hand it is")
    name = names[0][1] if names else RecordingName("", "", "")
    wanted = Hand(subject or name.subject, hand or name.hand, name.session if session is None else session)
    for path, name in names:
        if name.of_hand != wanted:
            raise InputError(f"{path}: is of {name}; expected {wanted}")
    return wanted


def usable_poses(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the poses files whose import succeeded, and the reasons why the others failed.

    Raises TableError if a file is not a poses table.
    """
    usable, reasons = [], []
    for path in paths:
        try:
            with open_table(path, POSES):
                usable.append(path)
        except TableError:
            raise
        except InputError as error:
            reasons.append(error.message)
    return usable, reasons
