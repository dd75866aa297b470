"""FASTRAK in ASCII: text -> records and replies.

A record is '0', the station's digit, a status character, then numbers of 7 characters each with nothing
between them ("-12.34-56.78"). Replies begin with '2'. Source: FASTRAK User Manual OPM00PI002.
"""

from __future__ import annotations

import re

from trackers.fastrak.items import ITEMS, LINE_END, OUTPUT_ITEMS, SPACE, STYLUS
from trackers.protocols.output_items import CONSTANT_BYTES, EXTENDED
from trackers.protocols.records import Reply
from trackers.protocols.stream_settings import StreamSettings
from trackers.protocols.text_stream import LONGEST_REPLY, RecordForm, TextStream

_NUMBERS = {
    "%7.2f": rb"(?=[ +\-\d]{4}\.)( {0,3}[+-]? {0,3}\d{1,4}\.\d{2})",
    "%7.4f": rb"(?=[ +\-\d]{2}\.)( {0,1}[+-]?\d{1,2}\.\d{4})",
    EXTENDED: rb" {0,8}+([+-]?\d{0,3}+\.\d{1,8}+[Ee][+-]?\d{1,3}+) {0,2}+",
}
"""How a number is written -> what matches it."""
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
    """Decoder of a FASTRAK stream in ASCII.

    A reply's body is what stands after its 3 characters of header, with the line end. Raises InputError for
    unknown items.
    """

    def __init__(self, settings: StreamSettings) -> None:
        forms = {station: _form(items) for station, items in OUTPUT_ITEMS.checked(settings.items).items()}
        super().__init__(
            forms, _HEAD, OUTPUT_ITEMS.text_header_bytes, _REPLIES, _BEGUN_REPLY, settings.mm_per_unit
        )

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
    names: list[str] = []
    for item in items:
        fields = ITEMS[item].fields
        if item in _FIXED:
            parts.append(_FIXED[item])
        else:
            parts += len(fields) * [_NUMBERS[ITEMS[item].text[: len(ITEMS[item].text) // len(fields)]]]
        names += ["" if name in names else name for name in fields if name not in CONSTANT_BYTES]
    longest = OUTPUT_ITEMS.text_header_bytes + _LONGEST_NUMBER * len(parts)
    return RecordForm(re.compile(b"".join(parts)), tuple(names), longest, items[-1] == LINE_END)
