"""LIBERTY and PATRIOT in binary: bytes -> records, finding the way back after damage.

There is no checksum. A record's start is believed when it follows directly on a good one, or when at its end
stands another start. Source: LIBERTY User Manual URM03PH156, reply framing (little-endian, 8-byte header).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.capture.trackers.chain import Starts, Stream, starts_of, walk
from stages.capture.trackers.liberty.body import read_bodies
from stages.capture.trackers.liberty.items import (
    HEADER_BYTES,
    QUATERNION,
    SINGLE,
    STATIONS,
    STREAMED,
    TAGS,
    body_bytes,
    check_items,
)
from stages.capture.trackers.records import (
    Decoded,
    Records,
    Reply,
    Skipped,
    concatenated,
    empty_records,
    stations_in,
)
from stages.capture.trackers.settings import StreamSettings

Bytes = npt.NDArray[np.uint8]
Wholes = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

MAX_BODY_BYTES = 2800
"""The longest reply (a stored configuration) has 2384 bytes; a longer one is none."""

_LETTERS = frozenset(b"\x00 abcdefgABCDEFGIu")
"""Error letters of pose records: none, source failure by axes, BIT errors, outside the mapped area."""
_RECORDS = frozenset((STREAMED, SINGLE))
_REPLIES = frozenset(b"ABDFGHLNOQRUXYZ@") | frozenset(range(2, 27)) - {13}


_IS_RECORD = np.isin(np.arange(256), list(_RECORDS))
_IS_REPLY = np.isin(np.arange(256), list(_REPLIES))
_IS_LETTER = np.isin(np.arange(256), list(_LETTERS))


class BinaryDecoder:
    """Decoder of a LIBERTY or PATRIOT stream in binary (see `records.Decoder`)."""

    def __init__(self, settings: StreamSettings) -> None:
        self._items = dict(settings.items)
        self._mm_per_unit = settings.mm_per_unit
        self._tag = TAGS[settings.family]
        self._sizes = np.full(256, -1, np.int64)
        self._proving = np.zeros(256, bool)  # of each station, whether its records have a norm to check
        for station, items in settings.items.items():
            check_items(items)
            if 0 <= station < 256:
                self._sizes[station] = body_bytes(items)
                self._proving[station] = QUATERNION in items
        self._rest = np.empty(0, np.uint8)
        self._offset = 0  # of the rest's first byte in the stream
        self._trusted = False  # whether the rest begins right after a good record

    def feed(self, data: bytes | Bytes, *, final: bool = False) -> Decoded:
        """Decode the next piece of the stream."""
        piece = np.frombuffer(data, np.uint8) if isinstance(data, bytes | bytearray) else data
        b = np.concatenate([self._rest, piece]) if len(self._rest) else piece
        starts, is_record = self._starts(b)
        stream = Stream(
            starts,
            len(b),
            final,
            HEADER_BYTES,
            HEADER_BYTES + MAX_BODY_BYTES,
            doubtful=lambda indices: self._are_doubtful(b, starts, indices, is_record),
            provable=lambda indices: is_record[indices] & self._proving[b[starts.at[indices] + 2]],
        )
        walked = walk(stream, trusted=self._trusted)
        accepted = walked.accepted
        of_record = is_record[accepted]
        records = self._records(b, starts.at[accepted[of_record]])
        replies = [self._reply(b, starts, int(index)) for index in accepted[~of_record]]
        skipped = tuple(Skipped(self._offset + first, last - first) for first, last in walked.skipped)
        self._rest = b[walked.position :].copy()
        self._offset += walked.position
        self._trusted = walked.trusted
        return Decoded(records, skipped, tuple(replies))

    def _starts(self, b: Bytes) -> tuple[Starts, Bools]:
        """Find the headers that can be ones, and which are of records."""
        heads = b[: max(0, len(b) - HEADER_BYTES + 1)]
        tagged = (heads == self._tag[0]) & (b[1 : len(heads) + 1] == self._tag[1])
        at = np.flatnonzero(tagged).astype(np.int64)
        station, command, error, reserved = (b[at + place] for place in (2, 3, 4, 5))
        size = b[at + 6].astype(np.int64) | b[at + 7].astype(np.int64) << 8
        is_record = _IS_RECORD[command] & (size == self._sizes[station]) & _IS_LETTER[error]
        is_reply = _IS_REPLY[command] & (station <= STATIONS[-1]) & (size <= MAX_BODY_BYTES)
        possible = (reserved == 0) & (is_record | is_reply)
        at = at[possible]
        return starts_of(at, at + HEADER_BYTES + size[possible]), is_record[possible]

    def _are_doubtful(self, b: Bytes, starts: Starts, indices: Wholes, is_record: Bools) -> Bools:
        """Whether the numbers of those starts cannot be right or are cut off, (M,) both."""
        bad = starts.end[indices] > len(b)
        whole = np.flatnonzero(is_record[indices] & ~bad)
        bad[whole] = self._records(b, starts.at[indices[whole]]).doubtful
        return bad

    def _records(self, b: Bytes, at: Wholes) -> Records:
        """Read the records that start at `at`, those of one output list at a time."""
        if not len(at):
            return empty_records()
        station = b[at + 2].astype(np.int64)
        parts = []
        for items in sorted({self._items[number] for number in stations_in(station)}):
            mine = np.isin(station, [number for number, own in self._items.items() if own == items])
            parts.append(read_bodies(b, at[mine], items, self._mm_per_unit, self._offset))
        records = concatenated(parts)
        return records if len(parts) == 1 else records.take(np.argsort(records.offset))

    def _reply(self, b: Bytes, starts: Starts, index: int) -> Reply:
        at, end = int(starts.at[index]), int(starts.end[index])
        station, command, error = (int(b[at + place]) for place in (2, 3, 4))
        error = 0 if error == ord(" ") else error
        return Reply(self._offset + at, station, command, error, b[at + HEADER_BYTES : end].tobytes())
