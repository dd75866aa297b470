"""LIBERTY and PATRIOT in binary: bytes -> records, from start to start, and back into step after damage.

There is no checksum. A start is a byte where a header stands that can be one. It is believed when it follows
directly on a good record, when at its end stands another start, or when its quaternion has length 1. So
garbage between records costs nothing, and a byte that is lost or changed costs the record that it was in and
no other. Source: LIBERTY User Manual URM03PH156, reply framing (little-endian, 8-byte header).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shukotsu.tracker import liberty_replies as liberty
from shukotsu.tracker import records as protocol
from shukotsu.tracker.families import MM_PER_UNIT, StreamSettings
from shukotsu.tracker.liberty_replies import HEADER_BYTES, TAGS
from shukotsu.tracker.records import Bools, Bytes, Decoded, Records, Wholes, doubtful_poses

_IS_RECORD = np.isin(np.arange(256), [liberty.STREAMED, liberty.SINGLE])
_IS_LETTER = np.isin(np.arange(256), list(b"\x00 abcdefgABCDEFGIu"))
"""Error letters of pose records: none, source failure by axes, BIT errors, outside the mapped area."""
NO, UNKNOWN, YES = 0, 1, 2

_MOST = {"frame": None, "device_ms": None, "button": 1, "distortion": 2, "sync": 1}
"""What a record has beside its pose, and the most that it can be."""
"""Whether a start is believed; UNKNOWN where more bytes are needed to say."""


class BinaryDecoder(protocol.PiecewiseDecoder):
    """Decoder of a LIBERTY or PATRIOT stream in binary; answers to commands count as skipped bytes.

    Raises InputError for output lists that are none.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__(settings)
        self._kind = liberty.record_type(liberty.list_of_all(settings.items))
        self._mm_per_unit = MM_PER_UNIT[settings.unit]
        self._tag = TAGS[settings.family]
        self._is_station = np.isin(np.arange(256), list(settings.items))
        self._trusted = False  # whether the rest begins right after a good record

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        at, size = self._starts(b), self._kind.itemsize

        def are_good(indices: Wholes) -> Bools:
            """Whether starts are all there and their numbers can be right, (M,) both."""
            good = at[indices] + size <= len(b)
            good[good] = ~self._records(b, at[indices[good]]).doubtful
            return good

        walk = _Walk(at, size, len(b), final, are_good)
        others = np.flatnonzero(walk.believed == NO)
        walk.believed[others[are_good(others)]] = YES
        walk.trusted = self._trusted
        accepted = walk.accepted()
        self._trusted = walk.trusted
        first = at[accepted]
        skipped = protocol.gaps(first, first + size, walk.position)
        return Decoded(self._records(b, first), skipped), walk.position

    def _starts(self, b: Bytes) -> Wholes:
        """Return the bytes of headers that can be ones, ascending."""
        heads = b[: max(0, len(b) - HEADER_BYTES + 1)]
        tagged = (heads == self._tag[0]) & (b[1 : len(heads) + 1] == self._tag[1])
        at = np.flatnonzero(tagged).astype(np.int64)
        station, command, error, reserved = (b[at + index] for index in (2, 3, 4, 5))
        body_bytes = b[at + 6].astype(np.int64) | b[at + 7].astype(np.int64) << 8
        possible = self._is_station[station] & _IS_RECORD[command] & _IS_LETTER[error] & (reserved == 0)
        return np.asarray(at[possible & (HEADER_BYTES + body_bytes == self._kind.itemsize)])

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
        with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs, and floats beyond any tracker
            for column, axis in enumerate("xyz"):
                np.multiply(rows[axis], self._mm_per_unit, out=records.position_mm[:, column], dtype=float)
            records.quaternion[:] = np.stack([rows[f"q{part}"] for part in "wxyz"], -1, dtype=float)
            records.doubtful[:] = doubtful_poses(records)
        for name, most in _MOST.items():
            if name in (self._kind.names or ()):
                values = getattr(records, name)
                values[:] = rows[name]
                records.doubtful[:] |= False if most is None else (values < 0) | (values > most)
        return records


class _Walk:
    """A walk over a piece of a stream of `length` bytes; `final` : nothing follows it.

    at : (N,) where a record of `size` bytes may start. are_good() : whether starts are all there and their
    numbers can be right. believed : (N,) whether a start is believed though nothing good stands before it.
    position : all before it is decided. trusted : whether a record that starts there is believed.

    What the piece is too short to decide is left for the next one, so that the outcome does not depend on
    where a stream is cut.
    """

    def __init__(
        self, at: Wholes, size: int, length: int, final: bool, are_good: Callable[[Wholes], Bools]
    ) -> None:
        self.position, self.trusted = 0, False
        self._at, self._end, self._length, self._final = at, at + size, length, final
        self._are_good = are_good
        index = np.searchsorted(at, self._end)
        self._following = np.where(np.append(at, -1)[index] == self._end, index, -1)  # -1: no start there
        self._linked = (self._following >= 0) | ((self._end == length) & final)
        self._cut = (self._end + HEADER_BYTES > length) & (not final)
        self.believed = np.where(self._linked, YES, np.where(self._cut, UNKNOWN, NO))

    def accepted(self) -> Wholes:
        """Walk; return the indices of the accepted starts, ascending."""
        runs = [np.empty(0, np.int64)]
        believable = np.flatnonzero(self.believed)
        breaks = np.flatnonzero(self._following != np.arange(1, len(self._at) + 1))
        # Where less than a header is left nothing is decided, not even that no record starts there.
        shortest = 1 if self._final else HEADER_BYTES
        while self.position + shortest <= self._length:
            index = int(np.searchsorted(self._at, self.position))
            if self.trusted and index < len(self._at) and self._at[index] == self.position:
                last = int(breaks[np.searchsorted(breaks, index)])
                self.position = int(self._at[last])
                is_record, goes_on = self._judge(last)
                runs.append(np.arange(index, last + is_record))
            else:
                goes_on = self._search(believable[np.searchsorted(believable, index) :])
            if not goes_on:
                break
        return np.concatenate(runs)

    def _judge(self, index: int) -> tuple[bool, bool]:
        """Whether a trusted start is a record that the next in the list does not simply follow; False for
        the second to wait for more.
        """
        at, end = int(self._at[index]), int(self._end[index])
        if self._linked[index]:
            self.position = end
            return True, True
        if self._cut[index]:
            return False, False
        inside = self.believed[index + 1 : int(np.searchsorted(self._at, end))]
        within = np.flatnonzero(inside) + index + 1
        if len(within):  # the next record starts before this one's end: bytes of this one are missing
            if self.believed[within[0]] == UNKNOWN:
                return False, False
            self.position = int(self._at[within[0]])
            return False, True
        # Either all of it is there, and what follows is garbage or has a damaged header; or it is none.
        is_record = bool(self._are_good(np.array([index]))[0])
        self.position, self.trusted = end if is_record else at + 1, False
        return is_record, True

    def _search(self, believable: Wholes) -> bool:
        """Skip to the next start that can be believed; False to wait for more."""
        self.trusted = False
        if not len(believable):
            rest = 0 if self._final else HEADER_BYTES - 1  # where the first bytes of a header may stand
            self.position = max(self.position, self._length - rest)
            return False
        self.position = int(self._at[believable[0]])
        self.trusted = bool(self.believed[believable[0]] == YES)
        return self.trusted
