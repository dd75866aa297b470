"""A table as text in whatever dress a program gave it: separators, comments, decimal commas, no header."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from schemas.errors import InputError
from stages.capture.formats.csv_columns import EMPTY, CsvColumns
from stages.capture.formats.mapped import did_you_mean

_SEPARATOR = {",": ",", ";": ";", "tab": "\t", "space": "\t"}
"""Runs of blanks are made one tab before anything else reads them."""


@dataclass(frozen=True)
class TableText:
    """A table's text: what is no row of it is blanked, so that lines keep their numbers.

    header : names of the columns, their numbers from 1 where the text names none.
    """

    path: Path
    data: bytes
    separator: str
    decimal: str
    header: tuple[str, ...]
    named: bool
    missing: tuple[str, ...]

    @property
    def titles(self) -> list[str]:
        """What columns go by: their names, or "number 4" where that names none or several."""
        counts = Counter(self.header)
        clear = [bool(name) and self.named and counts[name] == 1 for name in self.header]
        return [
            name if good else f"number {index}"
            for index, (name, good) in enumerate(zip(self.header, clear, strict=True), 1)
        ]

    def column(self, wanted: str | int, place: str) -> str:
        """Title of a column given by name or by number from 1; `place` names the mapping's key."""
        if isinstance(wanted, int):
            if not 1 <= wanted <= len(self.header):
                raise InputError(f"{place}: there is no column {wanted}; {self.path} has {len(self.header)}")
            return self.titles[wanted - 1]
        count = self.header.count(wanted)
        if count > 1:
            raise InputError(f"{place}: {self.path} has {count} columns {wanted!r}; give the column's number")
        if not count:
            found = ", ".join(name for name in self.header if name)
            known = did_you_mean(wanted, self.header) or f"; found {found}"
            raise InputError(f"{place}: column {wanted!r} is missing in {self.path}{known}")
        return wanted


class TextColumns(CsvColumns):
    """The wanted columns of a table, by their titles; numbers are read once."""

    def __init__(self, text: TableText, columns: dict[str, pa.ChunkedArray]) -> None:
        super().__init__(text.path, columns)
        self._text = text
        self._read: dict[str, npt.NDArray[np.float64]] = {}

    def reals(self, name: str) -> npt.NDArray[np.float64]:
        """Numbers, shape (N,), NaN where a cell is empty; InputError at the first that is none."""
        if name not in self._read:
            if self._text.decimal == ",":
                cells = self._columns[name]
                points = pc.fill_null(pc.match_substring(cells, "."), False)
                self.refuse_first(points.to_numpy(), name, "a number with a decimal comma")
                self._columns[name] = pc.replace_substring(cells, ",", ".")
            self._read[name] = super().reals(name)
        return self._read[name]

    def integers(self, name: str) -> None:
        """None always: numbers are read as reals, which knows decimal commas."""

    def place(self, row: int) -> str:
        """File and line of a row, as an editor counts lines."""
        for index, (line, _) in enumerate(_records(self._text)):
            if index == row:
                return f"{self._text.path}: line {line}"
        return f"{self._text.path}: row {row + 1}"


def open_text(path: Path, told: Mapping[str, Any]) -> TableText:
    """Read a table's text as the mapping's `csv` group says.

    Raises InputError where it cannot be read, is not UTF-8 or has no row.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a table as text") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected a table as text") from error
    data = _lines_that_count(path, data, told)
    separator = _SEPARATOR[told["delimiter"]]
    text = TableText(path, data, separator, told["decimal"], (), told["header"], tuple(told["missing"]))
    line, first = next(_records(text), (0, []))
    if not first:
        raise InputError(f"{path}: is empty; expected a table")
    header = [name.strip() for name in first] if told["header"] else [str(i + 1) for i in range(len(first))]
    if told["header"]:
        data = _without_lines(data, line)
    return TableText(path, data, separator, told["decimal"], tuple(header), told["header"], text.missing)


def read_columns(text: TableText, wanted: Sequence[str]) -> TextColumns:
    """Read the columns of those titles as text, trimmed, empty where the cell says "no value".

    Raises InputError where a row has another number of cells than the first line, or there is no row.
    """
    picked = list(dict.fromkeys(wanted))
    try:
        table = pa_csv.read_csv(
            pa.BufferReader(text.data),
            pa_csv.ReadOptions(column_names=text.titles),
            pa_csv.ParseOptions(delimiter=text.separator),
            pa_csv.ConvertOptions(include_columns=picked, column_types=dict.fromkeys(picked, pa.string())),
        )
    except pa.ArrowInvalid as error:
        raise _structural_error(text, error) from error
    if not table.num_rows:
        raise InputError(f"{text.path}: has no rows; expected one a frame, or a receiver and frame")
    empty = pa.array([*EMPTY, *text.missing])
    columns = {}
    for name in picked:
        bare = pc.utf8_trim_whitespace(table.column(name))
        columns[name] = pc.if_else(pc.is_in(bare, empty), pa.scalar(None, pa.string()), bare)
    return TextColumns(text, columns)


def _lines_that_count(path: Path, data: bytes, told: Mapping[str, Any]) -> bytes:
    """The text with the skipped lines, the comments and (by blanks) the indents emptied."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path}: is UTF-16 text; save it as UTF-8")
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}: line {line}: is not UTF-8 text; save it as UTF-8") from error
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    data = _without_lines(data, told["skip_lines"])
    if "comment" in told:
        data = re.sub(rb"(?m)^[ \t]*" + re.escape(told["comment"].encode()) + rb".*$", b"", data)
    data = re.sub(rb"(?m)^[ \t]+$", b"", data)
    if told["delimiter"] == "space":
        data = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", data)
        data = re.sub(rb"[ \t]+", b"\t", data)
    return data


def _without_lines(data: bytes, count: int) -> bytes:
    """The text with its first lines emptied."""
    lines = data.split(b"\n", count)
    return b"\n" * (len(lines) - 1) + lines[-1] if len(lines) > count else b""


def _records(text: TableText) -> Iterator[tuple[int, list[str]]]:
    """Give every record that is not an empty line, with its line."""
    reader = csv.reader(io.StringIO(text.data.decode("utf-8"), newline=""), delimiter=text.separator)
    for record in reader:
        if record:
            yield reader.line_num, record


def _structural_error(text: TableText, error: Exception) -> InputError:
    cells = len(text.header)
    try:
        for line, record in _records(text):
            if len(record) != cells:
                return InputError(
                    f"{text.path}: line {line}: has {len(record)} cells; expected {cells} as in the "
                    "first line (a cut-off line, or another delimiter than the mapping says)"
                )
    except csv.Error as unreadable:
        return InputError(f"{text.path}: cannot be read as a table ({unreadable})")
    return InputError(f"{text.path}: cannot be read as a table ({' '.join(str(error).split())})")
