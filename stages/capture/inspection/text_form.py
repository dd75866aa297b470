"""Detect how a table's text is laid out: separators, decimal mark, header, comments, what comes before it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.files.text_files import open_text
from shukotsu.schemas.left import instead

READ_LINES = 200
_HEADER_ROWS = 12

_COMMENTS = ("#", "%", "//")
_SEPARATORS = {"tab": "\t", ";": ";", ",": ",", "space": None}
_NUMBER = {
    mark: re.compile(rf"[+-]?(\d+[{mark}]?\d*|[{mark}]\d+)([eE][+-]?\d+)?|nan|na|", re.I) for mark in ".,"
}


@dataclass(frozen=True)
class TextForm:
    """Hold how the text is laid out, as the mapping's `csv` group says it; before : the lines skipped."""

    delimiter: str
    decimal: str
    header: bool
    comment: str | None
    skip_lines: int
    before: str = ""

    def config(self) -> dict[str, Any]:
        """The keys of the mapping's `csv` group, all of them."""
        config = {name: getattr(self, name) for name in ("delimiter", "decimal", "header", "skip_lines")}
        config["missing"] = []
        return config if self.comment is None else config | {"comment": self.comment}

    def sentence(self) -> str:
        """The same as a clause."""
        names = {"tab": "tabs", "space": "blanks", ",": "commas", ";": "semicolons"}
        mark = "comma" if self.decimal == "," else "point"
        text = f"cells separated by {names[self.delimiter]}, decimal {mark}"
        text += ", a header" if self.header else ", no header"
        text += f", comments after {self.comment}" if self.comment else ""
        return text + (f", {self.skip_lines} lines before it" if self.skip_lines else "")


def detect_form(path: Path) -> TextForm:
    """Find the layout in which most cells of the text are numbers and rows are equally long.

    Raises InputError where the file is no text or no layout gives rows of three numbers or more.
    """
    if path.name.lower().endswith(".jsonl"):
        raise InputError(f"{path}: {instead('format', 'jsonl')}")
    lines = _first_lines(path)
    comment = next((mark for mark in _COMMENTS for line in lines if line.lstrip().startswith(mark)), None)
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
        raise InputError(f"{path}: no table of numbers in its first lines; expected a recording")
    return max(candidates, key=lambda candidate: candidate[0])[1]


def _first_lines(path: Path) -> list[str]:
    with open_text(path) as stream:
        data = stream.read(1 << 20)
    try:
        text = data.decode("utf-8-sig", errors="strict" if len(data) < 1 << 20 else "ignore")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not UTF-8 text, and of no other kind that is known by its ending; "
            "a table must be saved as UTF-8"
        ) from error
    return text.splitlines()[:READ_LINES]


def _as(
    rows: list[tuple[int, str]], delimiter: str, separator: str | None, decimal: str, comment: str | None
) -> tuple[float, TextForm] | None:
    """The share of numbers among the cells and the layout, if the rows are a table in it."""
    split = [(index, [cell.strip() for cell in line.split(separator)]) for index, line in rows]
    counts = Counter(len(cells) for _, cells in split)
    width = max(counts, key=lambda count: (counts[count], count)) if counts else 0
    last = _header_at(split, width, decimal)
    table = [cells for _, cells in split[last + 1 :] if len(cells) == width]
    share: float = sum(_is_number(cell, decimal) for cells in table for cell in cells)
    share /= max(1, len(table) * width)
    if width < 4 or share * width < 3 or not table or len(table) < 0.8 * len(rows) - 20:
        return None
    first = last if last >= 0 else next(i for i, (_, cells) in enumerate(split) if len(cells) == width)
    skipped = split[first][0] if first else 0
    before = "\n".join(line for index, line in rows if index < skipped)
    return share, TextForm(delimiter, decimal, last >= 0, comment, skipped, before)


def _header_at(split: Sequence[tuple[int, list[str]]], width: int, decimal: str) -> int:
    """The last of the first rows that has words where others have numbers; -1 where there is none."""
    words = [[cell.lower() for cell in cells if not _is_number(cell, decimal)] for _, cells in split]
    counts = sorted(len(own) for own, (_, cells) in zip(words, split, strict=True) if len(cells) == width)
    typical = counts[len(counts) // 2] if counts else 0
    for place in range(min(len(split) - 1, _HEADER_ROWS) - 1, -1, -1):
        row, after = split[place][1], split[place + 1][1]
        fits = abs(len(row) - width) <= 1 and not any(row[width:] + after[len(row) :])
        named = len(words[place]) - typical >= 0.5 * (width - typical) and len({*words[place]}) > 2
        if fits and named:
            return place
    return -1


def _is_number(cell: str, decimal: str) -> bool:
    return bool(_NUMBER[decimal].fullmatch(cell))
