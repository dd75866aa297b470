"""Interface of all decoders: the settings that they need and the pose records that they return.

Decoders accept pieces of any length and keep bytes that cannot be decoded yet. No input or output.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError
from shukotsu.tables import limits
from shukotsu.tracker.families import check_family

STATIONS = frozenset(range(256))
"""Possible values of a station's byte; no tracker has this many stations."""
MM_PER_UNIT = {**limits.MM_PER_UNIT, "foot": 304.8}
TRACK = (0.0, 0.0, 0.0)
"""Hemisphere vector of a tracker that follows the receiver, so that no position flips."""


@dataclass(frozen=True)
class StreamSettings:
    """Settings of a stream that its decoder needs.

    family : a name in FAMILIES; mode : "binary"; unit : unit of positions in the stream.
    rate_hz : frames per second (of each station). stations : stations that were active at the start.
    items : station -> output list, by the item numbers of LIBERTY and PATRIOT; empty for other families.
    hemisphere : station -> vector into its hemisphere, or TRACK.
    options : further information for the user: `whoami`, settings before and after set-up, warnings.
    """

    family: str
    mode: str
    unit: str
    rate_hz: float
    stations: tuple[int, ...]
    items: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    hemisphere: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON types."""
        return asdict(self)


def settings_from_json(loaded: Any, where: str) -> StreamSettings:
    """Read settings from the output of `to_json`. Raises InputError if they are invalid."""
    try:
        if not all(isinstance(loaded[name], str) for name in ("family", "mode", "unit")):
            raise TypeError("a name is not text")
        named = loaded["family"], loaded["mode"], loaded["unit"]
        rate_hz, active = float(loaded["rate_hz"]), tuple(int(station) for station in loaded["stations"])
        lists = {int(s): tuple(int(i) for i in items) for s, items in loaded["items"].items()}
        vectors = {int(s): (float(v[0]), float(v[1]), float(v[2])) for s, v in loaded["hemisphere"].items()}
        settings = StreamSettings(*named, rate_hz, active, lists, vectors, dict(loaded.get("options", {})))
        stations = {*settings.stations, *settings.items, *settings.hemisphere}
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise InputError(f"{where}: the tracker's settings in it are damaged; copy it again") from error
    check_family(settings.family, where)
    numbers = [number for vector in vectors.values() for number in vector]
    if not stations <= STATIONS or not all(map(math.isfinite, numbers)):
        raise InputError(
            f"{where}: the tracker's settings in it name impossible stations or hemispheres; copy it again"
        )
    possible = limits.RATES_HZ[0] <= settings.rate_hz < 10_000
    if settings.mode != "binary" or settings.unit not in MM_PER_UNIT or not possible:
        raise InputError(
            f"{where}: the tracker's settings in it are not supported (family {settings.family!r}, "
            f"mode {settings.mode!r}, unit {settings.unit!r}, {settings.rate_hz} Hz)"
        )
    return settings


Bytes = npt.NDArray[np.uint8]

NONE = -1
"""Value of an integer field that the stream does not contain."""


@dataclass(frozen=True)
class Records:
    """N pose records in the order of the bytes.

    offset, size : (N,) position of the first byte in the stream, from 0, and length in bytes.
    station : (N,) the tracker's station, from 1. frame, device_ms : (N,) counters as sent (not unwrapped).
    position_mm : (N, 3); quaternion : (N, 4) w, x, y, z, as sent (not normalised), receiver to transmitter
    frame; NaN if the stream does not contain it.
    error : (N,) code of the error letter, 0 for none. distortion, button, sync : (N,) as sent.
    doubtful : (N,) whether a correctly framed record has impossible numbers.
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
        """Return the selected records."""
        return Records(*(getattr(self, part.name)[rows] for part in fields(self)))


def empty_records(count: int = 0) -> Records:
    """Return N records without values: floats NaN, integers NONE, errors 0, none doubtful."""
    poses = {"position_mm": np.full((count, 3), np.nan), "quaternion": np.full((count, 4), np.nan)}
    zeros = {"error": np.zeros(count, np.int64), "doubtful": np.zeros(count, bool)}
    columns: dict[str, Any] = poses | zeros
    return Records(*(columns.get(part.name, np.full(count, NONE, np.int64)) for part in fields(Records)))


def concatenate_records(parts: Sequence[Records]) -> Records:
    """Concatenate records."""
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
    """An answer of the tracker, which is not a pose record.

    station : of LIBERTY and PATRIOT, otherwise 0. command : command byte that it answers; error : code of its
    error letter or number, 0 for none.
    """

    offset: int
    station: int
    command: int
    error: int
    body: bytes


@dataclass(frozen=True)
class Decoded:
    """Records, skipped bytes and replies in one piece of a stream."""

    records: Records
    skipped: tuple[Skipped, ...] = ()
    replies: tuple[Reply, ...] = ()


class PiecewiseDecoder(ABC):
    """Decoder of a stream of bytes, piece by piece, into records; keeps bytes that cannot be decoded yet.

    offset : number of bytes that have been decoded; the kept ones follow. All records, skips and replies
    together do not depend on how the stream is cut into pieces.
    """

    def __init__(self) -> None:
        self.offset = 0
        self._rest = np.empty(0, np.uint8)

    def feed(self, data: bytes, *, final: bool = False) -> Decoded:
        """Decode the next piece; final : whether it is the last, so that no bytes are kept."""
        b = np.concatenate([self._rest, np.frombuffer(data, np.uint8)])
        decoded, decided = self._decide(b, final)
        first, self.offset = self.offset, self.offset + decided
        self._rest = b[decided:].copy()
        decoded.records.offset[:] += first
        skipped = (replace(skip, offset=skip.offset + first) for skip in decoded.skipped)
        replies = (replace(reply, offset=reply.offset + first) for reply in decoded.replies)
        return Decoded(decoded.records, tuple(skipped), tuple(replies))

    @abstractmethod
    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        """Decode the buffer `b`; return its content, with offsets in b, and the number of decided bytes.

        Bytes whose meaning may still change with later bytes are undecided, unless `final`.
        """


def rows_at(b: Bytes, at: Integers, size: int) -> Bytes:
    """Return the bytes of N equally long stretches, (N, size); a view if they are contiguous."""
    if len(at) > 1 and (np.diff(at) == size).all():
        return b[at[0] : at[-1] + size].reshape(-1, size)
    return np.lib.stride_tricks.sliding_window_view(b, size)[at]


def gaps(first: Integers, last: Integers, length: int) -> tuple[Skipped, ...]:
    """Return the parts of [0, length) outside the ascending, disjoint intervals [first, last)."""
    pairs = zip([0, *last.tolist()], [*first.tolist(), length], strict=True)
    return tuple(Skipped(start, end - start) for start, end in pairs if end > start)


NORM_TOLERANCE = 1e-3
TRACKER_RANGE_MM = 3048.0
"""120 inches, beyond the range of any magnetic tracker of this kind."""


def doubtful_poses(records: Records) -> Bools:
    """Return whether poses are impossible: not finite, not unit quaternions, or out of range, (N,)."""
    far_mm2 = np.einsum("ij,ij->i", records.position_mm, records.position_mm)
    norm2 = np.einsum("ij,ij->i", records.quaternion, records.quaternion)
    return np.asarray(~(far_mm2 <= TRACKER_RANGE_MM**2) | ~(np.abs(norm2 - 1) <= 2 * NORM_TOLERANCE))
