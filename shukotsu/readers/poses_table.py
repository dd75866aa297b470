"""Lay samples out as the poses table, and flag or refuse what only the whole recording shows to be wrong.

Frame numbers, times and gaps are kept; samples are sorted and put on a full grid, so that every segment has
a row for every frame. The rows of each segment are checked in `segment_rows`.

Samples arrive in parts, in the order of the recording, and the table is written segment by segment. In
between, each segment's rows are kept in a temporary file, so that only one segment at a time is in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError
from shukotsu.readers import segment_rows
from shukotsu.readers.breaks import Links, PosesOf, ReceiverPoses, breaks, exchanges
from shukotsu.readers.hemispheres import sides
from shukotsu.readers.samples import Locate, Samples, unwrapped_frames
from shukotsu.readers.segment_rows import BIT, RowFile, Rows, SegmentSummary, are_complete, are_usable

BESIDE_MM = 200.0
"""Largest distance of neighbouring receivers on a body; a transmitter is farther away."""
FROZEN_FRAMES = 240
"""Fewest identical poses of a frozen receiver: noise changes the last digits within a second (240 Hz)."""
ROW_GROUP_FRAMES = 1 << 15
"""Two minutes at 240 Hz. Reading frame by frame needs one row group of every segment in memory."""
Places = Sequence[tuple[int, Locate]]


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
    _files: tuple[RowFile, ...]

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
                yield segment_rows.columns_of(segment, frame, rows[first:end], segment in self.frozen)


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
    files: dict[int, RowFile] = {}
    frames: list[Integers] = []
    places: list[tuple[int, Locate]] = []
    start = 0
    for samples in parts:
        names = samples.segments
        places.append((start, samples.locate))
        rows = np.zeros(len(samples.segment), segment_rows.ROW)
        rows["sample"] = start + np.arange(len(rows))
        for name in ("frame", "time_s", "numbers"):
            rows[name] = getattr(samples, name)
        for flag, marked in samples.flags.items():
            rows["flags"][marked] |= BIT[flag]
        for index in np.unique(samples.segment).tolist():
            files.setdefault(index, RowFile(folder)).append(rows[samples.segment == index])
        frames.append(np.unique(samples.frame))
        start += len(samples.segment)
    notes = _count_on(files, frames)
    frame = np.unique(np.concatenate(frames))
    by_name = {names[index]: files[index] for index in sorted(files)}
    checked = {name: segment_rows.check_segment(file) for name, file in by_name.items()}
    recording = _Recording(checked, by_name, parents)
    _refuse_nonsense(recording.segments, places)
    recording.put_on_one_side(expected_mm or {}, repair=repair_hemisphere)
    broken = (*recording.flag_exchanges(), *recording.flag_breaks())
    segments = recording.segments
    # No bone stays perfectly still while its parent moves: the receiver's channel hangs, unless all poses are
    # relative to it. The base of the tree has no parent; it may lie still, in simulations to the last bit.
    still = [name for name, seg in segments.items() if not seg.moves and seg.complete >= FROZEN_FRAMES]
    moving = {name for name, seg in segments.items() if seg.moves}
    pairs = [(name, parents[name]) for name in still if parents.get(name, "") in moving]
    frozen = tuple(name for name, parent in pairs if not _is_reference(by_name[name], by_name[parent]))
    usable = tuple(0 if name in frozen else segment.usable for name, segment in segments.items())
    return PosesTable(tuple(segments), usable, frozen, frame, broken, notes, tuple(by_name.values()))


def _count_on(files: Mapping[int, RowFile], frames: list[Integers]) -> tuple[str, ...]:
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


@dataclass
class _Recording:
    """Segments of a recording with their current summaries, and the files with their flagged rows.

    parents : of each segment, its nearest proximal segment that carries a receiver.
    """

    segments: dict[str, SegmentSummary]
    files: Mapping[str, RowFile]
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
            usable = are_usable(rows)
            sign = np.where(usable, side.sign(rows["frame"]), 1)
            if (sign == 1).all() and side.decided:
                continue
            rows["flags"][sign == 0] |= BIT["hemisphere-transit"]
            rows["flags"][sign < 0] |= BIT["hemisphere-repaired" if repair else "hemisphere-flip"]
            if repair:
                rows["numbers"][sign < 0, :3] *= -1.0
            if not side.decided:
                rows["flags"][usable & (sign != 0)] |= BIT["hemisphere-undecided"]
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

    def _believed(self) -> tuple[list[str], PosesOf, Links]:
        """Return the segments with usable poses, a function that reads these, and the joints between them."""
        names = [name for name, segment in self.segments.items() if segment.usable]
        links = [(self.parents[name], name) for name in names if self.parents.get(name, "") in names]
        return names, lambda name: self._poses(name, BIT["hemisphere-undecided"]), links

    def _poses(self, name: str, without: np.uint32 | int = 0) -> ReceiverPoses:
        """Return frames and numbers of a segment's usable rows; without : bits of flags to exclude."""
        rows = self.files[name].rows()
        rows = rows[are_usable(rows) & ((rows["flags"] & without) == 0)]
        return rows["frame"], rows["numbers"]

    def _break_off(self, name: str, off: Bools) -> None:
        """Flag a segment's complete rows as broken off; off : (N,) bool, which rows."""
        rows = self.files[name].rows().copy()
        rows["flags"][off & are_complete(rows)] |= BIT["broken-off"]
        self._replace(name, rows)

    def _replace(self, name: str, rows: Rows) -> None:
        self.files[name].replace(rows)
        self.segments[name] = replace(self.segments[name], usable=int(are_usable(rows).sum()))


def _is_reference(file: RowFile, parent: RowFile) -> bool:
    """Return whether poses are relative to this receiver: its pose is the identity and its parent is near."""
    rows, parent_rows = file.rows(), parent.rows()
    numbers = rows["numbers"][are_complete(rows)][0]
    apart_mm = np.linalg.norm(parent_rows["numbers"][are_usable(parent_rows), :3], axis=-1)
    at_zero = np.allclose(np.abs(numbers), [0, 0, 0, 1, 0, 0, 0], atol=1e-6)
    return bool(at_zero and len(apart_mm) and np.median(apart_mm) < BESIDE_MM)


def _when(rows: Rows, frame: int) -> dict[str, Any]:
    """Return the time of a frame in a segment's rows as the value of a finding; without times, its row."""
    row = min(int(np.searchsorted(rows["frame"], frame)), len(rows) - 1)
    time_s = float(rows["time_s"][row])
    return {"first_s": round(time_s, 2)} if np.isfinite(time_s) else {"first_row": row + 1}


def _refuse_nonsense(segments: Mapping[str, SegmentSummary], places: Places) -> None:
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
            f"{segment_rows.NORM_TOLERANCE}; check the column order (qw, qx, qy, qz), or leave the row's "
            "seven numbers empty to keep it as a gap"
        )
    for name, segment in segments.items():
        if segment.counted:
            raise InputError(
                f"{where(0)}: {segment.counted} of receiver {name} is a whole number in all its poses, "
                "while it moves; expected a position, but this is probably a station or a counter: name the "
                "right columns (`shukotsu inspect` shows them)"
            )
