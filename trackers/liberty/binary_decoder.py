"""LIBERTY and PATRIOT in binary: bytes -> records, finding the way back after damage.

There is no checksum. A record's start is believed when it follows directly on a good one, when at its end
stands another start, or when its quaternion has length 1. Source: LIBERTY User Manual URM03PH156, reply
framing (little-endian, 8-byte header).
"""

from __future__ import annotations

import numpy as np

from trackers.liberty.items import (
    HEADER_BYTES,
    MAX_BODY_BYTES,
    OUTPUT_ITEMS,
    QUATERNION,
    SINGLE,
    STREAMED,
    TAGS,
)
from trackers.protocols.output_items import read_binary_records
from trackers.protocols.piecewise import Bytes, PiecewiseDecoder, gaps
from trackers.protocols.records import (
    Decoded,
    Records,
    Reply,
    Wholes,
    concatenated,
    empty_records,
    stations_in,
)
from trackers.protocols.resync import NO, YES, Bools, Starts, Verdicts, walk
from trackers.protocols.stream_settings import StreamSettings

_IS_RECORD = np.isin(np.arange(256), [STREAMED, SINGLE])
_IS_REPLY = np.isin(np.arange(256), [*b"ABDFGHLNOQRUXYZ@", *(set(range(2, 27)) - {13})])
_IS_LETTER = np.isin(np.arange(256), list(b"\x00 abcdefgABCDEFGIu"))
"""Error letters of pose records: none, source failure by axes, BIT errors, outside the mapped area."""


class BinaryDecoder(PiecewiseDecoder):
    """Decoder of a LIBERTY or PATRIOT stream in binary.

    Raises InputError for output lists that are none.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        self._items = OUTPUT_ITEMS.checked(settings.items, range(256))
        self._mm_per_unit = settings.mm_per_unit
        self._tag = TAGS[settings.family]
        self._sizes = np.full(256, -1, np.int64)  # of each station's records, and whether a norm proves them
        self._proving = np.zeros(256, bool)
        for station, items in self._items.items():
            self._sizes[station] = OUTPUT_ITEMS.record_bytes(items)
            self._proving[station] = QUATERNION in items
        self._trusted = False  # whether the rest begins right after a good record

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        starts, is_record = self._starts(b, final)
        decided = walk(
            starts,
            self._believed(b, starts, is_record),
            lambda index: self._are_good(b, starts, np.array([index]), is_record)[0],
            trusted=self._trusted,
        )
        self._trusted = decided.trusted
        accepted = decided.accepted
        at, end, of_record = starts.at[accepted], starts.end[accepted], is_record[accepted]
        others = zip(at[~of_record].tolist(), end[~of_record].tolist(), strict=True)
        replies = tuple(_reply(b, first, last) for first, last in others)
        skipped = gaps(at, end, decided.position)
        return Decoded(self._records(b, at[of_record]), skipped, replies), decided.position

    def _starts(self, b: Bytes, final: bool) -> tuple[Starts, Bools]:
        """Find the headers that can be ones, and which are of records."""
        heads = b[: max(0, len(b) - HEADER_BYTES + 1)]
        tagged = (heads == self._tag[0]) & (b[1 : len(heads) + 1] == self._tag[1])
        at = np.flatnonzero(tagged).astype(np.int64)
        station, command, error, reserved = (b[at + place] for place in (2, 3, 4, 5))
        body_bytes = b[at + 6].astype(np.int64) | b[at + 7].astype(np.int64) << 8
        size = HEADER_BYTES + body_bytes
        is_record = _IS_RECORD[command] & (size == self._sizes[station]) & _IS_LETTER[error]
        is_reply = (
            _IS_REPLY[command] & (station <= OUTPUT_ITEMS.stations[-1]) & (body_bytes <= MAX_BODY_BYTES)
        )
        possible = (reserved == 0) & (is_record | is_reply)
        at = at[possible]
        return Starts(at, at + size[possible], len(b), HEADER_BYTES, final), is_record[possible]

    def _believed(self, b: Bytes, starts: Starts, is_record: Bools) -> Verdicts:
        """Whether starts are believed on their own, (N,): linked, or with a unit quaternion."""
        believed = starts.link_verdicts.copy()
        others = np.flatnonzero(believed == NO)
        others = others[is_record[others] & self._proving[b[starts.at[others] + 2]]]
        believed[others[self._are_good(b, starts, others, is_record)]] = YES
        return believed

    def _are_good(self, b: Bytes, starts: Starts, indices: Wholes, is_record: Bools) -> Bools:
        """Whether those starts are all there and their numbers can be right, (M,) both."""
        good = starts.end[indices] <= len(b)
        whole = np.flatnonzero(is_record[indices] & good)
        good[whole] = ~self._records(b, starts.at[indices[whole]]).doubtful
        return good

    def _records(self, b: Bytes, at: Wholes) -> Records:
        """Read the records that start at `at`, those of one output list at a time."""
        if not len(at):
            return empty_records()
        station = b[at + 2].astype(np.int64)
        parts = []
        for items in sorted({self._items[number] for number in stations_in(station)}):
            mine = np.isin(station, [number for number, own in self._items.items() if own == items])
            parts.append(read_binary_records(b, at[mine], OUTPUT_ITEMS.record_type(items), self._mm_per_unit))
        records = concatenated(parts)
        return records if len(parts) == 1 else records.take(np.argsort(records.offset))


def _reply(b: Bytes, at: int, end: int) -> Reply:
    station, command, error = (int(b[at + place]) for place in (2, 3, 4))
    error = 0 if error == ord(" ") else error
    return Reply(at, station, command, error, b[at + HEADER_BYTES : end].tobytes())
