"""Read text tables in any layout: separators, comments, decimal commas, with or without a header.

Only if pyarrow cannot parse a table is it searched for the faulty line.
"""

from __future__ import annotations

import csv
import functools
import io
import itertools
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from shukotsu.errors import InputError, count_of, list_names, nearest
from shukotsu.readers.formats.cells import Cells
from shukotsu.tables import text_files
from shukotsu.tables.limits import LINE_LETTERS, read_whole

READ_BYTES = 8 << 20
"""Text that is parsed at a time: some ten thousand rows, and more than the longest line."""
_TITLE = re.compile(rb"(?m)^[ \t,;]*\n(?=[ \t]*[^\s\d.,;+#-][^,;\t\n]*[,;\t ]*\n)")
"""An empty line before a line of a single cell that is not a number: a table's title."""
_ROW = re.compile(rb"(?m)^(?=[^\n]*\d)(?:[^,;\t\n]*[,;\t]){3}")
"""Beginning of a row of four or more cells with a digit in it."""
_NAME_LINES = 6
"""Largest number of lines over which the names of columns may extend."""
_NUMBER_LIKE, _NO_NAME = re.compile(r"[+\u2212-]?\.?\d"), re.compile(text_files.NO_VALUE, re.I)
_SEPARATOR = {",": ",", ";": ";", "tab": "\t", "space": "\t"}
"""Separator by the mapping's name; runs of blanks are first replaced by one tab (see `_normalise`)."""


@dataclass(frozen=True)
class TextTable:
    """Text of a table, and how to parse it.

    open : returns a stream of its bytes. header : names of the columns, or their numbers from 1 if the text
    has no names; titles : the same, made unique. header_lines : number of lines up to and including the
    header. expected : how many cells a row must have, for messages. empty : additional texts that mean "no
    value". ended : whether the last line is complete. cut_bytes : length of a last line that was cut off
    before its last cell and is not read, else 0.
    """

    path: Path
    open: Callable[[], BinaryIO]
    separator: str
    header: tuple[str, ...]
    titles: tuple[str, ...]
    header_lines: int
    expected: str
    empty: tuple[str, ...] = ()
    decimal: str = "."
    ended: bool = True
    cut_bytes: int = 0

    def cut_off(self, wanted: Iterable[str]) -> str:
        """Return a sentence if the last row is dropped: it lacks cells, or its last one is needed and may be
        cut off.
        """
        if self.cut_bytes:
            return "the last line has no line end and too few cells, so it is cut off: the row is left out"
        if self.ended or self.titles[-1] not in wanted:
            return ""
        return "the last line has no line end, so its last number may be cut off: the row is left out"

    def column(self, wanted: str | int, key: str) -> str:
        """Return the title of a column given by name or number (from 1); key : mapping key, for messages."""
        if isinstance(wanted, int):
            if not 1 <= wanted <= len(self.header):
                raise InputError(f"{key}: there is no column {wanted}; {self.path} has {len(self.header)}")
            return self.titles[wanted - 1]
        if wanted in self.titles:
            return wanted
        if count := self.header.count(wanted):
            raise InputError(
                f"{key}: {self.path} has {count_of(count, 'column')} {wanted!r}; give the column's number"
            )
        guess = nearest(wanted, self.header) or f"; found {list_names([*filter(None, self.header)])}"
        raise InputError(f"{key}: column {wanted!r} is missing in {self.path}{guess}")

    def cells(self, wanted: Sequence[str]) -> Cells:
        """Read the wanted columns. Raises InputError as `blocks` does, and if there are no rows."""
        tables = list(self._tables(list(dict.fromkeys(wanted)), READ_BYTES))
        filled = np.concatenate([[], *(~_empty_rows(table) for table in tables)])
        if not filled.any():
            why = self.cut_off(wanted) or "expected one a frame, or a receiver and frame"
            raise InputError(f"{self.path}: has no rows; {why}")
        return self._cells(pa.concat_tables(tables), np.arange(np.flatnonzero(filled)[-1] + 1))

    def blocks(self, wanted: Sequence[str], read_bytes: int = READ_BYTES) -> Iterator[Cells]:
        """Read the wanted columns in blocks of `read_bytes` of text.

        Raises InputError if the text is not a table, or a row has a wrong number of cells.
        """
        start = 0
        for table in self._tables(list(wanted), read_bytes):
            yield self._cells(table, np.flatnonzero(~_empty_rows(table)), start)
            start += table.num_rows

    def _cells(self, table: pa.Table, rows: npt.NDArray[np.int64], start: int = 0) -> Cells:
        """Return the selected rows of a block; the others are empty. start : the block's first row."""
        empty_rows = table.num_rows - len(rows)

        def locate(row: int) -> str:
            return self._place(start + int(rows[row]))

        kept = table.take(rows) if empty_rows else table
        return Cells(self.path, kept, locate, self.empty, self.decimal, empty_rows)

    def _tables(self, wanted: Sequence[str], read_bytes: int) -> Iterator[pa.Table]:
        last = 1 if self.cut_off(wanted) and not self.cut_bytes else 0
        # one thread, because each further thread keeps several blocks in memory
        read = pa_csv.ReadOptions(use_threads=False, block_size=read_bytes)
        read.column_names, read.skip_rows = list(self.titles), self.header_lines
        parse = pa_csv.ParseOptions(delimiter=self.separator)
        convert = pa_csv.ConvertOptions(include_columns=wanted, null_values=("", *self.empty))
        convert.column_types, convert.strings_can_be_null = dict.fromkeys(wanted, pa.string()), True
        with text_files.reading(self.path), self.open() as stream:
            self._refuse_long_lines(stream)
            # pyarrow must not read from a Python object: its thread aborts a process that exits meanwhile
            text = stream.getvalue() if isinstance(stream, io.BytesIO) else None
            held: list[pa.Table] = []
            with pa.OSFile(str(self.path)) if text is None else pa.BufferReader(text) as source:
                whole = source.get_stream(0, source.size() - self.cut_bytes)
                try:
                    for batch in pa_csv.open_csv(whole, read, parse, convert):
                        if batch.num_rows:
                            yield from held
                            held = [pa.Table.from_batches([batch])]
                except pa.ArrowInvalid as error:
                    self._refuse_lines(error)
            yield from (table.slice(0, table.num_rows - last) for table in held)

    def _refuse_long_lines(self, stream: BinaryIO) -> None:
        letters, line = 0, 1
        for piece in iter(partial(stream.read, LINE_LETTERS), b""):
            first = re.search(rb"[\r\n]", piece)
            if letters + (first.start() if first else len(piece)) > LINE_LETTERS:
                raise InputError(f"{self.path}: line {line}: has more than {LINE_LETTERS} letters")
            last = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
            letters = letters + len(piece) if last < 0 else len(piece) - last - 1
            line += piece.count(b"\n")

    def _records(self) -> Iterator[tuple[int, list[str]]]:
        """Return an iterator over all non-empty rows, each with the number of its (last) line."""
        records = text_records(self.open(), self.separator)
        return itertools.dropwhile(lambda record: record[0] <= self.header_lines, records)

    def _place(self, row: int) -> str:
        """Return the file and line of a row, with lines counted as in an editor."""
        with suppress(csv.Error):  # a previous row has a cell that is too long
            for line, _ in itertools.islice(self._records(), row, None):
                return f"{self.path}: line {line}"
        return f"{self.path}: row {row + 1}"

    def _refuse_lines(self, error: Exception) -> None:
        """Raise InputError for the line that pyarrow could not parse; do nothing if there are no rows."""
        last = 0
        try:
            for line, record in self._records():
                if len(record) != len(self.header) and last and line > last + 1 and len(record) < 3:
                    raise InputError(
                        f"{self.path}: line {line}: another table seems to begin here, after an empty line; "
                        "expected only one: state which in csv.table, or put each table into a separate file"
                    )
                last = line
                if len(record) != len(self.header):
                    raise InputError(
                        f"{self.path}: line {line}: has {count_of(len(record), 'cell')}; expected "
                        f"{self.expected}"
                    )
        except UnicodeDecodeError:
            raise _undecodable(self.path, self.open()) from error
        except csv.Error as unreadable:
            raise InputError(f"{self.path}: cannot be read as a table ({unreadable})") from error
        if last:
            raise InputError(
                f"{self.path}: cannot be read as a table ({' '.join(str(error).split())})"
            ) from error


def text_records(stream: BinaryIO, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield every record that is not an empty line, with the number of its (last) line."""

    def lines(text: io.TextIOWrapper) -> Iterator[str]:
        while line := text.readline(LINE_LETTERS + 1):
            if len(line) > LINE_LETTERS:
                raise csv.Error(f"a line has more than {LINE_LETTERS} letters")
            yield line

    with io.TextIOWrapper(stream, "utf-8-sig", newline="") as text:
        reader = csv.reader(lines(text), delimiter=separator)
        yield from ((reader.line_num, record) for record in reader if record)


def _empty_rows(table: pa.Table) -> npt.NDArray[np.bool_]:
    """Return which rows are entirely empty, (N,); spreadsheet programs append such rows to a table."""
    return np.asarray(functools.reduce(pc.and_, map(pc.is_null, table.columns)).to_numpy())


def _undecodable(path: Path, stream: BinaryIO) -> InputError:
    """Return an InputError that names the first line that is not UTF-8."""
    with stream:
        for number, line in enumerate(iter(partial(stream.readline, 4 * LINE_LETTERS), b""), 1):
            try:
                line.decode("utf-8")
            except UnicodeDecodeError:
                return text_files.undecodable(path, number)
    raise AssertionError("every line can be decoded")


def open_tidy_csv(path: Path) -> TextTable:
    """Open a text table that has a header, commas or tabs, and decimal points.

    Raises InputError if the file cannot be read, is empty or is not UTF-8.
    """
    with text_files.reading(path), text_files.open_text(path) as stream:
        first = stream.readline(LINE_LETTERS)
        stream.seek(max(0, stream.seek(0, io.SEEK_END) - LINE_LETTERS))
        end = stream.read()
    separator = "\t" if b"\t" in first and b"," not in first else ","
    open_ = partial(text_files.open_text, path)
    line, header = next(iter(_first_records(path, open_, separator, 1)), (0, []))
    if not header or not any(map(str.strip, header)):
        raise InputError(f"{path}: is empty; expected a tidy recording with a header line")
    expected = (
        f"{len(header)} as in the header (a cut-off line, or decimal commas: numbers need a decimal point)"
    )
    names = tuple(name.strip() for name in header)
    text = TextTable(path, open_, separator, names, _titles(names), line, expected)
    return replace(text, ended=is_ended(end), cut_bytes=_cut_bytes(end, separator, len(names)))


def is_ended(data: bytes) -> bool:
    """Return whether the last line of a text is complete, so that its last number cannot be cut off.

    A line without a line end is complete, too, if it ends in a quotation mark or a blank.
    """
    return data[-1:] in (b"\n", b"\r", b" ", b'"')


def _cut_bytes(end: bytes, separator: str, cells: int) -> int:
    """Return the length of a text's last line if it has no line end and fewer cells than given, else 0."""
    line = re.split(rb"[\r\n]", end)[-1]
    bare = re.sub(rb'"[^"]*("|$)', b"", line)  # a separator in quotation marks separates nothing
    return len(line) if bare.count(separator.encode()) < cells - 1 else 0


def open_table_text(path: Path, details: Mapping[str, Any]) -> TextTable:
    """Open a text table as described by the mapping's `csv` group.

    Raises InputError if it cannot be read, is not UTF-8 or is empty.
    """
    with text_files.reading(path, "a table as text"):
        data = read_whole(path, "a table as text")
        ended = is_ended(data)
        data = _normalise(path, data, details)
    separator = _SEPARATOR[details["delimiter"]]
    most = _NAME_LINES + 1 if details["header"] else 1
    records = _first_records(path, lambda: io.BytesIO(data), separator, most)
    if not records:
        raise InputError(f"{path}: is empty; expected a table")
    rows = [record for _, record in records]
    missing = tuple(map(str.strip, details["missing"]))
    more = itertools.takewhile(lambda row: has_names(row, missing), rows[1:])
    n_names = 1 + len(list(more)) if details["header"] else 0
    names = join_names(rows[:n_names]) if n_names else [""] * len(rows[0])
    first = rows[min(n_names, len(rows) - 1)]
    # either the header or the other rows may end in separators
    if not any(names[len(first) :]) and (len(first) == len(names) + 1 or not any(first[len(names) :])):
        names = [*names, *[""] * len(first)][: len(first)]
    expected = f"{len(names)} as in the first line (a cut-off line, one that is no row, or another delimiter)"
    header = tuple(names if details["header"] else map(str, range(1, len(names) + 1)))
    header_lines = records[n_names - 1][0] if n_names else 0
    open_, titles, ended = partial(io.BytesIO, data), _titles(names), ended or data.endswith(b"\n")
    cut_bytes = _cut_bytes(data[-LINE_LETTERS:], separator, len(names))
    form = header_lines, expected, missing, details["decimal"], ended, cut_bytes
    return TextTable(path, open_, separator, header, titles, *form)


def has_names(row: Sequence[str], missing: Sequence[str] = ()) -> bool:
    """Return whether a row has words and no numbers, like lines of column names or units.

    Several ones and no other number are units, too, of the numbers of a rotation. missing : additional texts
    that mean "no value".
    """
    words = [cell for cell in map(str.strip, row) if cell not in missing and not _NO_NAME.fullmatch(cell)]
    numbers = [cell for cell in words if _NUMBER_LIKE.match(cell)]
    return len(words) > len(numbers) and (not numbers or (len(numbers) > 3 and {*numbers} == {"1"}))


def join_names(rows: Sequence[Sequence[str]]) -> list[str]:
    """Join names of columns that extend over several lines, such as segment, axis and unit.

    An empty cell repeats the name to its left if the line below names its column.
    """
    lines = [[cell.strip() for cell in row] for row in rows]
    for line, below in itertools.pairwise(lines):
        line += [""] * (len(below) - len(line))
        for column in range(1, len(below)):
            line[column] = line[column] or (line[column - 1] if below[column] else "")
    return [" ".join(filter(None, parts)) for parts in itertools.zip_longest(*lines, fillvalue="")]


def tables_of(path: Path) -> list[bytes]:
    """Return the tables of a text, which may follow each other under titles, each as UTF-8 text.

    A text without several tables is returned whole.
    """
    with text_files.reading(path, "a table as text"):
        data = _with_line_feeds(text_files.utf8_bytes(path, read_whole(path, "a table as text")))
    bounds = _table_bounds(data)
    return [data[start:end] for start, end in bounds] if len(bounds) > 1 else [data]


def _table_bounds(data: bytes) -> list[tuple[int, int]]:
    """Return where tables start and end in a text; lines before a table's rows belong to it."""
    bounds, start = [], 0
    titles = [title.span() for title in _TITLE.finditer(data)]
    for end, next_start in [*titles, (len(data), len(data))]:
        if _ROW.search(data, start, end):
            bounds.append((start, end))
            start = next_start
    return bounds


def _with_line_feeds(data: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _titles(names: Sequence[str]) -> tuple[str, ...]:
    """Return unique column titles: the name, or "name #1", "name #2" if repeated, "number 4" if empty."""
    counts, numbers = Counter(names), defaultdict[str, Iterator[int]](partial(itertools.count, 1))
    return tuple(
        f"number {index}" if not name else f"{name} #{next(numbers[name])}" if counts[name] > 1 else name
        for index, name in enumerate(names, 1)
    )


def _first_records(
    path: Path, open_: Callable[[], BinaryIO], separator: str, count: int
) -> list[tuple[int, list[str]]]:
    try:
        with text_files.reading(path):
            return list(itertools.islice(text_records(open_(), separator), count))
    except UnicodeDecodeError as error:
        raise _undecodable(path, open_()) from error
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from error


def _normalise(path: Path, data: bytes, details: Mapping[str, Any]) -> bytes:
    """Return the text without indents; skipped lines and comments become empty to keep line numbers valid."""
    text_files.refuse_other_kind(path, data[:8], "a table as text")
    data = text_files.utf8_bytes(path, data)
    if not data.isascii():  # decoding costs memory, and ASCII needs no check
        text_files.decode_text(path, data, "a table as text")
    data, skipped = _with_line_feeds(data.removeprefix(b"\xef\xbb\xbf")), details["skip_lines"]
    if number := details.get("table"):
        tables = _table_bounds(data)
        if number > len(tables):
            raise InputError(f"{path}: has {count_of(len(tables), 'table')}; csv.table is {number}")
        start, end = tables[number - 1]
        skipped, data = skipped + data.count(b"\n", 0, start), data[:end]
    if skipped:
        lines = data.split(b"\n", skipped)
        data = b"\n" * (len(lines) - 1) + lines[-1] if len(lines) > skipped else b""
    if "comment" in details:
        data = re.sub(rb"(?m)^[ \t]*" + re.escape(details["comment"].encode()) + rb".*$", b"", data)
    data = re.sub(rb"(?m)^[ \t]+$", b"", data)
    if details["delimiter"] == "space":
        data = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", data)
        data = re.sub(rb"[ \t]+", b"\t", data)
    return data
