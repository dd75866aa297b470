"""FASTRAK in ASCII: text -> records.

A record is '0', the station's digit, a status character, then numbers of 7 characters each with nothing
between them ("-12.34-56.78"). Source: FASTRAK User Manual OPM00PI002.
"""

from __future__ import annotations

import re

from shukotsu.trackers.fastrak.items import ITEMS, LINE_END, OUTPUT_ITEMS, SPACE, STYLUS
from shukotsu.trackers.protocols.output_items import CONSTANT_BYTES, EXTENDED
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.protocols.text_stream import RecordForm, TextStream

_NUMBERS = {
    "%7.2f": rb"(?=[ +\-\d]{4}\.)( {0,3}[+-]? {0,3}\d{1,4}\.\d{2})",
    "%7.4f": rb"(?=[ +\-\d]{2}\.)( {0,1}[+-]?\d{1,2}\.\d{4})",
    EXTENDED: rb" {0,8}+([+-]?\d{0,3}+\.\d{1,8}+[Ee][+-]?\d{1,3}+) {0,2}+",
}
"""How a number is written -> what matches it."""
_FIXED = {SPACE: rb" ", LINE_END: rb"\r\n", STYLUS: rb" ([01])"}
_LONGEST_NUMBER = 32

_HEADER = re.compile(rb"0([1-4])([ A-Za-z])")


class TextDecoder(TextStream):
    """Decoder of a FASTRAK stream in ASCII. Raises InputError for unknown items."""

    def __init__(self, settings: StreamSettings) -> None:
        form = _form(OUTPUT_ITEMS.one_list(settings.items))
        super().__init__(form, settings.items, settings.mm_per_unit)

    def _read_header(self, header: re.Match[bytes]) -> tuple[int, int, int]:
        return int(header[1]), ord(header[2]), header.end()


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
    header_bytes = OUTPUT_ITEMS.text_header_bytes
    longest = header_bytes + _LONGEST_NUMBER * len(parts)
    pattern = re.compile(b"".join(parts))
    return RecordForm(_HEADER, header_bytes, pattern, tuple(names), longest, items[-1] == LINE_END)
