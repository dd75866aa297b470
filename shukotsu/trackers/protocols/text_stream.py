"""Records in ASCII, found by how they are written."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder, gaps
from shukotsu.trackers.protocols.pose_numbers import fill_in
from shukotsu.trackers.protocols.records import Bytes, Decoded, Records, empty_records


@dataclass(frozen=True)
class RecordForm:
    """Hold how records are written.

    header : the start of one. pattern : all that follows, its groups the numbers in turn; every repetition in
    it is bounded, and what follows the bytes that it needs never changes the match unless that reaches the
    end of the data. names : of the numbers, "" for one that is not read. longest_header, longest : bytes of
    the longest header and record. ends_line : whether a record ends with a line end.
    """

    header: re.Pattern[bytes]
    longest_header: int
    pattern: re.Pattern[bytes]
    names: tuple[str, ...]
    longest: int
    ends_line: bool


@dataclass(frozen=True)
class _Match:
    """A record in the text."""

    first: int
    last: int
    station: int
    error: int
    values: tuple[bytes, ...]


class TextStream(PiecewiseDecoder):
    """Decoder of a stream in ASCII; a tracker says what its headers are.

    A record is what its form says from the first byte to the last, so damage costs the record that it is in
    and no other. Not every damage shows: a digit that became another one is a number as good as the first.
    Answers to commands count as skipped bytes.
    """

    def __init__(self, form: RecordForm, stations: Collection[int], mm_per_unit: float) -> None:
        super().__init__()
        self._form, self._stations, self._mm_per_unit = form, stations, mm_per_unit

    @abstractmethod
    def _read_header(self, header: re.Match[bytes]) -> tuple[int, int, int]:
        """Station, error letter and first byte after the header."""

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        text, form = b.tobytes(), self._form
        matches: list[_Match] = []
        position = 0
        while True:
            header = form.header.search(text, position)
            at = header.start() if header else len(text)
            if not final and at + form.longest_header > len(text):
                position = max(position, min(at, len(text) - form.longest_header + 1))
                break
            if header is None:
                position = len(text)
                break
            station, error, body = self._read_header(header)
            known = station in self._stations
            record = form.pattern.match(text, body) if known else None
            if record and (final or form.ends_line or record.end() < len(text)):
                matches.append(_Match(at, record.end(), station, error, record.groups()))
                position = record.end()
            elif known and not final and (record or len(text) - at < form.longest):
                position = at
                break
            else:
                position = at + 1
        first, last = (
            np.array([getattr(match, end) for match in matches], np.int64) for end in ("first", "last")
        )
        return Decoded(self._records(matches), gaps(first, last, position)), position

    def _records(self, matches: list[_Match]) -> Records:
        names = self._form.names
        records = empty_records(len(matches))
        records.offset[:] = [match.first for match in matches]
        records.size[:] = [match.last - match.first for match in matches]
        records.station[:] = [match.station for match in matches]
        records.error[:] = [0 if match.error == ord(" ") else match.error for match in matches]
        if not (matches and names):
            return records
        numbers = b",".join(b",".join(match.values) for match in matches).replace(b" ", b"").split(b",")
        table = np.array(numbers).astype(float).reshape(len(matches), len(names))
        columns = {name: table[:, column] for column, name in enumerate(names) if name}
        fill_in(records, columns, self._mm_per_unit)
        return records
