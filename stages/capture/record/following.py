"""Decoding what comes while it comes, for the eyes only: the archive is decoded anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.capture.decode.counting import Counter
from stages.capture.record.reader import Chunk
from stages.capture.trackers.families import decoder_of
from stages.capture.trackers.records import Records, empty_records
from stages.capture.trackers.settings import StreamSettings


@dataclass(frozen=True)
class Seen:
    """Records of one look: frames unwrapped; host_ns (N,) when each had come; odd (N,) not to be believed."""

    records: Records
    host_ns: npt.NDArray[np.int64]
    odd: npt.NDArray[np.bool_]
    skipped_bytes: int = 0


NOTHING = Seen(empty_records(), np.empty(0, np.int64), np.zeros(0, bool))


class Follower:
    """Decodes a stream along."""

    def __init__(self, settings: StreamSettings) -> None:
        self._decoder = decoder_of(settings)
        self._counter = Counter(settings)
        self._length = 0
        self._ends: list[int] = []
        self._arrivals: list[int] = []

    def look(self, chunks: Sequence[Chunk], *, final: bool = False) -> Seen:
        """Decode what came since the last look."""
        if not (chunks or final):
            return NOTHING
        for chunk in chunks:
            self._length += len(chunk.data)
            self._ends.append(self._length)
            self._arrivals.append(chunk.host_ns)
        decoded = self._decoder.feed(b"".join(chunk.data for chunk in chunks), final=final)
        records = decoded.records
        if len(records):
            arrival = np.searchsorted(self._ends, records.offset + records.size)
            host_ns = np.array(self._arrivals, np.int64)[arrival]
            del self._ends[: int(arrival[-1])], self._arrivals[: int(arrival[-1])]
        else:
            host_ns = np.empty(0, np.int64)
        records, host_ns, odd = self._counter.number(decoded, host_ns, final=final)
        skipped = sum(part.size for part in decoded.skipped)
        return Seen(records, host_ns, odd | records.doubtful, skipped)
