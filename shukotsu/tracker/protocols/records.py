"""What every decoder is, and what it gives: pose records with their offsets in the stream, and skipped bytes.

Pieces of any length go in; undecided bytes are kept for the next. No I/O.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.hand.rotations import about_axis, from_matrix, multiply

Array = npt.NDArray[np.float64]
Wholes = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]

NONE = -1
"""Stands in a record's whole numbers for "the stream does not say"."""


@dataclass(frozen=True)
class Records:
    """N pose records in the order of the bytes.

    offset, size : (N,) first byte in the stream, counted from 0 at its start, and length in bytes.
    station : (N,) the tracker's station, from 1. frame, device_ms : (N,) counters as sent (not unwrapped).
    position_mm : (N, 3); quaternion : (N, 4) w, x, y, z, as sent (not brought to length 1), receiver to
    transmitter frame; NaN where the stream has none.
    error : (N,) the code of the error letter, 0 for none. distortion, button, sync : (N,) as sent.
    doubtful : (N,) framed as a record should be, but its numbers cannot be right.
    """

    offset: Wholes
    size: Wholes
    station: Wholes
    frame: Wholes
    device_ms: Wholes
    position_mm: Array
    quaternion: Array
    error: Wholes
    distortion: Wholes
    button: Wholes
    sync: Wholes
    doubtful: Bools

    def __len__(self) -> int:
        return len(self.offset)

    def take(self, rows: Wholes | Bools | slice) -> Records:
        """Return some of the records."""
        return Records(*(getattr(self, part.name)[rows] for part in fields(self)))


def empty_records(count: int = 0) -> Records:
    """Return records of which nothing is said yet: numbers NaN, whole numbers NONE, nothing doubtful."""
    poses = {"position_mm": np.full((count, 3), np.nan), "quaternion": np.full((count, 4), np.nan)}
    zeros = {"error": np.zeros(count, np.int64), "doubtful": np.zeros(count, bool)}
    columns: dict[str, Any] = poses | zeros
    return Records(*(columns.get(part.name, np.full(count, NONE, np.int64)) for part in fields(Records)))


def concatenated(parts: Sequence[Records]) -> Records:
    """Return all records, one after the other."""
    if len(parts) < 2:
        return parts[0] if parts else empty_records()
    return Records(*(np.concatenate([getattr(p, part.name) for p in parts]) for part in fields(Records)))


@dataclass(frozen=True)
class Skipped:
    """Bytes that belong to no record or reply."""

    offset: int
    size: int


@dataclass(frozen=True)
class Reply:
    """An answer of the tracker that is no pose record.

    command : the command byte that it answers; error : the code of its error letter or number, 0 for none.
    """

    offset: int
    station: int
    command: int
    error: int
    body: bytes


@dataclass(frozen=True)
class Decoded:
    """What one piece of a stream gave."""

    records: Records
    skipped: tuple[Skipped, ...] = ()
    replies: tuple[Reply, ...] = ()


PIECE_BYTES = 1 << 18
"""Longer pieces are decoded in parts, so that the memory that decoding takes has a bound."""


class PiecewiseDecoder(ABC):
    """Turns a stream of bytes, given piece by piece, into records; keeps what it cannot decide yet.

    However the stream is cut into pieces, the records, skips and replies in total are the same. Decided is on
    whole buffers of at most PIECE_BYTES and a rest.
    """

    def __init__(self) -> None:
        self._rest = np.empty(0, np.uint8)
        self._offset = 0  # of the rest's first byte in the stream

    def feed(self, data: bytes | Bytes, *, final: bool = False) -> Decoded:
        """Decode the next piece; `final` says that nothing follows, so that the rest is decided too."""
        piece = data if isinstance(data, np.ndarray) else np.frombuffer(data, np.uint8)
        records: list[Records] = []
        skipped: list[Skipped] = []
        replies: list[Reply] = []
        starts = range(0, len(piece), PIECE_BYTES) or (0,)
        for start in starts:
            part = piece[start : start + PIECE_BYTES]
            b = np.concatenate([self._rest, part]) if len(self._rest) else part
            decoded, decided = self._decide(b, final and start == starts[-1])
            first, self._offset = self._offset, self._offset + decided
            self._rest = b[decided:].copy()
            decoded.records.offset[:] += first
            records.append(decoded.records)
            skipped += (replace(skip, offset=skip.offset + first) for skip in decoded.skipped)
            replies += (replace(reply, offset=reply.offset + first) for reply in decoded.replies)
        return Decoded(concatenated(records), tuple(skipped), tuple(replies))

    @abstractmethod
    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        """Decode `b`; return what is in it, offsets counted in b, and how many of its bytes are decided.

        What more bytes could change is not decided yet, unless `final` says that none follow.
        """


def rows_at(b: Bytes, at: Wholes, size: int) -> Bytes:
    """Return the bytes of stretches of one size, (N, size); no copy where they stand one after the other."""
    if len(at) > 1 and (np.diff(at) == size).all():
        return b[at[0] : at[-1] + size].reshape(-1, size)
    return np.lib.stride_tricks.sliding_window_view(b, size)[at]


def gaps(first: Wholes, last: Wholes, length: int) -> tuple[Skipped, ...]:
    """Return the stretches of 0..length that none of the ascending, disjoint stretches first..last covers."""
    pairs = zip([0, *last.tolist()], [*first.tolist(), length], strict=True)
    return tuple(Skipped(start, end - start) for start, end in pairs if end > start)


ROTATION_TOLERANCE = 1e-2
"""How far R^T R may be off the identity, element by element: more than rounding of its float32."""

NORM_TOLERANCE = 1e-3
FARTHEST_MM = 3048.0
"""120 inches: no magnetic tracker of this kind sees farther."""

_AXES = "xyz"
_COUNTERS = ("frame", "device_ms", "button", "distortion", "sync")
_MOST = {"button": 1, "distortion": 2, "sync": 1}


def fill_in(records: Records, numbers: Mapping[str, np.ndarray], mm_per_unit: float) -> None:
    """Put the numbers into records of which they are all that is not known yet.

    numbers : name -> (N,), any of x, y, z; qw, qx, qy, qz; azimuth, elevation, roll in degrees; cosine_xx to
    cosine_zz; frame, device_ms, button, distortion, sync. Other names are not read.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs, and floats beyond any tracker
        position = "x" in numbers
        if position:
            for column, axis in enumerate(_AXES):
                np.multiply(numbers[axis], mm_per_unit, out=records.position_mm[:, column], dtype=float)
        quaternion = None
        if "qw" in numbers:
            quaternion = np.stack([numbers[f"q{part}"] for part in "wxyz"], -1, dtype=float)
        elif "azimuth" in numbers:
            angles = [numbers[name] for name in ("azimuth", "elevation", "roll")]
            quaternion = quaternion_of_angles(np.stack(angles, -1, dtype=float))
        elif "cosine_xx" in numbers:
            cosines = [numbers[f"cosine_{row}{column}"] for row in _AXES for column in _AXES]
            quaternion = quaternion_of_cosines(np.stack(cosines, -1, dtype=float).reshape(-1, 3, 3))
        if quaternion is not None:
            records.quaternion[:] = quaternion
        for name in _COUNTERS:
            if name in numbers:
                getattr(records, name)[:] = numbers[name]
        records.doubtful[:] = doubtful_poses(records, position=position, orientation=quaternion is not None)
    for name, most in _MOST.items():
        if name in numbers:
            values = getattr(records, name)
            records.doubtful[:] |= (values < 0) | (values > most)


def doubtful_poses(
    records: Records, *, position: bool = True, orientation: bool = True
) -> npt.NDArray[np.bool_]:
    """Whether poses cannot be right, (N,): not finite, no unit quaternion, farther than FARTHEST_MM.

    position, orientation : whether the stream has them; what it does not have is no reason.
    """
    wrong = np.zeros(len(records), bool)
    if position:
        squared = np.einsum("ij,ij->i", records.position_mm, records.position_mm)
        wrong |= ~(squared <= FARTHEST_MM**2)
    if orientation:
        squared = np.einsum("ij,ij->i", records.quaternion, records.quaternion)
        wrong |= ~(np.abs(squared - 1) <= 2 * NORM_TOLERANCE)
    return wrong


def quaternion_of_angles(angles_deg: Array) -> Array:
    """Return unit quaternions of azimuth, elevation and roll, R = Rz(azimuth) Ry(elevation) Rx(roll).

    angles_deg : (N, 3). Returns (N, 4) w, x, y, z; NaN where an angle is not finite. Source: LIBERTY User
    Manual URM03PH156, attitude matrix; VIPER uses the same angles.
    """
    finite = np.isfinite(angles_deg).all(-1, keepdims=True)
    azimuth, elevation, roll = np.radians(np.where(finite, angles_deg, np.nan)).T
    x, y, z = np.eye(3)
    return multiply(multiply(about_axis(z, azimuth), about_axis(y, elevation)), about_axis(x, roll))


def quaternion_of_cosines(cosines: Array) -> Array:
    """Return unit quaternions (w >= 0) of direction cosines, whose columns are the receiver's axes.

    cosines : (N, 3, 3). Returns (N, 4); NaN where the matrix is no rotation: a number is not finite, it is
    mirrored, or R^T R is off the identity by more than ROTATION_TOLERANCE.
    """
    bounded: npt.NDArray[np.bool_] = np.all(np.abs(cosines) < 2, axis=(-2, -1))  # False for NaN too
    matrices = np.where(bounded[:, None, None], cosines, np.eye(3))
    off = np.abs(np.swapaxes(matrices, -1, -2) @ matrices - np.eye(3)).max((-2, -1))
    proper = bounded & (off <= ROTATION_TOLERANCE) & (np.linalg.det(matrices) > 0)
    matrices[~proper] = np.eye(3)
    return np.where(proper[:, None], from_matrix(matrices), np.nan)
