"""What every decoder is, and what it gives: pose records with their offsets in the stream, and skipped bytes.

Pieces of any length go in; undecided bytes are kept for the next. No I/O.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.tracker.families import StreamSettings

Bytes = npt.NDArray[np.uint8]

NONE = -1
"""Value of a whole number that the stream does not contain."""


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

    offset: Integers
    size: Integers
    station: Integers
    frame: Integers
    device_ms: Integers
    position_mm: Array
    quaternion: Array
    error: Integers
    distortion: Integers
    button: Integers
    sync: Integers
    doubtful: Bools

    def __len__(self) -> int:
        return len(self.offset)

    def take(self, rows: Integers | Bools | slice) -> Records:
        """Return some of the records."""
        return Records(*(getattr(self, part.name)[rows] for part in fields(self)))


def empty_records(count: int = 0) -> Records:
    """Return N records without values: numbers NaN, integers NONE, none doubtful."""
    poses = {"position_mm": np.full((count, 3), np.nan), "quaternion": np.full((count, 4), np.nan)}
    zeros = {"error": np.zeros(count, np.int64), "doubtful": np.zeros(count, bool)}
    columns: dict[str, Any] = poses | zeros
    return Records(*(columns.get(part.name, np.full(count, NONE, np.int64)) for part in fields(Records)))


def concatenate_records(parts: Sequence[Records]) -> Records:
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
"""Longer pieces are decoded in parts, which bounds the memory of decoding."""


class PiecewiseDecoder(ABC):
    """Decodes a stream of bytes, piece by piece, into records; keeps bytes that cannot be decoded yet.

    The records, skips and replies in total do not depend on how the stream is cut. Decoding works on buffers
    of at most PIECE_BYTES plus the rest of the one before.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self._settings = settings
        self._rest = np.empty(0, np.uint8)
        self._offset = 0  # of the rest's first byte in the stream

    def feed(self, data: bytes | Bytes, *, final: bool = False) -> Decoded:
        """Decode the next piece; with `final` nothing follows and the rest is decoded too."""
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
        return Decoded(concatenate_records(records), tuple(skipped), tuple(replies))

    @abstractmethod
    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        """Decode `b`; return what is in it, offsets counted in b, and how many of its bytes are decided.

        Bytes whose meaning could change with more bytes are kept, unless `final`.
        """


def rows_at(b: Bytes, at: Integers, size: int) -> Bytes:
    """Return the bytes of stretches of one size, (N, size); no copy where they stand one after the other."""
    if len(at) > 1 and (np.diff(at) == size).all():
        return b[at[0] : at[-1] + size].reshape(-1, size)
    return np.lib.stride_tricks.sliding_window_view(b, size)[at]


def gaps(first: Integers, last: Integers, length: int) -> tuple[Skipped, ...]:
    """Return the stretches of 0..length that none of the ascending, disjoint stretches first..last covers."""
    pairs = zip([0, *last.tolist()], [*first.tolist(), length], strict=True)
    return tuple(Skipped(start, end - start) for start, end in pairs if end > start)


NORM_TOLERANCE = 1e-3
TRACKER_RANGE_MM = 3048.0
"""120 inches, beyond the range of any magnetic tracker of this kind."""


def doubtful_poses(records: Records) -> Bools:
    """Whether poses (N,) are impossible: not finite, not a unit quaternion, or beyond the tracker's range."""
    far_mm2 = np.einsum("ij,ij->i", records.position_mm, records.position_mm)
    norm2 = np.einsum("ij,ij->i", records.quaternion, records.quaternion)
    return np.asarray(~(far_mm2 <= TRACKER_RANGE_MM**2) | ~(np.abs(norm2 - 1) <= 2 * NORM_TOLERANCE))
