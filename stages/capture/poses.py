"""From samples to the poses table: what is wrong is flagged or refused, and nothing is made up.

Frames, times and gaps stay as they came; samples are put in order and onto a full grid, so that every
segment has a row for every frame.

Samples come part by part, in whatever order the recording has them, and the table leaves segment by segment.
In between they wait in a spool (`stages.capture.spool`): first as they came, each segment's in a queue of its
own, then in order and checked. So memory does not grow with the recording, unless rows stand out of order:
then a segment that has such rows is sorted in memory.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas.errors import InputError
from stages.capture.samples import NUMBERS, Samples
from stages.capture.spool import Spool

FLAGS = {
    "no-row": "the recording has no row for this receiver in this frame, though others have",
    "missing": "all seven numbers are empty",
    "partly-missing": "some of the seven numbers are empty",
    "not-finite": "a number is infinite",
    "duplicate-frame": "the row stands more than once in the recording, each time the same",
    "conflicting-duplicate": "the frame stands more than once with different numbers or times",
    "time-missing": "the row has no (finite) time",
    "time-not-increasing": "the time is not later than that of the receiver's row before",
    "frozen": "the receiver gave one and the same pose all along while that of its parent segment moved",
    "device-error": "the tracker itself reported that this pose is wrong",
    "device-warning": "the tracker reported a fault of its own with this pose, which may be right",
    "distorted": "the tracker saw its field distorted by metal",
    "hemisphere-flip": "the position jumped to the other side of the transmitter, or was on its way there",
    "hemisphere-repaired": "the position had jumped to the other side of the transmitter and was put back",
    "low-quality": "the recording's own measure of quality is beyond the limit that its mapping gives",
    "misfit": "the markers of the cluster do not fit its rigid shape",
}
"""What a row's flags say; bit i of a row's flags stands for the i-th. See docs/recordings.md."""

INVALIDATING = ("device-error", "hemisphere-flip", "low-quality", "misfit")
"""Marks of a reader that make a pose unusable though its numbers are complete; they are kept."""

NORM_TOLERANCE = 0.01
"""A quaternion whose length is off by more was not rounded: it is something else."""

FROZEN_FRAMES = 240
"""A second at 240 Hz: a working receiver's last digits move in that time."""

ROW_GROUP_FRAMES = 1 << 15
"""Two minutes at 240 Hz: who reads frame by frame holds a row group of every segment at once."""

SPAN_FRAMES = 1000
"""Frames, spread over the recording, from which the extent of the receivers is told."""

_BIT = {flag: np.uint32(1 << position) for position, flag in enumerate(FLAGS)}

_INVALIDATING = np.bitwise_or.reduce([_BIT[flag] for flag in INVALIDATING])

_RAW, _CHECKED, _GRID = "as they came", "checked", "frames"
"""Queues of the spool: (_RAW, segment) and (_CHECKED, segment) of rows, _GRID of frame numbers."""

Bools = npt.NDArray[np.bool_]
Wholes = npt.NDArray[np.int64]
Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PosesTable:
    """The poses table, to be written a row group at a time; no row group holds two segments.

    segments : those that occur, in the layout's order; usable : of each, how many rows are valid.
    frozen : segments whose rows are flagged so. span_mm : how far apart the receivers are, NaN where unknown.
    """

    segments: tuple[str, ...]
    usable: tuple[int, ...]
    frozen: tuple[str, ...]
    span_mm: float
    _queues: tuple[int, ...]
    _spool: Spool
    _row_group_frames: int

    @property
    def columns(self) -> dict[str, Any]:
        """The columns of the whole table at once, of a recording that memory holds."""
        groups = list(self.row_groups())
        return {name: _joined([group[name] for group in groups]) for name in groups[0]}

    def row_groups(self) -> Iterator[dict[str, Any]]:
        """Give the columns of each row group in turn, while the spool is open."""
        for name, queue in zip(self.segments, self._queues, strict=True):
            checked = (_Rows(*chunk) for chunk in self._spool.chunks((_CHECKED, queue)))
            grid = (frames for (frames,) in self._spool.chunks(_GRID))
            rows_left = _empty_rows()
            for frames in _cut(grid, self._row_group_frames):
                rows, rows_left = _up_to(int(frames[-1]), rows_left, checked)
                yield _columns(name, frames, rows, name in self.frozen)


@dataclass(frozen=True)
class _Rows:
    """Samples of one segment, N; `sample` is where each stood in the recording, numbers are (7, N)."""

    sample: Wholes
    frame: Wholes
    time_s: Array
    numbers: Array
    flags: npt.NDArray[np.uint32]

    def take(self, rows: slice | Wholes) -> _Rows:
        """Some of the rows."""
        return _Rows(*(column[..., rows] for column in self.columns))

    @property
    def columns(self) -> tuple[npt.NDArray[Any], ...]:
        """The columns, in the order of their declaration."""
        return tuple(getattr(self, part.name) for part in fields(self))

    @property
    def spoilt(self) -> Bools:
        """Whether the reader marked the pose as unusable, shape (N,)."""
        return np.asarray((self.flags & _INVALIDATING) != 0)


def poses_table(
    samples: Samples, parents: Mapping[str, str], row_group_frames: int = ROW_GROUP_FRAMES
) -> PosesTable:
    """Make the table of samples that are in memory, and keep it there; see `poses_of_parts`."""
    return poses_of_parts(lambda: [samples], parents, Spool(Path(), sys.maxsize), row_group_frames)


def poses_of_parts(
    read: Callable[[], Iterable[Samples]],
    parents: Mapping[str, str],
    spool: Spool,
    row_group_frames: int = ROW_GROUP_FRAMES,
) -> PosesTable:
    """Check the samples and lay them out on the full grid; no row group holds two segments.

    read : gives the parts of the recording in order, from the start each time that it is called. parents : of
    a segment the one towards the body that carries a receiver, where there is one.

    Raises InputError at the first pose that has all its numbers but no unit quaternion.
    """
    names: tuple[str, ...] = ()
    queues: dict[int, _Queue] = {}
    start = 0
    for samples in read():
        names = samples.segments
        _sort_in(samples, start, queues, spool)
        start += len(samples.segment)
    present = sorted(queues)
    found = {index: _checked(index, queues[index], spool) for index in present}
    bad = [one.bad for one in found.values() if one.bad is not None]
    if bad:
        count = sum(one.bad_count for one in found.values())
        raise InputError(_quaternion_sentence(min(bad), count, read))
    frozen = _frozen_segments({names[index]: one for index, one in found.items()}, parents)
    step = max(1, _lay_grid(present, spool) // SPAN_FRAMES)
    return PosesTable(
        tuple(names[index] for index in present),
        tuple(0 if names[index] in frozen else one.usable for index, one in found.items()),
        frozen,
        _span_mm(_some_positions_mm(present, step, spool)),
        tuple(present),
        spool,
        row_group_frames,
    )


@dataclass
class _Queue:
    """What is known of a segment's rows in the spool: whether frames never fall, and the last of them."""

    ascends: bool = True
    last: int | None = None


def _sort_in(samples: Samples, start: int, queues: dict[int, _Queue], spool: Spool) -> None:
    """Put a part's samples, of which the first is number `start` of the recording, into their queues."""
    segment = samples.segment.astype(np.int16)  # which numpy sorts by counting
    order = np.argsort(segment, kind="stable")
    frame = samples.frame[order]
    counts = np.bincount(segment, minlength=1)
    edges = np.cumsum(counts)
    if not (np.delete(np.diff(frame), edges[(edges > 0) & (edges < len(frame))] - 1) >= 0).all():
        order = np.lexsort((samples.frame, segment))
        frame = samples.frame[order]
    rows = _Rows(
        order + start,
        frame,
        samples.time_s[order],
        np.take(samples.numbers.T, order, axis=1),
        _marks(samples)[order],
    )
    for index in np.flatnonzero(counts):
        own = rows.take(slice(edges[index] - counts[index], edges[index]))
        queue = queues.setdefault(int(index), _Queue())
        queue.ascends &= queue.last is None or queue.last <= own.frame[0]
        queue.last = int(own.frame[-1])
        spool.add((_RAW, int(index)), own.columns)


def _marks(samples: Samples) -> npt.NDArray[np.uint32]:
    flags = np.zeros(len(samples.segment), np.uint32)
    for flag, marked in samples.marks.items():
        flags[marked] |= _BIT[flag]
    return flags


@dataclass
class _Segment:
    """What a segment's rows say together.

    usable : rows that are valid; complete : those that have all their numbers; first : the first of these;
    moves : whether any other differs from it. bad : of the first row in the recording's own order whose
    quaternion has no length of 1: its sample, segment, frame and that length; bad_count : how many there are.
    """

    usable: int = 0
    complete: int = 0
    first: Array | None = None
    moves: bool = False
    bad: tuple[int, int, int, float] | None = None
    bad_count: int = 0

    def count(self, rows: _Rows) -> None:
        """Look at the next rows that are checked."""
        complete = _complete(rows)
        poses = rows.numbers if complete.all() else rows.numbers[:, complete]
        self.usable += int((complete & ~rows.spoilt).sum())
        self.complete += poses.shape[1]
        if self.first is None and poses.shape[1]:
            self.first = poses[:, :1].copy()
        self.moves = self.moves or bool((poses != self.first).any())


def _checked(index: int, queue: _Queue, spool: Spool) -> _Segment:
    """Move a segment's rows from the queue of what came to that of what was checked."""
    raw = (_Rows(*chunk) for chunk in spool.take((_RAW, index)))
    found = _Segment()
    last_s = -np.inf
    for rows in _whole_frames(raw if queue.ascends else _sorted(raw)):
        single = _one_a_frame(rows)
        flags, last_s = _time_flags(single.time_s, last_s)
        single = replace(single, flags=single.flags | _gap_flags(single) | flags)
        single = _with_unit_quaternions(single, index, found)
        found.count(single)
        spool.add((_CHECKED, index), single.columns)
    return found


def _sorted(chunks: Iterable[_Rows]) -> Iterator[_Rows]:
    """All rows as one chunk, by frame."""
    rows = _together(list(chunks))
    yield rows.take(np.argsort(rows.frame, kind="stable"))


def _whole_frames(chunks: Iterable[_Rows]) -> Iterator[_Rows]:
    """Cut chunks, whose frames do not fall, anew, so that none ends between two rows of a frame."""
    held: _Rows | None = None
    for chunk in chunks:
        if held is None:
            held = chunk
        elif held.frame[-1] < chunk.frame[0]:
            yield held
            held = chunk
        else:
            both = _together([held, chunk])
            last = int(np.searchsorted(both.frame, both.frame[-1]))
            if last:
                yield both.take(slice(last))
            held = both.take(slice(last, None))
    if held is not None:
        yield held


def _one_a_frame(rows: _Rows) -> _Rows:
    """Of rows of one frame keep the first, without what they do not agree on; frames do not fall."""
    first = np.ones(len(rows.frame), bool)
    first[1:] = rows.frame[1:] != rows.frame[:-1]
    if first.all():
        return rows
    kept, twin = np.flatnonzero(first), np.flatnonzero(~first)
    owner = kept[np.cumsum(first)[twin] - 1]
    time_s, numbers = rows.time_s.copy(), rows.numbers.copy()
    same_time = _same(time_s[twin], time_s[owner])
    same = same_time & _same(numbers[:, twin], numbers[:, owner]).all(0)
    time_s[owner[~same_time]] = np.nan
    numbers[:, owner[~same]] = np.nan
    flags = np.zeros(len(first), np.uint32)
    flags[owner] = _BIT["duplicate-frame"]
    flags[owner[~same]] = _BIT["conflicting-duplicate"]
    flags |= rows.flags
    np.bitwise_or.at(flags, owner, rows.flags[twin])
    return _Rows(rows.sample, rows.frame, time_s, numbers, flags).take(kept)


def _same(one: Array, other: Array) -> Bools:
    return np.asarray((one == other) | (np.isnan(one) & np.isnan(other)))


def _gap_flags(rows: _Rows) -> npt.NDArray[np.uint32]:
    if np.isfinite(rows.numbers).all():
        return np.zeros(len(rows.frame), np.uint32)
    empty = np.isnan(rows.numbers)
    some, every = empty.any(0), empty.all(0)
    told = _BIT["conflicting-duplicate"] | _BIT["partly-missing"] | _BIT["not-finite"]
    flags = np.where(every & ((rows.flags & told) == 0), _BIT["missing"], 0)
    flags |= np.where(some & ~every, _BIT["partly-missing"], 0)
    flags |= np.where(np.isinf(rows.numbers).any(0), _BIT["not-finite"], 0)
    return flags.astype(np.uint32)


def _time_flags(time_s: Array, last_s: float) -> tuple[npt.NDArray[np.uint32], float]:
    """Flags of rows, and their last known time; last_s : that of the rows before."""
    known = np.isfinite(time_s)
    flags = np.where(known, np.uint32(0), _BIT["time-missing"])
    timed = np.flatnonzero(known)
    if not len(timed):
        return flags, last_s
    times = np.concatenate([[last_s], time_s[timed]])
    flags[timed[times[1:] <= times[:-1]]] = _BIT["time-not-increasing"]
    return flags, float(times[-1])


def _with_unit_quaternions(rows: _Rows, index: int, found: _Segment) -> _Rows:
    """Bring quaternions to length 1 and empty incomplete rows; `found` gets what is no rounding error."""
    complete = np.isfinite(rows.numbers).all(0)
    numbers = rows.numbers if complete.all() else np.where(complete, rows.numbers, np.nan)
    w, x, y, z = numbers[3:]
    with np.errstate(over="ignore"):  # a number near 1e300 is refused with the norm inf
        norm = np.sqrt(w * w + x * x + y * y + z * z)
    bad = np.abs(norm - 1) > NORM_TOLERANCE + 1e-12  # False for NaN; 1e-12: rounding of the norm
    spoilt = bad & rows.spoilt
    bad &= ~spoilt
    if bad.any():
        # The first in the recording's own order: that is where its reader will look.
        row = int(np.flatnonzero(bad)[np.argmin(rows.sample[bad])])
        told = (int(rows.sample[row]), index, int(rows.frame[row]), float(norm[row]))
        found.bad = told if found.bad is None else min(found.bad, told)
        found.bad_count += int(bad.sum())
    norm[np.abs(norm - 1) < 1e-15] = 1.0  # unit to rounding: reading a poses table again turns no bit
    with np.errstate(invalid="ignore"):
        numbers = np.concatenate([numbers[:3], numbers[3:] / norm])
    if spoilt.any():
        numbers[:, spoilt] = np.nan
    return replace(rows, numbers=numbers, time_s=np.where(np.isfinite(rows.time_s), rows.time_s, np.nan))


def _complete(rows: _Rows) -> Bools:
    """Which of rows that are checked have a pose: of the others all numbers are NaN."""
    return np.asarray(np.isfinite(rows.numbers[0]))


def _quaternion_sentence(
    bad: tuple[int, int, int, float], count: int, read: Callable[[], Iterable[Samples]]
) -> str:
    sample, segment, frame, norm = bad
    place = ""
    for samples in read():
        if sample < len(samples.segment):
            place = f"{samples.place(sample)}, segment {samples.segments[segment]}"
            break
        sample -= len(samples.segment)
    more = f" (and {count - 1} more rows like it)" if count > 1 else ""
    if norm == 0:
        return (
            f"{place}, frame {frame}: the quaternion is all zeros{more}; expected norm 1; "
            "zeros that stand for missing values must be left empty instead"
        )
    return (
        f"{place}, frame {frame}: the quaternion has norm {norm:.6g}{more}; expected 1 within "
        f"{NORM_TOLERANCE}; check the column order (qw, qx, qy, qz), or leave the row's seven numbers empty "
        "to keep it as a gap"
    )


def _frozen_segments(found: Mapping[str, _Segment], parents: Mapping[str, str]) -> tuple[str, ...]:
    """Segments that never move while their parent does: no bone can, so the receiver's channel hangs.

    The base of the tree has no parent; it may well lie still, in made-up recordings to the last bit.
    """
    still = [name for name, one in found.items() if not one.moves and one.complete >= FROZEN_FRAMES]
    moving = {name for name, one in found.items() if one.moves}
    return tuple(name for name in still if parents.get(name, "") in moving)


def _lay_grid(present: Sequence[int], spool: Spool) -> int:
    """Put the frames that occur with any segment, ascending, into their queue; give how many they are."""
    frame = [part.name for part in fields(_Rows)].index("frame")
    streams = [(frames for (frames,) in spool.chunks((_CHECKED, i), [frame])) for i in present]
    buffers = [next(stream, None) for stream in streams]
    count = 0
    while there := [buffer for buffer in buffers if buffer is not None]:
        limit = min(int(buffer[-1]) for buffer in there)
        cuts = [buffer[: np.searchsorted(buffer, limit, "right")] for buffer in there]
        same = all(np.array_equal(cut, cuts[0]) for cut in cuts)
        frames = cuts[0] if same else np.unique(np.concatenate(cuts))
        spool.add(_GRID, (frames,))
        count += len(frames)
        for index, (buffer, stream) in enumerate(zip(buffers, streams, strict=True)):
            if buffer is not None:
                left = buffer[np.searchsorted(buffer, limit, "right") :]
                buffers[index] = left if len(left) else next(stream, None)
    return count


def _some_positions_mm(present: Sequence[int], step: int, spool: Spool) -> Array:
    """Positions (S, K, 3) of every segment in every step-th frame of the grid, NaN where there is none."""
    chosen, passed = [np.empty(0, np.int64)], 0
    for (frames,) in spool.chunks(_GRID):
        chosen.append(frames[-passed % step :: step])
        passed += len(frames)
    wanted = np.concatenate(chosen)
    found = np.full((len(present), len(wanted), 3), np.nan)
    for place, index in zip(found, present, strict=True):
        for rows in (_Rows(*chunk) for chunk in spool.chunks((_CHECKED, index))):
            first, last = np.searchsorted(wanted, (rows.frame[0], rows.frame[-1] + 1))
            at = np.searchsorted(rows.frame, wanted[first:last])
            hit = rows.frame[at] == wanted[first:last]
            place[first:last][hit] = rows.numbers[:3, at[hit]].T
    return found


def _span_mm(position_mm: Array) -> float:
    """Largest extent of the receivers along an axis, (S, K, 3) in, the median over frames out, mm.

    NaN where no frame has three receivers.
    """
    seen = np.isfinite(position_mm).all(-1).sum(0) >= 3
    if not seen.any():
        return float("nan")
    extent = np.nanmax(position_mm[:, seen], axis=0) - np.nanmin(position_mm[:, seen], axis=0)
    return float(np.median(extent.max(-1)))


def _cut(chunks: Iterable[Wholes], length: int) -> Iterator[Wholes]:
    """Cut arrays that follow one another anew, into arrays of that length and one of the rest."""
    held, count = [np.empty(0, np.int64)], 0
    for chunk in chunks:
        held.append(chunk)
        count += len(chunk)
        if count >= length:
            whole = np.concatenate(held)
            starts = range(0, count - count % length, length)
            yield from (whole[start : start + length] for start in starts)
            held, count = [whole[count - count % length :]], count % length
    if count:
        yield np.concatenate(held)


def _up_to(last: int, rows: _Rows, following: Iterator[_Rows]) -> tuple[_Rows, _Rows]:
    """The rows, and those that follow, whose frame is not above `last`, and the rows taken too many."""
    taken, after = [rows], rows.frame[-1] if len(rows.frame) else None
    while after is None or after <= last:
        more = next(following, None)
        if more is None:
            break
        taken.append(more)
        after = more.frame[-1]
    every = _together(taken)
    cut = int(np.searchsorted(every.frame, last, "right"))
    return every.take(slice(cut)), every.take(slice(cut, None))


def _together(chunks: Sequence[_Rows]) -> _Rows:
    there = [chunk for chunk in chunks if len(chunk.frame)] or list(chunks[:1])
    if len(there) == 1:
        return there[0]
    return _Rows(*(np.concatenate(columns, -1) for columns in zip(*(c.columns for c in there), strict=True)))


def _empty_rows() -> _Rows:
    nothing = np.empty(0, np.int64)
    return _Rows(nothing, nothing, np.empty(0), np.empty((len(NUMBERS), 0)), np.empty(0, np.uint32))


def _columns(name: str, frames: Wholes, rows: _Rows, frozen: bool) -> dict[str, Any]:
    """The table's columns of one segment in those frames, which hold those of the rows."""
    flags = rows.flags | _BIT["frozen"] if frozen else rows.flags
    valid = _complete(rows) & ~rows.spoilt & (not frozen)
    time_s, numbers = rows.time_s, rows.numbers
    if len(rows.frame) < len(frames):
        at = np.searchsorted(frames, rows.frame)
        time_s = _placed(time_s, at, np.full(len(frames), np.nan))
        numbers = _placed(numbers, at, np.full((len(NUMBERS), len(frames)), np.nan))
        flags = _placed(flags, at, np.full(len(frames), _BIT["no-row"]))
        valid = _placed(valid, at, np.zeros(len(frames), bool))
    return {
        "segment": pa.repeat(pa.scalar(name), len(frames)),
        "frame": frames,
        "time_s": time_s,
        **dict(zip(NUMBERS, numbers, strict=True)),
        "valid": valid,
        "flags": _flag_words(flags),
    }


def _placed(values: npt.NDArray[Any], at: Wholes, onto: npt.NDArray[Any]) -> npt.NDArray[Any]:
    onto[..., at] = values
    return onto


def _flag_words(flags: npt.NDArray[np.uint32]) -> pa.Array:
    """Spell out flags, joined by ';'; each combination only once, as there are few."""
    if (flags == flags[0]).all():
        return pa.repeat(pa.scalar(_flag_text(flags[0])), len(flags))
    combinations, codes = np.unique(flags, return_inverse=True)
    texts = pa.array([_flag_text(bits) for bits in combinations], pa.string())
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), texts)


def _flag_text(bits: np.uint32) -> str:
    return ";".join(flag for flag in FLAGS if bits & _BIT[flag])


def _joined(parts: Sequence[Any]) -> Any:
    if isinstance(parts[0], np.ndarray):
        return np.concatenate(parts)
    return pa.concat_arrays([part.cast(pa.string()) for part in parts])
