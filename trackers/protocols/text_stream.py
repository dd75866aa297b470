"""Records and replies in ASCII, found by how they are written."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from trackers.protocols.piecewise import Bytes, PiecewiseDecoder, gaps
from trackers.protocols.pose_numbers import fill_in
from trackers.protocols.records import Decoded, Records, Reply, concatenated, empty_records

LONGEST_REPLY = 600


@dataclass(frozen=True)
class RecordForm:
    """How the records of one output list are written.

    pattern : a whole record, its groups the numbers in turn; every repetition in it is bounded, and what
    follows the bytes that it needs never changes the match unless that reaches the end of the data.
    names : of the numbers, "" for one that is not read. longest : bytes of the longest record.
    ends_line : whether a record ends with a line end.
    """

    pattern: re.Pattern[bytes]
    names: tuple[str, ...]
    longest: int
    ends_line: bool


@dataclass(frozen=True)
class _Match:
    """A record (values, form) or a reply in the text."""

    first: int
    last: int
    station: int = 0
    error: int = 0
    form: RecordForm | None = None
    values: tuple[bytes, ...] = ()
    reply: Reply | None = None


class TextStream(PiecewiseDecoder):
    """Decoder of a stream in ASCII; a tracker says what its headers are.

    A record is what its form says from the first byte to the last, so damage costs the record that it is in
    and no other. Not every damage shows: a digit that became another one is a number as good as the first.
    """

    def __init__(
        self,
        forms: Mapping[int, RecordForm],
        head: re.Pattern[bytes],
        longest_head: int,
        replies: re.Pattern[bytes],
        begun_reply: re.Pattern[bytes],
        mm_per_unit: float,
    ) -> None:
        """Take the station's forms, and patterns: of where something may start, a reply, one cut off."""
        super().__init__()
        self._forms = forms
        self._head, self._longest_head = head, longest_head
        self._replies, self._begun_reply = replies, begun_reply
        self._mm_per_unit = mm_per_unit
        self._before = b""  # the byte before the rest: a reply starts no word's middle

    @abstractmethod
    def _header(self, text: bytes, at: int) -> tuple[int, int, int] | None:
        """Station, error letter and first byte after the header of the record that starts there, if any."""

    @abstractmethod
    def _reply(self, matched: re.Match[bytes]) -> Reply:
        """Give the reply, its offset counted in the text."""

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        shift = len(self._before)
        text = self._before + b.tobytes()
        matches: list[_Match] = []
        position = shift
        while True:
            start = self._head.search(text, position)
            at = start.start() if start else len(text)
            if not final and at + self._longest_head > len(text):
                position = max(position, min(at, len(text) - self._longest_head + 1))
                break
            if start is None:
                position = len(text)
                break
            here = self._at(text, at, final)
            if here is None:
                position = at
                break
            if here.last > at:
                matches.append(here)
            position = max(here.last, at + 1)
        if position > shift:
            self._before = text[position - 1 : position]
        return self._decoded(matches, shift, position), position - shift

    def _at(self, text: bytes, at: int, final: bool) -> _Match | None:
        """Give what starts there, an empty find for nothing, None where more bytes are needed to say."""
        header = self._header(text, at)
        if header is not None:
            station, error, body = header
            form = self._forms[station]
            matched = form.pattern.match(text, body)
            if matched and (final or form.ends_line or matched.end() < len(text)):
                return _Match(at, matched.end(), station, error, form, matched.groups())
            if not final and (matched or len(text) - at < form.longest):
                return None
        reply = self._replies.match(text, at)
        if reply:
            return _Match(at, reply.end(), reply=self._reply(reply))
        if not final and self._begun_reply.match(text, at):
            return None
        return _Match(at, at)

    def _decoded(self, matches: list[_Match], shift: int, position: int) -> Decoded:
        first = np.array([match.first - shift for match in matches], np.int64)
        last = np.array([match.last - shift for match in matches], np.int64)
        replies = tuple(replace(match.reply, offset=match.first - shift) for match in matches if match.reply)
        return Decoded(self._records(matches, shift), gaps(first, last, position - shift), replies)

    def _records(self, matches: list[_Match], shift: int) -> Records:
        by_names: dict[tuple[str, ...], list[_Match]] = {}
        for match in matches:
            if match.form:
                by_names.setdefault(match.form.names, []).append(match)
        parts = [self._records_of_form(names, some, shift) for names, some in by_names.items()]
        records = concatenated(parts)
        return records if len(parts) < 2 else records.take(np.argsort(records.offset))

    def _records_of_form(self, names: tuple[str, ...], matches: list[_Match], shift: int) -> Records:
        records = empty_records(len(matches))
        records.offset[:] = [match.first - shift for match in matches]
        records.size[:] = [match.last - match.first for match in matches]
        records.station[:] = [match.station for match in matches]
        records.error[:] = [0 if match.error == ord(" ") else match.error for match in matches]
        if not names:
            return records
        numbers = b",".join(b",".join(match.values) for match in matches).replace(b" ", b"").split(b",")
        table = np.array(numbers).astype(float).reshape(len(matches), len(names))
        columns = {name: table[:, column] for column, name in enumerate(names) if name}
        fill_in(records, columns, self._mm_per_unit)
        return records
