"""The output of every decoder: pose records with their offsets in the stream, and skipped bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

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
    columns = {part.name: np.full(count, NONE, np.int64) for part in fields(Records)}
    poses = {"position_mm": np.full((count, 3), np.nan), "quaternion": np.full((count, 4), np.nan)}
    flags = {"error": np.zeros(count, np.int64), "doubtful": np.zeros(count, bool)}
    return Records(**(columns | poses | flags))


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
