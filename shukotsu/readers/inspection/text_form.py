"""Detect the format of a text table: separator, decimal mark, comments, header, and lines to skip."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, count_of
from shukotsu.readers.formats.text_table import has_names
from shukotsu.readers.formats.tidy import COMMENTS
from shukotsu.tables.text_files import NO_VALUE

READ_LINES = 200
_HEADER_ROWS = 12

_SEPARATORS = {"tab": "\t", ";": ";", ",": ",", "space": None}
_NUMBER = {
    mark: re.compile(rf"[+\u2212-]?(\d+[{mark}]?\d*|[{mark}]\d+)([eE][+-]?\d+)?|{NO_VALUE}", re.I)
    for mark in ".,"
}


@dataclass(frozen=True)
class TextForm:
    """Format of a text table, by keys of the mapping's `csv` group; before : text of the skipped lines.

    table : number of the table, from 1, in a text with several.
    """

    delimiter: str
    decimal: str
    header: bool
    comment: str | None
    skip_lines: int
    before: str = ""
    table: int | None = None

    def config(self) -> dict[str, Any]:
        """Return the format as keys of the mapping's `csv` group."""
        config = {name: getattr(self, name) for name in ("delimiter", "decimal", "header")}
        optional = {name: getattr(self, name) for name in ("comment", "skip_lines", "table")}
        return config | {name: value for name, value in optional.items() if value}

    def sentence(self) -> str:
        """Describe the format in words."""
        names = {"tab": "tabs", "space": "blanks", ",": "commas", ";": "semicolons"}
        mark = "comma" if self.decimal == "," else "point"
        text = f"cells separated by {names[self.delimiter]}, decimal {mark}"
        text += ", a header" if self.header else ", no header"
        text += f", comments after {self.comment}" if self.comment else ""
        return text + (f", {count_of(self.skip_lines, 'line')} before it" if self.skip_lines else "")


def detect_form(path: Path, data: bytes) -> TextForm:
    """Find the format in which most cells of the text are numbers and rows are equally long.

    Raises InputError if the file is not text, or no format gives rows of three or more numbers.
    data : the text of the table.
    """
    try:
        text = data[: 1 << 20].decode("utf-8-sig", errors="strict" if len(data) < 1 << 20 else "ignore")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is neither UTF-8 text nor a file with a supported ending; "
            "a table must be saved as UTF-8"
        ) from error
    lines = text.splitlines()[:READ_LINES]
    starts = [line.lstrip() for line in lines if not line.startswith("%time")]  # header line of rostopic
    comment = next((mark for mark in COMMENTS for line in starts if line.startswith(mark)), None)
    rows = [
        (index, line)
        for index, line in enumerate(lines)
        if line.strip() and not (comment and line.lstrip().startswith(comment))
    ]
    candidates = [
        candidate
        for delimiter, separator in _SEPARATORS.items()
        for decimal in ".,"
        if decimal != delimiter and (candidate := _as(rows, delimiter, separator, decimal, comment))
    ]
    if not candidates:
        raise InputError(f"{path}: its first lines have no table of numbers; expected a recording")
    return max(candidates, key=lambda candidate: candidate[0])[1]


def _as(
    rows: list[tuple[int, str]], delimiter: str, separator: str | None, decimal: str, comment: str | None
) -> tuple[float, TextForm] | None:
    """Return the share of numeric cells and the format if the rows form a table in it, else None."""
    split = [(index, _cells(line, separator)) for index, line in rows]
    counts = Counter(len(cells) for _, cells in split)
    width = max(counts, key=lambda count: (counts[count], count)) if counts else 0
    last = _header_at(split, width, decimal)
    table = [cells for _, cells in split[last + 1 :] if len(cells) == width and not has_names(cells)]
    share: float = sum(bool(_NUMBER[decimal].fullmatch(cell)) for cells in table for cell in cells)
    share /= max(1, len(table) * width)
    if width < 4 or share * width < 3 or not table or len(table) < 0.8 * len(rows) - 20:
        return None
    first = last if last >= 0 else next(i for i, (_, cells) in enumerate(split) if len(cells) == width)
    while last >= 0 < first and 2 < len(split[first - 1][1]) <= width and has_names(split[first - 1][1]):
        first -= 1
    skipped = split[first][0] if first else 0
    before = "\n".join(line for index, line in rows if index < skipped)
    return share, TextForm(delimiter, decimal, last >= 0, comment, skipped, before)


def _cells(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line without quotation marks; a separator within these separates nothing."""
    cells = line.split(separator)
    if separator and '"' in line:
        with suppress(csv.Error):  # a cell is too long
            cells = next(csv.reader([line], delimiter=separator))
    return [cell.strip().strip('"') for cell in cells]


def _header_at(split: Sequence[tuple[int, list[str]]], width: int, decimal: str) -> int:
    """Return the index of the last of the first rows with words where others have numbers; -1 if none has."""
    words = [[cell.lower() for cell in cells if not _NUMBER[decimal].fullmatch(cell)] for _, cells in split]
    counts = sorted(len(texts) for texts, (_, cells) in zip(words, split, strict=True) if len(cells) == width)
    typical = counts[len(counts) // 2] if counts else 0
    for index in range(min(len(split) - 1, _HEADER_ROWS) - 1, -1, -1):
        row, after = split[index][1], split[index + 1][1]
        fits = not any(row[width:] + after[len(row) :])
        more = len(words[index]) - typical  # a name over several columns leaves those on its right empty
        named = more >= 0.5 * (width - typical) or (more > 0 and has_names(row))
        if fits and named and len({*words[index]}) > (2 if index else 1):
            return index
    return -1
