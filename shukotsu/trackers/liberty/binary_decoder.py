"""LIBERTY and PATRIOT in binary: bytes -> records, finding the way back after damage.

There is no checksum. A record's start is believed when it follows directly on a good one, when at its end
stands another start, or when its quaternion has length 1. Source: LIBERTY User Manual URM03PH156, reply
framing (little-endian, 8-byte header).
"""

from __future__ import annotations

import numpy as np

from shukotsu.trackers.liberty import items as liberty
from shukotsu.trackers.liberty.items import HEADER_BYTES, QUATERNION, TAGS, list_of_all, record_type
from shukotsu.trackers.protocols import records as protocol
from shukotsu.trackers.protocols.pose_numbers import fill_in
from shukotsu.trackers.protocols.records import Bools, Bytes, Decoded, PiecewiseDecoder, Records, Wholes
from shukotsu.trackers.protocols.resync import NO, YES, Starts, Verdicts, walk
from shukotsu.trackers.protocols.stream_settings import StreamSettings

_IS_RECORD = np.isin(np.arange(256), [liberty.STREAMED, liberty.SINGLE])
_IS_LETTER = np.isin(np.arange(256), list(b"\x00 abcdefgABCDEFGIu"))
"""Error letters of pose records: none, source failure by axes, BIT errors, outside the mapped area."""


class BinaryDecoder(PiecewiseDecoder):
    """Decoder of a LIBERTY or PATRIOT stream in binary; answers to commands count as skipped bytes.

    Raises InputError for output lists that are none.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        items = list_of_all(settings.items)
        self._kind = record_type(items)
        self._mm_per_unit = settings.mm_per_unit
        self._tag = TAGS[settings.family]
        self._is_station = np.isin(np.arange(256), list(settings.items))
        self._has_quaternion = QUATERNION in items
        self._trusted = False  # whether the rest begins right after a good record

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        starts = self._starts(b, final)
        decided = walk(
            starts,
            self._believed(b, starts),
            lambda index: bool(self._are_good(b, starts, np.array([index]))[0]),
            trusted=self._trusted,
        )
        self._trusted = decided.trusted
        at, end = starts.at[decided.accepted], starts.end[decided.accepted]
        return Decoded(self._records(b, at), protocol.gaps(at, end, decided.position)), decided.position

    def _starts(self, b: Bytes, final: bool) -> Starts:
        """Return the headers that can be ones."""
        heads = b[: max(0, len(b) - HEADER_BYTES + 1)]
        tagged = (heads == self._tag[0]) & (b[1 : len(heads) + 1] == self._tag[1])
        at = np.flatnonzero(tagged).astype(np.int64)
        station, command, error, reserved = (b[at + index] for index in (2, 3, 4, 5))
        body_bytes = b[at + 6].astype(np.int64) | b[at + 7].astype(np.int64) << 8
        possible = self._is_station[station] & _IS_RECORD[command] & _IS_LETTER[error] & (reserved == 0)
        at = at[possible & (HEADER_BYTES + body_bytes == self._kind.itemsize)]
        return Starts(at, self._kind.itemsize, len(b), HEADER_BYTES, final)

    def _believed(self, b: Bytes, starts: Starts) -> Verdicts:
        """Whether starts are believed on their own, (N,): linked, or with a unit quaternion."""
        believed = starts.link_verdicts.copy()
        if self._has_quaternion:
            others = np.flatnonzero(believed == NO)
            believed[others[self._are_good(b, starts, others)]] = YES
        return believed

    def _are_good(self, b: Bytes, starts: Starts, indices: Wholes) -> Bools:
        """Whether those starts are all there and their numbers can be right, (M,) both."""
        good = starts.end[indices] <= len(b)
        good[good] = ~self._records(b, starts.at[indices[good]]).doubtful
        return good

    def _records(self, b: Bytes, at: Wholes) -> Records:
        """Read the records at those bytes; nothing is checked but what cannot be right."""
        records = protocol.empty_records(len(at))
        if not len(at):
            return records
        rows = protocol.rows_at(b, at, self._kind.itemsize).view(self._kind)[:, 0]
        records.offset[:] = at
        records.size[:] = self._kind.itemsize
        records.station[:] = rows["station"]
        records.error[:] = np.where(rows["error"] == ord(" "), 0, rows["error"])
        fill_in(records, {name: rows[name] for name in self._kind.names or ()}, self._mm_per_unit)
        return records
