"""LIBERTY and PATRIOT in ASCII: text -> records.

A record is two digits of the station, an error letter, a blank, then its numbers; an item may hold line ends,
and none need end the record, so lines say nothing. How wide the numbers are and what stands between them
differs between firmwares: they are read one after the other, and there must be as many as the output list
says. Source: LIBERTY User Manual URM03PH156, tables of output formats and appendix B.
"""

from __future__ import annotations

import re

from shukotsu.trackers.liberty.items import COSINES, ITEMS, LINE_END, OUTPUT_ITEMS, SPACE
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.protocols.text_stream import RecordForm, TextStream

_BLANKS = rb" {0,8}+"
_DECIMAL = _BLANKS + rb"([+-]? {0,3}\d{0,5}+\.\d{1,8}+(?:[Ee][+-]?\d{1,3}+|[Ee] \d{1,3}+)?+)"
_COUNTER = _BLANKS + rb"(\d{1,10})(?!\d)"
_COUNTER_BEFORE_FLAG = _BLANKS + rb"(\d{1,10})"
_FLAG = _BLANKS + rb"(\d)"
_LINE_END = _BLANKS + rb"\r\n"
_LONGEST = {_DECIMAL: 32, _COUNTER: 18, _COUNTER_BEFORE_FLAG: 18, _FLAG: 9, _LINE_END: 10, _BLANKS: 8}

_FLAGS = (10, 11, 12)
_FIXED_WIDTH = (2, 4, 6, 7)
_DECIMALS = {2: 3, 4: 3, 7: 5}
_WIDTH = 8
"""Characters of a number of fixed width."""

_HEADER = re.compile(rb"(0[1-9]|1[0-6])(?:([PC])(?=[ a-gA-GIu] ))?([ a-gA-GIu]) ")
_LONGEST_HEADER = 5


class TextDecoder(TextStream):
    """Decoder of a LIBERTY or PATRIOT stream in ASCII. Raises InputError for output lists that are none."""

    def __init__(self, settings: StreamSettings) -> None:
        self._items = OUTPUT_ITEMS.one_list(settings.items)
        super().__init__(_form(self._items), settings.items, settings.mm_per_unit)

    def _read_header(self, header: re.Match[bytes]) -> tuple[int, int, int]:
        if header[2] == b"C" and header[3] == b" " and self._is_error_letter(header):
            return int(header[1]), ord("C"), header.start() + OUTPUT_ITEMS.text_header_bytes
        return int(header[1]), ord(header[3]), header.end()

    def _is_error_letter(self, header: re.Match[bytes]) -> bool:
        """Say whether the C is one, not the command's letter: the first number ends where it must then."""
        text, end = header.string, header.start() + OUTPUT_ITEMS.text_header_bytes + _WIDTH
        fixed = self._items[0] in _FIXED_WIDTH
        return fixed and text[end - 1 : end].isdigit() and not text[end : end + 1].isdigit()


def _form(items: tuple[int, ...]) -> RecordForm:
    parts: list[bytes] = []
    names: list[str] = []
    for item, following in zip(items, (*items[1:], SPACE), strict=True):
        parts += _parts(item, following)
        if item not in (SPACE, LINE_END):
            names += ["" if name in names else name for name in ITEMS[item].fields]
    ends_line = parts[-1:] == [_LINE_END]
    longest = _LONGEST_HEADER + sum(_LONGEST[part] for part in (*parts, _BLANKS))
    if not ends_line:
        if items[-1] in _DECIMALS:  # the next record's digits may touch it, where a blank is lost
            parts[-1] = parts[-1].replace(b"{1,8}", b"{1,%d}" % _DECIMALS[items[-1]])
        parts.append(_BLANKS)
    return RecordForm(_HEADER, _LONGEST_HEADER, re.compile(b"".join(parts)), tuple(names), longest, ends_line)


def _parts(item: int, following: int) -> list[bytes]:
    """Patterns of an item; blanks may stand before any number, so an item that is a blank needs none."""
    if item == SPACE:
        return []
    if item == LINE_END:
        return [_LINE_END]
    if item == COSINES:
        return 3 * [_DECIMAL, _DECIMAL, _DECIMAL, _LINE_END]
    if item in _FLAGS:
        return [_FLAG]
    if ITEMS[item].kind == "u4":
        return [_COUNTER_BEFORE_FLAG if following in _FLAGS else _COUNTER]
    return [_DECIMAL for _ in ITEMS[item].fields]
