"""FASTRAK in ASCII: text -> records and replies.

A record is '0', the station's digit, a status character, then numbers of 7 characters each with nothing
between them ("-12.34-56.78"). Replies begin with '2'. Source: FASTRAK User Manual OPM00PI002.
"""

from __future__ import annotations

import re

from stages.capture.trackers.fastrak.items import (
    HEADER_BYTES,
    ITEMS,
    LINE_END,
    SPACE,
    STYLUS,
    field_names,
    output_lists,
)
from stages.capture.trackers.records import Reply
from stages.capture.trackers.settings import StreamSettings
from stages.capture.trackers.text_stream import LONGEST_REPLY, RecordForm, TextStream

_OF_DECIMALS = {
    2: rb"(?=[ +\-\d]{4}\.)( {0,3}[+-]? {0,3}\d{1,4}\.\d{2})",
    4: rb"(?=[ +\-\d]{2}\.)( {0,1}[+-]?\d{1,2}\.\d{4})",
}
_EXTENDED = rb" {0,8}+([+-]?\d{0,3}+\.\d{1,8}+[Ee][+-]?\d{1,3}+) {0,2}+"
_FIXED = {SPACE: rb" ", LINE_END: rb"\r\n", STYLUS: rb" ([01])"}
_LONGEST_NUMBER = 32

_HEAD = re.compile(rb"0[1-4][ A-Za-z]|(?<![!-~])2[ 1-4][!-~]")
_HEADER = re.compile(rb"0([1-4])([ A-Za-z])")
_REPLIES = re.compile(
    rb"(?<![!-~])2(?P<station>[ 1-4])(?P<command>[!-~])(?P<body>[ -~]{0,%d}\r\n)" % LONGEST_REPLY
)
_BEGUN_REPLY = re.compile(rb"(?<![!-~])2[ 1-4][!-~][ -~]{0,%d}\r?\Z" % LONGEST_REPLY)
_ERROR = re.compile(rb"\*ERROR\*.*\bEC +(-?\d{1,3})")


class TextDecoder(TextStream):
    """Decoder of a FASTRAK stream in ASCII (see `records.Decoder`).

    A reply's body is what stands after its 3 characters of header, with the line end. Raises InputError for
    unknown items.
    """

    def __init__(self, settings: StreamSettings) -> None:
        forms = {station: _form(items) for station, items in output_lists(settings).items()}
        super().__init__(forms, _HEAD, HEADER_BYTES, _REPLIES, _BEGUN_REPLY, settings.mm_per_unit)

    def _header(self, text: bytes, at: int) -> tuple[int, int, int] | None:
        matched = _HEADER.match(text, at)
        if matched is None or int(matched[1]) not in self._forms:
            return None
        return int(matched[1]), ord(matched[2]), matched.end()

    def _reply(self, matched: re.Match[bytes]) -> Reply:
        error = _ERROR.search(matched["body"])
        station = int(matched["station"].strip() or 0)
        code = int(error[1]) if error else 0
        return Reply(matched.start(), station, ord(matched["command"]), code, matched["body"])


def _form(items: tuple[int, ...]) -> RecordForm:
    parts: list[bytes] = []
    for item in items:
        if item in _FIXED:
            parts.append(_FIXED[item])
        else:
            kind = ITEMS[item]
            parts += len(kind.fields) * [_EXTENDED if kind.extended else _OF_DECIMALS[kind.decimals]]
    written = [item for item in items if item not in (SPACE, LINE_END)]
    names = [name for name in field_names(written) if name != "stylus_blank"]
    longest = HEADER_BYTES + _LONGEST_NUMBER * len(parts)
    return RecordForm(re.compile(b"".join(parts)), tuple(names), longest, items[-1] == LINE_END)
