"""Check samples and lay them out as the poses table: errors are flagged or refused, and no value is invented.

Frame numbers, times and gaps are kept; samples are sorted and put on a full grid, so that every segment has
a row for every frame.

Samples arrive in parts, in the order of the recording, and the table is written segment by segment. In
between, each segment's rows are kept in a temporary file, so that only one segment at a time is in memory.
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
from shukotsu.readers.jumps import OwnSides, ReceiverPoses, breaks, exchanges, own_sides, spikes
from shukotsu.readers.samples import Samples, unwrapped_frames
from shukotsu.tables.limits import FARTHEST_MM
from shukotsu.tables.poses import NUMBERS

FLAGS = {
    "no-row": "the recording has no row for this receiver in this frame, though others have",
    "missing": "all seven numbers are empty",
    "partly-missing": "some of the seven numbers are empty",
    "not-finite": "a number is infinite",
    "out-of-reach": "the position is farther away than any tracker reaches, whatever its unit",
    "duplicate-frame": "the same row occurs more than once in the recording",
    "conflicting-duplicate": "the frame occurs more than once with different numbers or times",
    "time-missing": "the row has no (finite) time, or one that is years off all others",
    "time-not-increasing": "the time is not later than that of the receiver's previous row",
    "frozen": "the receiver reported the same pose all along while its parent segment moved",
    "device-error": "the tracker itself reported that this pose is wrong",
    "device-warning": "the tracker reported a fault in itself with this pose, which may still be right",
    "distorted": "the tracker reported that metal distorts its field",
    "hemisphere-flip": "the position is on the other side of the transmitter",
    "hemisphere-transit": "the position is on its way to the other side of the transmitter, or back",
    "hemisphere-repaired": "the position was on the other side of the transmitter and was put back",
    "hemisphere-undecided": "the receiver has poses on both sides and the right side is unknown; kept",
    "low-quality": "the recording's quality measure is beyond the limit set in its mapping",
    "misfit": "the markers of the cluster do not fit its rigid shape",
    "spike": "the pose jumped away farther than a worn receiver can move, and came back within five frames",
    "broken-off": "from some frame on, or until it, the receiver's pose contradicts its neighbours",
}
"""Flags of a row and their meaning; bit i is the i-th flag. See docs/recordings.md."""
INVALIDATING = (
    "device-error", "hemisphere-flip", "hemisphere-transit", "low-quality", "misfit", "spike", "broken-off"
)  # fmt: skip
"""Flags that make a pose unusable although its numbers are complete; the numbers are kept."""
NORM_TOLERANCE = 0.01
"""Largest error of a quaternion's norm; a larger one is not rounding: the columns are not a quaternion."""
WILD_TIMES = 1e6
"""Times farther from the median than this multiple of (interquartile range + 1 s) are dropped."""
TWO_RECORDINGS = 10
"""Smallest number of consecutive duplicated frames with different poses that indicates two recordings."""
MANY_POSES = 20
"""Smallest number of poses in which a coordinate with only whole numbers is considered a counter."""
BESIDE_MM = 200.0
"""Largest distance of neighbouring receivers on a body; a transmitter is farther away."""
FROZEN_FRAMES = 240
"""Fewest identical poses of a frozen receiver: noise changes the last digits within a second (240 Hz)."""
ROW_GROUP_FRAMES = 1 << 15
"""Two minutes at 240 Hz. Reading frame by frame needs one row group of every segment in memory."""
MEMORY_BYTES = 2 << 20
"""Size above which a segment's rows are kept in a file instead of in memory."""

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
    """The poses table, to be written one row group at a time; a row group belongs to one segment.

    segments : those that occur, in the layout's order; usable : number of valid rows of each.
    frozen : segments whose rows are flagged as frozen.
    frame : (T,) all frames of any segment, ascending. breaks : the values of a finding for each break or
    exchange of receivers. notes : remarks on the whole recording, a sentence each.
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
        """Yield the columns of each row group."""
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
        """Append rows."""
        self.file.write(rows.tobytes())

    def replace(self, rows: Rows) -> None:
        """Replace all rows; rows : at most as many as there are."""
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

    usable : number of valid rows; complete : number of rows with all numbers; moves : whether these differ.
    bad : sample, frame and quaternion norm of the first row, in the recording's order, whose norm is not 1;
    bad_count : number of such rows.
    twice : sample and frame of the first row whose frame occurred before with another pose; set only if many
    consecutive frames are duplicated like that.
    counted : coordinate that has only whole numbers although the receiver moves, or "".
    sides : sides of the transmitter of its usable poses; None without such poses, or for optical markers.
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

    Parameters
    ----------
    parts : iterable of Samples
        Parts of the recording, in order.
    parents : mapping of str to str
        Of each segment, its nearest proximal segment that carries a receiver.
    folder : Path, optional
        Folder for temporary files; by default the system's.
    expected_mm : mapping, optional
        Expected joint positions, see `shukotsu.readers.hemispheres.expected_joints`.
    repair_hemisphere : bool
        Whether to put back positions on the wrong side of the transmitter; else they become gaps.

    Returns
    -------
    PosesTable
        The checked table; close it after use.

    Raises
    ------
    InputError
        At the first complete pose whose quaternion is not a unit quaternion, or if the recording is otherwise
        not one of a hand, see `_refuse_nonsense`.

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
    # No bone stays perfectly still while its parent moves: the receiver's channel hangs, unless all poses are
    # relative to it. The base of the tree has no parent; it may lie still, in simulations to the last bit.
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
    """Unwrap frame numbers, in the files and the list, if their counter overflowed; return a note of it."""
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
    # out of reach: squares of such numbers would overflow in later steps
    far = (np.isfinite(numbers[:, :3]) & (np.abs(numbers[:, :3]) > FARTHEST_MM)).any(-1)
    numbers[far] = np.nan
    rows["flags"][far] |= _BIT["out-of-reach"]
    timed = np.isfinite(time_s)
    if timed.any():  # one absurd time would stretch the recording
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
    optical = bool((rows["flags"] & _BIT["misfit"]).any())  # markers are never mirrored
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
    """Segments of a recording with their current summaries, and the files with their flagged rows.

    parents : of each segment, its nearest proximal segment that carries a receiver.
    """

    segments: dict[str, _Segment]
    files: Mapping[str, _RowFile]
    parents: Mapping[str, str]

    def put_on_one_side(self, expected_mm: Mapping[str, Array], *, repair: bool) -> None:
        """Flag rows on the wrong side of the transmitter, or put them back.

        Without a repair, nothing is done unless a receiver jumped to the other side.
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
        """Flag rows before or after a receiver's permanent break; yield the values of a finding for each."""
        before = {name: segment.usable for name, segment in self.segments.items()}
        for gap in breaks(*self._believed()):
            for name in gap.segments:
                frame = self.files[name].rows()["frame"]
                self._break_off(name, (frame < gap.frame) == gap.until)
            left = min(self.segments[name].usable / before[name] for name in gap.segments)
            seen = {"segments": list(gap.segments), "until": gap.until, "grown": gap.grown}
            when = _when(self.files[gap.segments[-1]].rows(), gap.frame)
            yield {**seen, "percent": 100 * left, **when}

    def _believed(self) -> tuple[list[str], Callable[[str], ReceiverPoses], list[tuple[str, str]]]:
        """Return the segments with usable poses, a function that reads these, and the joints between them."""
        names = [name for name, segment in self.segments.items() if segment.usable]
        links = [(self.parents[name], name) for name in names if self.parents.get(name, "") in names]
        return names, lambda name: self._poses(name, _BIT["hemisphere-undecided"]), links

    def _poses(self, name: str, without: np.uint32 | int = 0) -> ReceiverPoses:
        """Return frames and numbers of a segment's usable rows; without : bits of flags to exclude."""
        rows = self.files[name].rows()
        rows = rows[_usable(rows) & ((rows["flags"] & without) == 0)]
        return rows["frame"], rows["numbers"]

    def _break_off(self, name: str, off: Bools) -> None:
        """Flag a segment's complete rows as broken off; off : (N,) bool, which rows."""
        rows = self.files[name].rows().copy()
        rows["flags"][off & _complete(rows)] |= _BIT["broken-off"]
        self._replace(name, rows)

    def _replace(self, name: str, rows: Rows) -> None:
        self.files[name].replace(rows)
        self.segments[name] = replace(self.segments[name], usable=int(_usable(rows).sum()))


def _is_reference(file: _RowFile, parent: _RowFile) -> bool:
    """Return whether poses are relative to this receiver: its pose is the identity and its parent is near."""
    rows, parent_rows = file.rows(), parent.rows()
    numbers = rows["numbers"][_complete(rows)][0]
    apart_mm = np.linalg.norm(parent_rows["numbers"][_usable(parent_rows), :3], axis=-1)
    at_zero = np.allclose(np.abs(numbers), [0, 0, 0, 1, 0, 0, 0], atol=1e-6)
    return bool(at_zero and len(apart_mm) and np.median(apart_mm) < BESIDE_MM)


def _when(rows: Rows, frame: int) -> dict[str, Any]:
    """Return the time of a frame in a segment's rows as the value of a finding; without times, its row."""
    row = min(int(np.searchsorted(rows["frame"], frame)), len(rows) - 1)
    time_s = float(rows["time_s"][row])
    return {"first_s": round(time_s, 2)} if np.isfinite(time_s) else {"first_row": row + 1}


def _one_a_frame(rows: Rows) -> tuple[Rows, tuple[int, int] | None]:
    """Return a copy with one row per frame: the first, with NaN for numbers and times on which rows disagree.

    If TWO_RECORDINGS or more consecutive frames occur twice with different poses, also return the sample and
    frame of the first such row, else None.
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
    """Return the flags (N,) for missing numbers, missing times and times that do not increase."""
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
    """Normalise quaternions and set incomplete rows to NaN, in place.

    Return the norms before, (N,), and which of them are wrong by more than rounding in rows that are not
    already unusable, (N,).
    """
    numbers = rows["numbers"]
    numbers[~np.isfinite(numbers).all(-1)] = np.nan
    w, x, y, z = numbers[:, 3:].T
    with np.errstate(over="ignore"):  # near 1e300 the norm overflows to inf, which is refused
        norm = np.sqrt(w * w + x * x + y * y + z * z)
    bad = np.abs(norm - 1) > NORM_TOLERANCE + 1e-12  # False for NaN; 1e-12: rounding of the norm
    spoilt = bad & ((rows["flags"] & _INVALIDATING) != 0)
    bad &= ~spoilt
    length = norm.copy()
    norm[np.abs(norm - 1) < 1e-15] = 1.0  # already unit: importing a poses table again changes no bit
    with np.errstate(invalid="ignore"):
        numbers[:, 3:] /= norm[:, None]
    numbers[spoilt] = np.nan
    rows["time_s"][~np.isfinite(rows["time_s"])] = np.nan
    return length, bad


def _whole_number_axis(position_mm: Array) -> str:
    """Return the axis in which positions (N, 3) have only whole numbers of mm or inches, or "".

    Both other axes must move. Positions that are whole numbers in all axes are merely rounded.
    """
    still = np.all(position_mm == position_mm[:1], axis=0)
    for unit_mm in (1.0, 25.4) if len(position_mm) >= MANY_POSES else ():
        whole = np.all(np.abs(position_mm / unit_mm - np.round(position_mm / unit_mm)) < 1e-6, axis=0)
        for axis, name in enumerate("xyz"):
            if whole[axis] and not np.delete(still, axis).any() and (still[axis] or not whole.all()):
                return name
    return ""


def _complete(rows: Rows) -> Bools:
    """Return which checked rows have a pose, (N,); in the others all numbers are NaN."""
    return np.asarray(np.isfinite(rows["numbers"][:, 0]))


def _usable(rows: Rows) -> Bools:
    """Return which checked rows have a pose and no flag that makes it unusable, (N,)."""
    return np.asarray(_complete(rows) & ((rows["flags"] & _INVALIDATING) == 0))


def _refuse_nonsense(segments: Mapping[str, _Segment], places: Places) -> None:
    """Raise InputError if the samples cannot be a recording of one hand; name the first faulty row.

    Faults are: consecutive frames that occur twice with different poses; quaternions that are not unit; a
    station number or counter in place of a coordinate. places : for each part its first sample and its locate
    function.
    """

    def where(sample: int) -> str:
        start, locate = next(part for part in reversed(places) if part[0] <= sample)
        return locate(sample - start)

    twice = min(((*segment.twice, name) for name, segment in segments.items() if segment.twice), default=None)
    if twice:
        sample, frame, name = twice
        raise InputError(
            f"{where(sample)}: frame {frame} of receiver {name} occurs twice with different poses, "
            "and so do the following ones: two recordings in one file? Split it here, or give the second one "
            "other frame numbers"
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
                "zeros for missing values must be left empty instead"
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
                "while it moves; expected a position, but this is probably a station or a counter: name the "
                "right columns (`shukotsu inspect` shows them)"
            )


def _columns(name: str, frame: Integers, rows: Rows, frozen: bool) -> dict[str, Any]:
    """Return the table's columns of one segment; frame : frames to write, among them all of the rows'."""
    at = np.searchsorted(frame, rows["frame"])
    time_s, numbers = np.full(len(frame), np.nan), np.full((len(NUMBERS), len(frame)), np.nan)
    flags, valid = np.full(len(frame), _BIT["no-row"]), np.zeros(len(frame), bool)
    time_s[at], numbers[:, at] = rows["time_s"], rows["numbers"].T
    flags[at] = rows["flags"] | _BIT["frozen"] if frozen else rows["flags"]
    valid[at] = _usable(rows) & (not frozen)
    combinations, codes = np.unique(flags, return_inverse=True)  # few distinct combinations
    texts = [";".join(flag for flag in FLAGS if bits & _BIT[flag]) for bits in combinations]
    return {
        "segment": pa.repeat(pa.scalar(name), len(frame)),
        "frame": frame,
        "time_s": time_s,
        **dict(zip(NUMBERS, numbers, strict=True)),
        "valid": valid,
        "flags": pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(texts, pa.string())),
    }
