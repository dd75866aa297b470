"""From samples to the poses table: errors are flagged or refused, and no value is invented.

Frame numbers, times and gaps are kept; samples are sorted and put on a full grid, so that every segment has
a row for every frame.

Samples arrive in parts, in the order of the recording, and the table is written segment by segment. In
between, the rows of each segment are in a temporary file, so that one segment at a time is in memory.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError
from shukotsu.readers.hemispheres import sides
from shukotsu.readers.jumps import OwnSides, breaks, exchanges, own_sides, spikes
from shukotsu.readers.samples import Samples, unwrapped_frames
from shukotsu.tables.limits import FARTHEST_MM
from shukotsu.tables.poses import NUMBERS

FLAGS = {
    "no-row": "the recording has no row for this receiver in this frame, though others have",
    "missing": "all seven numbers are empty",
    "partly-missing": "some of the seven numbers are empty",
    "not-finite": "a number is infinite",
    "out-of-reach": "the position is farther away than any tracker reaches, whatever its unit",
    "duplicate-frame": "the row stands more than once in the recording, each time the same",
    "conflicting-duplicate": "the frame stands more than once with different numbers or times",
    "time-missing": "the row has no (finite) time, or one that is years off all others",
    "time-not-increasing": "the time is not later than that of the receiver's row before",
    "frozen": "the receiver gave one and the same pose all along while that of its parent segment moved",
    "device-error": "the tracker itself reported that this pose is wrong",
    "device-warning": "the tracker reported a fault of its own with this pose, which may be right",
    "distorted": "the tracker saw its field distorted by metal",
    "hemisphere-flip": "the position is on the other side of the transmitter",
    "hemisphere-transit": "the position is on its way to the other side of the transmitter, or back",
    "hemisphere-repaired": "the position was on the other side of the transmitter and was put back",
    "hemisphere-undecided": "the receiver has poses on both sides and nothing tells which is right; kept",
    "low-quality": "the recording's own measure of quality is beyond the limit that its mapping gives",
    "misfit": "the markers of the cluster do not fit its rigid shape",
    "spike": "the pose jumped away farther than anything worn moves, and came back within five frames",
    "broken-off": "from a moment on, for good, the receiver is not where its neighbours say; or until then",
}
"""Flags of a row and their meaning; bit i stands for the i-th flag. See docs/recordings.md."""
INVALIDATING = (
    "device-error", "hemisphere-flip", "hemisphere-transit", "low-quality", "misfit", "spike", "broken-off"
)  # fmt: skip
"""Flags that make a pose unusable though its numbers are complete; they are kept."""
NORM_TOLERANCE = 0.01
"""Largest error of a quaternion's norm; more is not rounding: the columns are not a quaternion."""
WILD_TIMES = 1e6
"""Times farther from the median than this multiple of (interquartile range + 1 s) are dropped."""
TWO_RECORDINGS = 10
"""From this many consecutive duplicated frames with other poses on, a file holds two recordings."""
MANY_POSES = 20
"""Fewest poses from which coordinates that are all whole numbers are taken for a counter."""
BESIDE_MM = 200.0
"""Largest distance of neighbouring receivers on a body; a transmitter is farther away."""
FROZEN_FRAMES = 240
"""Fewest identical poses of a frozen receiver: noise changes the last digits within a second (240 Hz)."""
ROW_GROUP_FRAMES = 1 << 15
"""Two minutes at 240 Hz. A reader that goes frame by frame holds a row group of every segment in memory."""
MEMORY_BYTES = 2 << 20
"""Size from which on a segment's rows are kept in a file instead of in memory."""
IDENTITY = (1.0, 0.0, 0.0, 0.0)

_BIT = {flag: np.uint32(1 << position) for position, flag in enumerate(FLAGS)}

_INVALIDATING = np.bitwise_or.reduce([_BIT[flag] for flag in INVALIDATING])

_ROW = np.dtype(
    [("sample", "i8"), ("frame", "i8"), ("time_s", "f8"), ("numbers", "f8", len(NUMBERS)), ("flags", "u4")]
)
"""A sample of one segment; `sample` is its index in the recording."""

Rows = npt.NDArray[np.void]
Flags = npt.NDArray[np.uint32]
Places = Sequence[tuple[int, Callable[[int], str]]]


@dataclass(frozen=True)
class PosesTable:
    """The poses table, to be written a row group at a time; no row group holds two segments.

    segments : those that occur, in the layout's order; usable : of each, how many rows are valid.
    frozen : segments whose rows are flagged so.
    frame : (T,) every frame that occurs with any segment, ascending. breaks : where the recording breaks
    within itself, with what a finding says of it. notes : of the whole recording, a sentence each.
    """

    segments: tuple[str, ...]
    usable: tuple[int, ...]
    frozen: tuple[str, ...]
    frame: Integers
    breaks: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    _files: tuple[_RowFile, ...]

    def close(self) -> None:
        """Close the temporary files."""
        for file in self._files:
            file.file.close()

    def row_groups(self, row_group_frames: int = ROW_GROUP_FRAMES) -> Iterator[dict[str, Any]]:
        """Return the columns of each row group in turn."""
        for segment, file in zip(self.segments, self._files, strict=True):
            rows = file.rows()
            for start in range(0, len(self.frame), row_group_frames):
                frame = self.frame[start : start + row_group_frames]
                first = np.searchsorted(rows["frame"], frame[0])
                end = np.searchsorted(rows["frame"], frame[-1], side="right")
                yield _columns(segment, frame, rows[first:end], segment in self.frozen)


class _RowFile:
    """Rows of one segment: in memory up to MEMORY_BYTES, then in a temporary file."""

    def __init__(self, folder: Path | None) -> None:
        folder_name = None if folder is None else str(folder)
        self.file = tempfile.SpooledTemporaryFile(MEMORY_BYTES, dir=folder_name)  # noqa: SIM115

    def append(self, rows: Rows) -> None:
        """Put rows at the end."""
        self.file.write(rows.tobytes())

    def replace(self, rows: Rows) -> None:
        """Replace all rows by at most as many."""
        self.file.seek(0)
        self.file.truncate()
        self.append(rows)

    def rows(self) -> Rows:
        """Return all rows; read-only."""
        self.file.seek(0)
        return np.frombuffer(self.file.read(), _ROW)


@dataclass(frozen=True)
class _Segment:
    """Summary of the rows of one segment.

    usable : rows that are valid; complete : those that have all their numbers; moves : whether these differ.
    bad : of the first row in the recording's own order whose quaternion has no length of 1: its sample, frame
    and that length; bad_count : how many there are.
    twice : the first row whose frame stands before with another pose, as `bad`, where many frames in turn do.
    counted : the coordinate that only has whole numbers though the receiver moves; empty: none.
    sides : on which sides of the transmitter its usable poses are; None where it has none, or is optical.
    """

    usable: int
    complete: int
    moves: bool
    bad: tuple[int, int, float] | None
    bad_count: int
    twice: tuple[int, int] | None
    counted: str
    sides: OwnSides | None


def poses_table(
    parts: Iterable[Samples],
    parents: Mapping[str, str],
    folder: Path | None = None,
    *,
    expected_mm: Mapping[str, Array] | None = None,
    repair_hemisphere: bool = False,
) -> PosesTable:
    """Check the samples of a recording and lay them out on the full grid.

    parts : of the recording, in order. parents : of a segment the one towards the body that carries a
    receiver, where there is one. folder : where temporary files may be; the system's own where none is given.
    expected_mm : where anatomy has joints, see `shukotsu.readers.hemispheres.expected_joints`.
    repair_hemisphere : whether positions on the wrong side of the transmitter are put back, or are gaps.

    Raises InputError at the first pose that has all its numbers but no unit quaternion.
    """
    names: tuple[str, ...] = ()
    files: dict[int, _RowFile] = {}
    frames: list[Integers] = []
    places: list[tuple[int, Callable[[int], str]]] = []
    start = 0
    for samples in parts:
        names = samples.segments
        places.append((start, samples.locate))
        rows = np.zeros(len(samples.segment), _ROW)
        rows["sample"] = start + np.arange(len(rows))
        for name in ("frame", "time_s", "numbers"):
            rows[name] = getattr(samples, name)
        for flag, marked in samples.flags.items():
            rows["flags"][marked] |= _BIT[flag]
        for index in np.unique(samples.segment).tolist():
            files.setdefault(index, _RowFile(folder)).append(rows[samples.segment == index])
        frames.append(np.unique(samples.frame))
        start += len(samples.segment)
    notes = _count_on(files, frames)
    frame = np.unique(np.concatenate(frames))
    by_name = {names[index]: files[index] for index in sorted(files)}
    recording = _Recording({name: _check_segment(file) for name, file in by_name.items()}, by_name, parents)
    _refuse_nonsense(recording.segments, places)
    recording.put_on_one_side(expected_mm or {}, repair=repair_hemisphere)
    broken = (*recording.flag_exchanges(), *recording.flag_breaks())
    segments = recording.segments
    # No bone keeps still while its parent moves: the receiver's channel hangs, where poses are not relative
    # to it. The base of the tree has no parent; it may well lie still, in made-up recordings to the last bit.
    still = [name for name, seg in segments.items() if not seg.moves and seg.complete >= FROZEN_FRAMES]
    frozen = tuple(
        name
        for name in still
        if (up := parents.get(name, "")) in segments
        and segments[up].moves
        and not _is_reference(by_name[name], by_name[up])
    )
    return PosesTable(
        tuple(segments),
        tuple(0 if name in frozen else segment.usable for name, segment in segments.items()),
        frozen,
        frame,
        broken,
        notes,
        tuple(by_name.values()),
    )


def _count_on(files: Mapping[int, _RowFile], frames: list[Integers]) -> tuple[str, ...]:
    """Unwrap frame numbers where their counter overflowed, in the files and in the list; return a note."""
    if not any((np.diff(file.rows()["frame"]) < 0).any() for file in files.values()):
        return ()
    clocks = [tuple(file.rows()[name].copy() for name in ("frame", "time_s")) for file in files.values()]
    counted, note = unwrapped_frames(*zip(*clocks, strict=True))
    if not note:
        return ()
    for file, frame in zip(files.values(), counted, strict=True):
        rows = file.rows().copy()
        rows["frame"] = frame
        file.replace(rows)
    frames[:] = map(np.unique, counted)
    return (note,)


def _check_segment(file: _RowFile) -> _Segment:
    """Sort and flag the rows of a segment; return their summary."""
    rows = file.rows()
    rows, twice = _one_a_frame(rows[np.argsort(rows["frame"], kind="stable")])
    numbers, time_s = rows["numbers"], rows["time_s"]
    # beyond any reach: squares of such numbers overflow in what comes after
    far = (np.isfinite(numbers[:, :3]) & (np.abs(numbers[:, :3]) > FARTHEST_MM)).any(-1)
    numbers[far] = np.nan
    rows["flags"][far] |= _BIT["out-of-reach"]
    timed = np.isfinite(time_s)
    if timed.any():  # one time in a million years would be the recording's length
        low, middle, high = np.quantile(time_s[timed], (0.25, 0.5, 0.75))
        with np.errstate(over="ignore"):
            time_s[np.abs(time_s - middle) > WILD_TIMES * (high - low + 1.0)] = np.nan
    rows["flags"] |= _gap_flags(rows)
    norm, bad = _normalise(rows)
    first = min(zip(rows["sample"][bad], rows["frame"][bad], norm[bad], strict=True), default=None)
    complete = _complete(rows)
    believed = np.flatnonzero(_usable(rows))
    rows["flags"][believed[spikes(rows["numbers"][believed])]] |= _BIT["spike"]
    file.replace(rows)
    poses = rows["numbers"][complete]
    usable = rows[_usable(rows)]
    optical = bool((rows["flags"] & _BIT["misfit"]).any())  # markers, which no hemisphere mirrors
    magnetic = len(usable) > 0 and not optical
    side = own_sides(usable["frame"], usable["time_s"], usable["numbers"][:, :3]) if magnetic else None
    return _Segment(
        len(usable),
        len(poses),
        bool((poses != poses[:1]).any()),
        first,
        int(bad.sum()),
        twice,
        _whole_number_axis(poses[:, :3]),
        side,
    )


@dataclass
class _Recording:
    """Segments of a recording, as their rows are flagged so far, and the files that hold these.

    parents : of a segment the one towards the body that carries a receiver.
    """

    segments: dict[str, _Segment]
    files: Mapping[str, _RowFile]
    parents: Mapping[str, str]

    def put_on_one_side(self, expected_mm: Mapping[str, Array], *, repair: bool) -> None:
        """Flag rows on the wrong side of the transmitter, or put them back.

        Where no receiver jumped and no repair is asked for, nothing is looked at.
        """
        on_sides = {name: seg.sides for name, seg in self.segments.items() if seg.sides is not None}
        if not repair and not any(receiver.changes for receiver in on_sides.values()):
            return
        judged = sides(on_sides, self._poses, self.parents, expected_mm, all_along=repair)
        for name, side in judged.items():
            rows = self.files[name].rows().copy()
            usable = _usable(rows)
            sign = np.where(usable, side.sign(rows["frame"]), 1)
            if (sign == 1).all() and side.decided:
                continue
            rows["flags"][sign == 0] |= _BIT["hemisphere-transit"]
            rows["flags"][sign < 0] |= _BIT["hemisphere-repaired" if repair else "hemisphere-flip"]
            if repair:
                rows["numbers"][sign < 0, :3] *= -1.0
            if not side.decided:
                rows["flags"][usable & (sign != 0)] |= _BIT["hemisphere-undecided"]
            self._replace(name, rows)

    def flag_exchanges(self) -> Iterator[dict[str, Any]]:
        """Flag rows in which two receivers have exchanged names; yield the values of a finding for each."""
        for exchange in exchanges(*self._believed()):
            for name in exchange.segments:
                frame = self.files[name].rows()["frame"]
                self._break_off(name, (frame >= exchange.first) & (frame <= exchange.last))
            frames = {"number": exchange.first, "number_2": exchange.last}
            when = _when(self.files[exchange.segments[0]].rows(), exchange.frame)
            yield {"segments": list(exchange.segments), **frames, **when}

    def flag_breaks(self) -> Iterator[dict[str, Any]]:
        """Flag rows before or after a receiver's lasting shift against its neighbours; yield as exchanges."""
        before = {name: segment.usable for name, segment in self.segments.items()}
        for gap in breaks(*self._believed()):
            for name in gap.segments:
                frame = self.files[name].rows()["frame"]
                self._break_off(name, (frame < gap.frame) == gap.until)
            left = min(self.segments[name].usable / before[name] for name in gap.segments)
            seen = {"segments": list(gap.segments), "until": gap.until, "grown": gap.grown}
            when = _when(self.files[gap.segments[-1]].rows(), gap.frame)
            yield {**seen, "percent": 100 * left, **when}

    def _believed(
        self,
    ) -> tuple[list[str], Callable[[str], tuple[Integers, Array]], list[tuple[str, str]]]:
        """Return the segments with a usable pose, what reads their poses, and the joints between them."""
        names = [name for name, segment in self.segments.items() if segment.usable]
        links = [(self.parents[name], name) for name in names if self.parents.get(name, "") in names]
        return names, lambda name: self._poses(name, _BIT["hemisphere-undecided"]), links

    def _poses(self, name: str, without: np.uint32 | int = 0) -> tuple[Integers, Array]:
        """Return frames and numbers of a segment's usable rows; without : bits that none of them has."""
        rows = self.files[name].rows()
        rows = rows[_usable(rows) & ((rows["flags"] & without) == 0)]
        return rows["frame"], rows["numbers"]

    def _break_off(self, name: str, off: Bools) -> None:
        """Flag those complete rows (N,) of a segment."""
        rows = self.files[name].rows().copy()
        rows["flags"][off & _complete(rows)] |= _BIT["broken-off"]
        self._replace(name, rows)

    def _replace(self, name: str, rows: Rows) -> None:
        self.files[name].replace(rows)
        self.segments[name] = replace(self.segments[name], usable=int(_usable(rows).sum()))


def _is_reference(file: _RowFile, parent: _RowFile) -> bool:
    """Whether all poses are relative to this receiver: identity throughout, and next to its parent."""
    rows, beside = file.rows(), parent.rows()
    numbers = rows["numbers"][_complete(rows)][0]
    apart_mm = np.linalg.norm(beside["numbers"][_usable(beside), :3], axis=-1)
    at_zero = np.allclose(np.abs(numbers), [0, 0, 0, 1, 0, 0, 0], atol=1e-6)
    return bool(at_zero and len(apart_mm) and np.median(apart_mm) < BESIDE_MM)


def _when(rows: Rows, frame: int) -> dict[str, Any]:
    """Return the time of a frame in a segment's rows; for rows without times, its row number."""
    row = min(int(np.searchsorted(rows["frame"], frame)), len(rows) - 1)
    time_s = float(rows["time_s"][row])
    return {"first_s": round(time_s, 2)} if np.isfinite(time_s) else {"first_row": row + 1}


def _one_a_frame(rows: Rows) -> tuple[Rows, tuple[int, int] | None]:
    """Keep the first of the rows of a frame, without what they do not agree on; return a copy.

    Where TWO_RECORDINGS frames in turn stand twice with other poses, return the first such row's sample and
    frame, too.
    """
    rows = rows.copy()
    first = np.ones(len(rows), bool)
    first[1:] = rows["frame"][1:] != rows["frame"][:-1]
    if first.all():
        return rows, None
    kept, twin = np.flatnonzero(first), np.flatnonzero(~first)
    owner = kept[np.cumsum(first)[twin] - 1]
    same_time = _same(rows["time_s"][twin], rows["time_s"][owner])
    same = same_time & _same(rows["numbers"][twin], rows["numbers"][owner]).all(-1)
    rows["time_s"][owner[~same_time]] = np.nan
    rows["numbers"][owner[~same]] = np.nan
    np.bitwise_or.at(rows["flags"], owner, rows["flags"][twin])
    flags = np.zeros(len(rows), np.uint32)
    flags[owner] = _BIT["duplicate-frame"]
    flags[owner[~same]] = _BIT["conflicting-duplicate"]
    rows["flags"] |= flags
    other = ((rows["flags"][kept] & _BIT["conflicting-duplicate"]) != 0).astype(np.int8)
    edges = np.flatnonzero(np.diff(other, prepend=0, append=0))
    if not (edges[1::2] - edges[::2] >= TWO_RECORDINGS).any():
        return rows[kept], None
    again = twin[~same][np.argmin(rows["sample"][twin[~same]])]
    return rows[kept], (int(rows["sample"][again]), int(rows["frame"][again]))


def _same(first: Array, second: Array) -> Bools:
    return np.asarray((first == second) | (np.isnan(first) & np.isnan(second)))


def _gap_flags(rows: Rows) -> Flags:
    """Return the flags (N,) of rows with missing numbers or times, or whose time does not increase."""
    empty, time_s = np.isnan(rows["numbers"]), rows["time_s"]
    some, every, timed = empty.any(-1), empty.all(-1), np.isfinite(time_s)
    explained = ("conflicting-duplicate", "partly-missing", "not-finite", "out-of-reach")
    reasoned = (rows["flags"] & np.bitwise_or.reduce([_BIT[flag] for flag in explained])) != 0
    flags = np.where(every & ~reasoned, _BIT["missing"], 0)
    flags |= np.where(some & ~every, _BIT["partly-missing"], 0)
    flags |= np.where(np.isinf(rows["numbers"]).any(-1), _BIT["not-finite"], 0)
    flags |= np.where(timed, 0, _BIT["time-missing"])
    flags[np.flatnonzero(timed)[1:][np.diff(time_s[timed]) <= 0]] |= _BIT["time-not-increasing"]
    return flags.astype(np.uint32)


def _normalise(rows: Rows) -> tuple[Array, Bools]:
    """Bring quaternions to length 1 and empty incomplete rows.

    Return the lengths as they were, and which are off by more than rounding though the row is to be used.
    """
    numbers = rows["numbers"]
    numbers[~np.isfinite(numbers).all(-1)] = np.nan
    w, x, y, z = numbers[:, 3:].T
    with np.errstate(over="ignore"):  # a number near 1e300 is refused with the norm inf
        norm = np.sqrt(w * w + x * x + y * y + z * z)
    bad = np.abs(norm - 1) > NORM_TOLERANCE + 1e-12  # False for NaN; 1e-12: rounding of the norm
    spoilt = bad & ((rows["flags"] & _INVALIDATING) != 0)
    bad &= ~spoilt
    length = norm.copy()
    norm[np.abs(norm - 1) < 1e-15] = 1.0  # unit to rounding: reading a poses table again turns no bit
    with np.errstate(invalid="ignore"):
        numbers[:, 3:] /= norm[:, None]
    numbers[spoilt] = np.nan
    rows["time_s"][~np.isfinite(rows["time_s"])] = np.nan
    return length, bad


def _whole_number_axis(position_mm: Array) -> str:
    """Return the axis along which many positions (N, 3) only have whole numbers, of mm or inches, while they
    move along both others; empty: none. Where all are whole they are rounded.
    """
    still = np.all(position_mm == position_mm[:1], axis=0)
    for unit_mm in (1.0, 25.4) if len(position_mm) >= MANY_POSES else ():
        whole = np.all(np.abs(position_mm / unit_mm - np.round(position_mm / unit_mm)) < 1e-6, axis=0)
        for axis, name in enumerate("xyz"):
            if whole[axis] and not np.delete(still, axis).any() and (still[axis] or not whole.all()):
                return name
    return ""


def _complete(rows: Rows) -> Bools:
    """Return which of rows that are checked have a pose: of the others all numbers are NaN."""
    return np.asarray(np.isfinite(rows["numbers"][:, 0]))


def _usable(rows: Rows) -> Bools:
    """Return which of rows that are checked have a pose and no flag that makes it unusable, shape (N,)."""
    return np.asarray(_complete(rows) & ((rows["flags"] & _INVALIDATING) == 0))


def _refuse_nonsense(segments: Mapping[str, _Segment], places: Places) -> None:
    """Raise InputError at the first, in the recording's order, of what is no recording of one hand.

    Frames that stand twice in turn with other poses; quaternions of no length 1; a station's number, or a
    counter's, in place of a coordinate. places : of each part its first sample and its place.
    """

    def where(sample: int) -> str:
        start, locate = next(part for part in reversed(places) if part[0] <= sample)
        return locate(sample - start)

    twice = min(((*segment.twice, name) for name, segment in segments.items() if segment.twice), default=None)
    if twice:
        sample, frame, name = twice
        raise InputError(
            f"{where(sample)}: frame {frame} of receiver {name} stands twice with different poses, "
            "and so do those from here on: two recordings in one file? Cut it here, or give the second its "
            "own frames"
        )
    bad = min(((*segment.bad, name) for name, segment in segments.items() if segment.bad), default=None)
    if bad:
        sample, frame, norm, name = bad
        row = f"{where(sample)}, segment {name}, frame {frame}"
        count = sum(segment.bad_count for segment in segments.values())
        more = f" (and {count - 1} more rows like it)" if count > 1 else ""
        if norm == 0:
            raise InputError(
                f"{row}: the quaternion is all zeros{more}; expected norm 1; "
                "zeros that stand for missing values must be left empty instead"
            )
        raise InputError(
            f"{row}: the quaternion has norm {norm:.6g}{more}; expected 1 within "
            f"{NORM_TOLERANCE}; check the column order (qw, qx, qy, qz), or leave the row's seven numbers "
            "empty to keep it as a gap"
        )
    for name, segment in segments.items():
        if segment.counted:
            raise InputError(
                f"{where(0)}: {segment.counted} of receiver {name} is a whole number in all its poses, "
                "while it moves; expected a position, and this is probably a station or a counter: name the "
                "right columns (`shukotsu inspect` shows them)"
            )


def _columns(name: str, frame: Integers, rows: Rows, frozen: bool) -> dict[str, Any]:
    """Return the table's columns of one segment in those frames, which hold those of the rows."""
    at = np.searchsorted(frame, rows["frame"])
    time_s, numbers = np.full(len(frame), np.nan), np.full((len(NUMBERS), len(frame)), np.nan)
    flags, valid = np.full(len(frame), _BIT["no-row"]), np.zeros(len(frame), bool)
    time_s[at], numbers[:, at] = rows["time_s"], rows["numbers"].T
    flags[at] = rows["flags"] | _BIT["frozen"] if frozen else rows["flags"]
    valid[at] = _usable(rows) & (not frozen)
    combinations, codes = np.unique(flags, return_inverse=True)  # each is spelt once, as there are few
    texts = [";".join(flag for flag in FLAGS if bits & _BIT[flag]) for bits in combinations]
    return {
        "segment": pa.repeat(pa.scalar(name), len(frame)),
        "frame": frame,
        "time_s": time_s,
        **dict(zip(NUMBERS, numbers, strict=True)),
        "valid": valid,
        "flags": pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(texts, pa.string())),
    }
