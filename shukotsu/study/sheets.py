"""Sheets: tab-separated tables that the user writes; `schemas/sheets.yaml` defines their columns.

Every cell is checked; messages name the file, the row (its line number in the file) and the column.
"""

from __future__ import annotations

import difflib
import math
import re
import unicodedata
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import yaml

from shukotsu.errors import InputError, count_of, list_names
from shukotsu.resources import ROOT
from shukotsu.study.file_formats import AUTO, UNMAPPED
from shukotsu.tables import limits
from shukotsu.tables.text_files import NO_VALUE, read_text

MAX_MESSAGES = 5
_NO_VALUE = re.compile(NO_VALUE, re.I)

_NEAR, _NEAR_LETTERS = 0.75, 2
"""An unknown column is taken for a misspelt one if their names are at least this similar (by difflib's ratio)
and differ in length by at most this many letters.
"""


@dataclass(frozen=True)
class Cell:
    """One column of a sheet: how to read it, what it means, and whether it may be missing.

    unless : another column; a row that has a cell there need not have one here, even if this is required.
    """

    name: str
    read: Callable[[str], Any]
    description: str
    required: bool = True
    default: Any = None
    unless: str = ""

    def needed(self, others: Collection[str]) -> bool:
        """Return whether this column must be present if the columns `others` are."""
        return self.required and not (self.unless and self.unless in others)


@dataclass(frozen=True)
class Sheet:
    """One kind of sheet: its columns, the key of a row, and whether further columns are allowed."""

    name: str
    cells: tuple[Cell, ...]
    key: tuple[str, ...]
    more_columns: bool = False


@dataclass(frozen=True)
class Row:
    """A row of a sheet: its line number in the file and its values by column."""

    line: int
    values: Mapping[str, Any]

    def __getitem__(self, column: str) -> Any:
        return self.values[column]


def _text(text: str) -> str:
    if not text:
        raise ValueError("is empty")
    if any(unicodedata.category(letter) == "Cc" for letter in text):
        raise ValueError("contains a control character")
    return text


def _reason(text: str) -> str:
    """Return a cell's reason, or an empty string if the cell means no."""
    word = text.lower()
    if word in ("no", "false", "0"):
        return ""
    if word in ("n", "y", "n/a", "na", "nan", "none", "null", "-", "?"):
        raise ValueError(f"is {text!r}; expected a reason, yes or no")
    return _text(text)


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"is {text!r}; expected {', '.join(words[:-1])} or {words[-1]}")
        return text

    return read


def _number(text: str) -> float:
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"is {text!r}; expected a number")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise ValueError(f"is {text!r}; expected a number above zero")
    return value


def _size(name: str) -> Callable[[str], float]:
    least, largest = limits.HAND_SIZES_MM[name]

    def read(text: str) -> float:
        value = _positive(text)
        if not least < value < largest:
            raise ValueError(f"is {text!r}; expected millimetres, {least:g} to {largest:g}")
        return value

    return read


_READ: Mapping[str, Callable[[str], Any]] = {
    "text": _text,
    "reason": _reason,
    "number": _number,
    "positive": _positive,
    "format": _one_of(AUTO, *UNMAPPED),
}


def _sheet(name: str, content: Mapping[str, Any]) -> Sheet:
    """Build a sheet from its entry in sheets.yaml, whose values were all read as text."""
    cells = []
    for column, keys in content["columns"].items():
        holds = keys["holds"]
        read = _one_of(*holds) if isinstance(holds, list) else _READ.get(holds) or _size(column)
        needed = "optional" not in keys and "default" not in keys
        default = None if needed or holds in ("number", "positive", "size") else keys.get("default", "")
        cells.append(Cell(column, read, keys["meaning"], needed, default, keys.get("unless", "")))
    return Sheet(name, tuple(cells), tuple(content["key"]), "more_columns" in content)


SHEETS = {
    name: _sheet(name, content)
    for name, content in yaml.load((ROOT / "schemas" / "sheets.yaml").read_bytes(), yaml.CBaseLoader).items()
}
RECORDINGS, PARTICIPANTS, CORRECTIONS, MEASUREMENTS, TOUCHES, EVENTS = SHEETS.values()
HAND_SHEETS = ("corrections", "measurements", "touches", "events")
"""Sheets in which each row is about one hand."""


def read_sheet(path: Path | None, sheet: Sheet, more: Collection[str] = ()) -> list[Row]:
    """Read a sheet (UTF-8, tab-separated, with a header line; empty lines are skipped).

    path : if None, there are no rows. more : further columns to allow, which are read as text.
    Raises InputError that names bad cells (at most MAX_MESSAGES of them) by file, row and column.
    """
    if path is None:
        return []
    return sheet_rows(path, read_text(path, f"the sheet of {sheet.name}", limits.SHEET_BYTES), sheet, more)


def sheet_rows(path: Path, text: str, sheet: Sheet, more: Collection[str] = ()) -> list[Row]:
    """Read the text of a sheet like `read_sheet`; path : the file's name for messages."""
    numbered = [
        (number, [_unquoted(cell.strip()) for cell in line.split("\t")])
        for number, line in enumerate(text.split("\n"), 1)
        if line.strip()
    ]
    if not numbered:
        columns = ", ".join(cell.name for cell in sheet.cells if cell.required)
        raise InputError(f"{path}: is empty; expected a header line with {columns}")
    header = numbered[0][1]
    if fault := _header_fault(sheet, header, more):
        raise InputError(f"{path}: row 1: {fault}")
    rows, messages = [], []
    lines: dict[tuple[Any, ...], int] = {}
    for line, cells in numbered[1:]:
        row, faults = _read_row(sheet, header, line, cells)
        rows.append(row)
        messages += faults
    for row in rows:
        if not set(sheet.key) <= row.values.keys():
            continue
        key = tuple(row[column] for column in sheet.key)
        first = lines.setdefault(key, row.line)
        if first != row.line:
            names = ", ".join(f"{c} {v!r}" for c, v in zip(sheet.key, key, strict=True) if v)
            messages.append(f"row {row.line}: {names} is already in row {first}")
    if messages:
        rest = f"; and {len(messages) - MAX_MESSAGES} more" if len(messages) > MAX_MESSAGES else ""
        raise InputError(f"{path}: " + "; ".join(messages[:MAX_MESSAGES]) + rest)
    return rows


def _unquoted(cell: str) -> str:
    """Return a cell without the quotation marks that spreadsheets add if it contains commas or quotes."""
    quoted = len(cell) > 1 and cell[0] == cell[-1] == '"'
    return cell[1:-1].replace('""', '"').strip() if quoted else cell


def _header_fault(sheet: Sheet, header: list[str], more: Collection[str]) -> str:
    """Describe what is wrong with a header line, or return an empty string if it is valid."""
    columns = [cell.name for cell in sheet.cells]
    odd = [name for name in header if name and name not in columns and name not in more]
    absent = [name for name in columns if name not in header]
    for name in odd:
        close = difflib.get_close_matches(name.lower(), absent, 1, _NEAR)
        if close and abs(len(close[0]) - len(name)) <= _NEAR_LETTERS:
            return f"unknown column {name}; did you mean {close[0]!r}?"
    missing = [cell.name for cell in sheet.cells if cell.needed(header) and cell.name not in header]
    if missing:
        hint = "; are the columns separated by tabs?" if len(header) == 1 else ""
        return f"column {', '.join(missing)} is missing; found {list_names(header)}{hint}"
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        return f"column {list_names(twice)} is given twice"
    if odd and not sheet.more_columns:
        return f"unknown column {list_names(odd)}; known are {', '.join(columns)}"
    return ""


def _read_row(sheet: Sheet, header: list[str], line: int, cells: list[str]) -> tuple[Row, list[str]]:
    if any(cells[len(header) :]):
        return Row(line, {}), [f"row {line}: has {count_of(len(cells), 'cell')}; expected {len(header)}"]
    texts = dict(zip_longest(header, cells[: len(header)], fillvalue=""))
    values: dict[str, Any] = {k: v for k, v in texts.items() if k not in {c.name for c in sheet.cells}}
    messages, filled = [], {name for name, text in texts.items() if text}
    for cell in sheet.cells:
        text = texts.get(cell.name, "")
        if not cell.required and cell.read not in (_text, _reason) and _NO_VALUE.fullmatch(text):
            text = ""
        try:
            values[cell.name] = cell.read(text) if text or cell.needed(filled) else cell.default
        except ValueError as error:
            other = f", or a cell in column {cell.unless}" if cell.unless and not text else ""
            messages.append(f"row {line}, column {cell.name}: {error}{other}")
    return Row(line, values), messages
