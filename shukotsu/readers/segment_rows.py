"""The rows of one segment of a recording: checked, flagged, kept in memory or in a temporary file.

Errors are flagged, and no value is invented. Sorted and checked rows have one row per frame.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.readers.jumps import OwnSides, own_sides, spikes
from shukotsu.tables.limits import FARTHEST_MM
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.typed_table import repeated

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
MEMORY_BYTES = 2 << 20
"""Size above which a segment's rows are kept in a file instead of in memory."""

BIT = {flag: np.uint32(1 << position) for position, flag in enumerate(FLAGS)}

_INVALIDATING = np.bitwise_or.reduce([BIT[flag] for flag in INVALIDATING])

ROW = np.dtype(
    [("sample", "i8"), ("frame", "i8"), ("time_s", "f8"), ("numbers", "f8", len(NUMBERS)), ("flags", "u4")]
)
"""A sample of one segment; `sample` is its index in the recording."""

Rows = npt.NDArray[np.void]
Flags = npt.NDArray[np.uint32]


class RowFile:
    """Rows of one segment: in memory up to MEMORY_BYTES, then in a temporary file."""

    def __init__(self, folder: Path | None) -> None:
        self.file = tempfile.SpooledTemporaryFile(MEMORY_BYTES, dir=None if folder is None else str(folder))  # noqa: SIM115

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
        return np.frombuffer(self.file.read(), ROW)


@dataclass(frozen=True)
class SegmentSummary:
    """Summary of the checked rows of one segment.

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


def check_segment(file: RowFile) -> SegmentSummary:
    """Sort and flag the rows of a segment; return their summary."""
    rows = file.rows()
    rows, twice = _one_a_frame(rows[np.argsort(rows["frame"], kind="stable")])
    numbers, time_s = rows["numbers"], rows["time_s"]
    # out of reach: squares of such numbers would overflow in later steps
    far = (np.isfinite(numbers[:, :3]) & (np.abs(numbers[:, :3]) > FARTHEST_MM)).any(-1)
    numbers[far] = np.nan
    rows["flags"][far] |= BIT["out-of-reach"]
    timed = np.isfinite(time_s)
    if timed.any():  # one absurd time would stretch the recording
        low, middle, high = np.quantile(time_s[timed], (0.25, 0.5, 0.75))
        with np.errstate(over="ignore"):
            time_s[np.abs(time_s - middle) > WILD_TIMES * (high - low + 1.0)] = np.nan
    rows["flags"] |= _gap_flags(rows)
    norm, bad = _normalise(rows)
    first = min(zip(rows["sample"][bad], rows["frame"][bad], norm[bad], strict=True), default=None)
    complete = are_complete(rows)
    believed = np.flatnonzero(are_usable(rows))
    rows["flags"][believed[spikes(rows["numbers"][believed])]] |= BIT["spike"]
    file.replace(rows)
    poses = rows["numbers"][complete]
    usable = rows[are_usable(rows)]
    optical = bool((rows["flags"] & BIT["misfit"]).any())  # markers are never mirrored
    magnetic = len(usable) > 0 and not optical
    side = own_sides(usable["frame"], usable["time_s"], usable["numbers"][:, :3]) if magnetic else None
    moves, counted = bool((poses != poses[:1]).any()), _whole_number_axis(poses[:, :3])
    return SegmentSummary(len(usable), len(poses), moves, first, int(bad.sum()), twice, counted, side)


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
    flags[owner] = BIT["duplicate-frame"]
    flags[owner[~same]] = BIT["conflicting-duplicate"]
    rows["flags"] |= flags
    other = ((rows["flags"][kept] & BIT["conflicting-duplicate"]) != 0).astype(np.int8)
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
    reasoned = (rows["flags"] & np.bitwise_or.reduce([BIT[flag] for flag in explained])) != 0
    flags = np.where(every & ~reasoned, BIT["missing"], 0)
    flags |= np.where(some & ~every, BIT["partly-missing"], 0)
    flags |= np.where(np.isinf(rows["numbers"]).any(-1), BIT["not-finite"], 0)
    flags |= np.where(timed, 0, BIT["time-missing"])
    flags[np.flatnonzero(timed)[1:][np.diff(time_s[timed]) <= 0]] |= BIT["time-not-increasing"]
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


def are_complete(rows: Rows) -> Bools:
    """Return which checked rows have a pose, (N,); in the others all numbers are NaN."""
    return np.asarray(np.isfinite(rows["numbers"][:, 0]))


def are_usable(rows: Rows) -> Bools:
    """Return which checked rows have a pose and no flag that makes it unusable, (N,)."""
    return np.asarray(are_complete(rows) & ((rows["flags"] & _INVALIDATING) == 0))


def columns_of(name: str, frame: Integers, rows: Rows, frozen: bool) -> dict[str, Any]:
    """Return the table's columns of one segment; frame : frames to write, among them all of the rows'."""
    at = np.searchsorted(frame, rows["frame"])
    time_s, numbers = np.full(len(frame), np.nan), np.full((len(NUMBERS), len(frame)), np.nan)
    flags, valid = np.full(len(frame), BIT["no-row"]), np.zeros(len(frame), bool)
    time_s[at], numbers[:, at] = rows["time_s"], rows["numbers"].T
    flags[at] = rows["flags"] | BIT["frozen"] if frozen else rows["flags"]
    valid[at] = are_usable(rows) & (not frozen)
    combinations, codes = np.unique(flags, return_inverse=True)  # few distinct combinations
    texts = [";".join(flag for flag in FLAGS if bits & BIT[flag]) for bits in combinations]
    return {
        "segment": repeated(name, len(frame)),
        "frame": frame,
        "time_s": time_s,
        **dict(zip(NUMBERS, numbers, strict=True)),
        "valid": valid,
        "flags": pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(texts, pa.string())),
    }
