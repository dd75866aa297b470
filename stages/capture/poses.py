"""From samples to the poses table: what is wrong is flagged or refused, and nothing is made up.

Frames, times and gaps stay as they came; samples are put in order and onto a full grid, so that every
segment has a row for every frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas.errors import InputError
from schemas.tables import ROW_GROUP_ROWS
from stages.capture.samples import NUMBERS, Samples

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

SPAN_FRAMES = 1000
"""Frames, spread over the recording, from which the extent of the receivers is told."""

_BIT = {flag: np.uint32(1 << position) for position, flag in enumerate(FLAGS)}

_INVALIDATING = np.bitwise_or.reduce([_BIT[flag] for flag in INVALIDATING])

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class PosesTable:
    """The columns of the poses table and how to cut them into row groups.

    segments : those that occur, in the layout's order; usable : of each, how many rows are valid.
    frozen : segments whose rows are flagged so. span_mm : how far apart the receivers are, NaN where unknown.
    """

    columns: dict[str, Any]
    row_groups: list[int]
    segments: tuple[str, ...]
    usable: tuple[int, ...]
    frozen: tuple[str, ...]
    span_mm: float


@dataclass(frozen=True)
class _Rows:
    """Samples by segment, then frame, one a frame; `sample` is where each stood in the recording."""

    sample: npt.NDArray[np.int64]
    segment: npt.NDArray[np.int64]
    frame: npt.NDArray[np.int64]
    time_s: npt.NDArray[np.float64]
    numbers: npt.NDArray[np.float64]
    flags: npt.NDArray[np.uint32]

    @property
    def complete(self) -> Bools:
        """Whether all seven numbers are there, shape (N,)."""
        return np.asarray(np.isfinite(self.numbers).all(-1))

    @property
    def spoilt(self) -> Bools:
        """Whether the reader marked the pose as unusable, shape (N,)."""
        return np.asarray((self.flags & _INVALIDATING) != 0)


def poses_table(
    samples: Samples, parents: Mapping[str, str], row_group_frames: int = ROW_GROUP_ROWS
) -> PosesTable:
    """Check the samples and lay them out on the full grid; no row group holds two segments.

    parents : of a segment the one towards the body that carries a receiver, where there is one.

    Raises InputError at the first pose that has all its numbers but no unit quaternion.
    """
    rows = _one_a_frame(samples)
    rows = replace(rows, flags=rows.flags | _gap_flags(rows) | _time_flags(rows))
    rows = _with_unit_quaternions(rows, samples)
    frozen = _frozen_segments(rows, samples.segments, parents)
    rows.flags[np.isin(rows.segment, frozen)] |= _BIT["frozen"]
    return _on_grid(rows, samples, frozen, row_group_frames)


def _one_a_frame(samples: Samples) -> _Rows:
    """Sort; of rows of one segment and frame keep the first, without what they do not agree on."""
    order = np.lexsort((samples.frame, samples.segment))
    segment, frame = samples.segment[order], samples.frame[order]
    time_s, numbers = samples.time_s[order], samples.numbers[order]
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(segment) != 0) | (np.diff(frame) != 0)
    kept = np.flatnonzero(first)
    twin = np.flatnonzero(~first)
    owner = kept[np.cumsum(first)[twin] - 1]
    same_time = _same(time_s[twin], time_s[owner])
    same = same_time & _same(numbers[twin], numbers[owner]).all(-1)
    time_s[owner[~same_time]] = np.nan
    numbers[owner[~same]] = np.nan
    flags = np.zeros(len(order), np.uint32)
    flags[owner] = _BIT["duplicate-frame"]
    flags[owner[~same]] = _BIT["conflicting-duplicate"]
    marks = _marks(samples)[order]
    flags |= marks
    np.bitwise_or.at(flags, owner, marks[twin])
    return _Rows(order[kept], segment[kept], frame[kept], time_s[kept], numbers[kept], flags[kept])


def _marks(samples: Samples) -> npt.NDArray[np.uint32]:
    flags = np.zeros(len(samples.segment), np.uint32)
    for flag, marked in samples.marks.items():
        flags[marked] |= _BIT[flag]
    return flags


def _same(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> Bools:
    return np.asarray((one == other) | (np.isnan(one) & np.isnan(other)))


def _gap_flags(rows: _Rows) -> npt.NDArray[np.uint32]:
    empty = np.isnan(rows.numbers)
    some, every = empty.any(-1), empty.all(-1)
    told = _BIT["conflicting-duplicate"] | _BIT["partly-missing"] | _BIT["not-finite"]
    flags = np.where(every & ((rows.flags & told) == 0), _BIT["missing"], 0)
    flags |= np.where(some & ~every, _BIT["partly-missing"], 0)
    flags |= np.where(np.isinf(rows.numbers).any(-1), _BIT["not-finite"], 0)
    return flags.astype(np.uint32)


def _time_flags(rows: _Rows) -> npt.NDArray[np.uint32]:
    known = np.isfinite(rows.time_s)
    flags = np.where(known, 0, _BIT["time-missing"])
    timed = np.flatnonzero(known)
    before, after = timed[:-1], timed[1:]
    stuck = (rows.segment[before] == rows.segment[after]) & (rows.time_s[after] <= rows.time_s[before])
    flags[after[stuck]] = _BIT["time-not-increasing"]
    return flags.astype(np.uint32)


def _with_unit_quaternions(rows: _Rows, samples: Samples) -> _Rows:
    """Bring quaternions to length 1 and empty the incomplete rows; refuse what is no rounding error."""
    numbers = np.where(rows.complete[:, None], rows.numbers, np.nan)
    with np.errstate(over="ignore"):  # a number near 1e300 is refused with the norm inf
        norm = np.linalg.norm(numbers[:, 3:], axis=-1)
    bad = np.abs(norm - 1) > NORM_TOLERANCE + 1e-12  # False for NaN; 1e-12: rounding of the norm
    numbers[bad & rows.spoilt] = np.nan
    bad &= ~rows.spoilt
    if bad.any():
        # The first in the recording's own order: that is where its reader will look.
        row = int(np.flatnonzero(bad)[np.argmin(rows.sample[bad])])
        raise InputError(_quaternion_sentence(rows, row, float(norm[row]), int(bad.sum()), samples))
    norm[np.abs(norm - 1) < 1e-15] = 1.0  # unit to rounding: reading a poses table again turns no bit
    with np.errstate(invalid="ignore"):
        numbers[:, 3:] /= norm[:, None]
    return replace(rows, numbers=numbers, time_s=np.where(np.isfinite(rows.time_s), rows.time_s, np.nan))


def _quaternion_sentence(rows: _Rows, row: int, norm: float, count: int, samples: Samples) -> str:
    place = f"{samples.place(int(rows.sample[row]))}, segment {samples.segments[rows.segment[row]]}"
    more = f" (and {count - 1} more rows like it)" if count > 1 else ""
    if norm == 0:
        return (
            f"{place}, frame {rows.frame[row]}: the quaternion is all zeros{more}; expected norm 1; "
            "zeros that stand for missing values must be left empty instead"
        )
    return (
        f"{place}, frame {rows.frame[row]}: the quaternion has norm {norm:.6g}{more}; expected 1 within "
        f"{NORM_TOLERANCE}; check the column order (qw, qx, qy, qz), or leave the row's seven numbers empty "
        "to keep it as a gap"
    )


def _frozen_segments(rows: _Rows, names: Sequence[str], parents: Mapping[str, str]) -> npt.NDArray[np.int64]:
    """Segments that never move while their parent does: no bone can, so the receiver's channel hangs.

    The base of the tree has no parent; it may well lie still, in made-up recordings to the last bit.
    """
    moves: dict[str, bool] = {}
    counts: dict[str, int] = {}
    for segment in np.unique(rows.segment):
        poses = rows.numbers[(rows.segment == segment) & rows.complete]
        moves[names[segment]] = bool((poses != poses[:1]).any())
        counts[names[segment]] = len(poses)
    still = [name for name, moving in moves.items() if not moving and counts[name] >= FROZEN_FRAMES]
    return np.array([names.index(name) for name in still if moves.get(parents.get(name, ""))], np.int64)


def _on_grid(
    rows: _Rows, samples: Samples, frozen: npt.NDArray[np.int64], row_group_frames: int
) -> PosesTable:
    frames = np.unique(rows.frame)
    present = np.unique(rows.segment)
    names = tuple(samples.segments[segment] for segment in present)
    cells = len(present) * len(frames)
    at = np.searchsorted(present, rows.segment) * len(frames) + np.searchsorted(frames, rows.frame)
    numbers = np.full((cells, len(NUMBERS)), np.nan)
    numbers[at] = rows.numbers
    time_s = np.full(cells, np.nan)
    time_s[at] = rows.time_s
    flags = np.full(cells, _BIT["no-row"])
    flags[at] = rows.flags
    valid = np.zeros(cells, bool)
    valid[at] = rows.complete & ~rows.spoilt & ~np.isin(rows.segment, frozen)
    columns = {
        "segment": _words(np.repeat(np.arange(len(present)), len(frames)), names),
        "frame": np.tile(frames, len(present)),
        "time_s": time_s,
        **{name: numbers[:, index] for index, name in enumerate(NUMBERS)},
        "valid": valid,
        "flags": _flag_words(flags),
    }
    usable = valid.reshape(len(present), -1).sum(-1)
    whole = [row_group_frames] * (len(frames) // row_group_frames)
    rest = [len(frames) % row_group_frames] if len(frames) % row_group_frames else []
    return PosesTable(
        columns,
        (whole + rest) * len(present),
        names,
        tuple(int(count) for count in usable),
        tuple(samples.segments[segment] for segment in frozen),
        _span_mm(numbers.reshape(len(present), len(frames), -1)[..., :3]),
    )


def _span_mm(position_mm: npt.NDArray[np.float64]) -> float:
    """Largest extent of the receivers along an axis, (S, T, 3) in, the median over frames out, mm.

    NaN where no frame has three receivers.
    """
    some = position_mm[:, :: max(1, position_mm.shape[1] // SPAN_FRAMES)]
    seen = np.isfinite(some).all(-1).sum(0) >= 3
    if not seen.any():
        return float("nan")
    extent = np.nanmax(some[:, seen], axis=0) - np.nanmin(some[:, seen], axis=0)
    return float(np.median(extent.max(-1)))


def _flag_words(flags: npt.NDArray[np.uint32]) -> pa.Array:
    """Spell out flags, joined by ';'; each combination only once, as there are few."""
    combinations, codes = np.unique(flags, return_inverse=True)
    texts = [";".join(flag for flag in FLAGS if bits & _BIT[flag]) for bits in combinations]
    return _words(codes, texts)


def _words(codes: npt.NDArray[np.int64], words: tuple[str, ...] | list[str]) -> pa.Array:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(list(words), pa.string()))
