"""A CSV file's columns, at once or in blocks of rows; what is wrong is looked for when something is."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from schemas.errors import InputError
from stages.capture.formats.columns import Columns

EMPTY = ["", "NaN", "nan", "NAN", "NA", "N/A", "null", "NULL"]
"""What people and programs write for "no value"."""

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")

BLOCK_ROWS = 1 << 16
READ_BYTES = 1 << 20

Wanted = Callable[[Path, Sequence[str]], list[str]]


class CsvColumns(Columns):
    """The wanted columns of a CSV file, as text until asked for, from row `start` on."""

    def __init__(self, path: Path, columns: dict[str, pa.ChunkedArray], start: int = 0) -> None:
        self._path = path
        self._columns = columns
        self._start = start

    @property
    def names(self) -> list[str]:
        """The columns that were wanted."""
        return list(self._columns)

    @property
    def rows(self) -> int:
        """How many rows there are, the header and empty lines not counted."""
        return len(next(iter(self._columns.values())))

    def reals(self, name: str) -> npt.NDArray[np.float64]:
        """Numbers, shape (N,), NaN where a cell is empty; InputError at the first that is none."""
        text = self._columns[name]
        numbers = _parsed(text, pa.float64())
        if numbers is None:
            text = _trimmed(text)
            numbers = _parsed(text, pa.float64())
        if numbers is None:
            row = _first_bad(text)
            found = text[row].as_py()
            hint = " with a decimal point, not a comma" if _DECIMAL_COMMA.fullmatch(found) else ""
            raise InputError(f"{self.place(row)}, column {name}: is {found!r}; expected a number{hint}")
        return np.asarray(numbers.to_numpy(), float)

    def integers(self, name: str) -> npt.NDArray[np.int64] | None:
        """Numbers that all are written as integers, shape (N,); None where any is not, or is empty."""
        numbers = _parsed(self._columns[name], pa.int64())
        if numbers is None or numbers.null_count:
            return None
        return np.asarray(numbers.to_numpy(), np.int64)

    def words(self, name: str) -> tuple[npt.NDArray[np.int64], list[str]]:
        """Text as (N,) indices into a list of words; InputError at the first cell that is empty."""
        encoded = self._columns[name].dictionary_encode().combine_chunks()
        self.refuse_first(encoded.is_null().to_numpy(zero_copy_only=False), name, "a name")
        words = [word.strip() for word in encoded.dictionary.to_pylist()]
        return np.asarray(encoded.indices.to_numpy(), np.int64), words

    def place(self, row: int) -> str:
        """File and line of a row, as an editor counts lines."""
        row += self._start
        for index, (line, _) in enumerate(_records(self._path)):
            if index == row + 1:  # record 0 is the header
                return f"{self._path}: line {line}"
        return f"{self._path}: row {row + 1}"

    def cell(self, name: str, row: int) -> object:
        """The text of a cell; None where it is empty."""
        text: object = self._columns[name][row].as_py()
        return text


def open_csv(path: Path, wanted: Wanted) -> CsvColumns:
    """Read the wanted columns; `wanted` picks them from the header or refuses it.

    Raises InputError where the file cannot be read, is not UTF-8, or a row has another number of cells.
    """
    with _opened(path) as stream:
        names, reader = _reader(path, stream, wanted, READ_BYTES)
        table = reader.read_all()
    return CsvColumns(path, dict(zip(names, table.columns, strict=True)))


def csv_blocks(
    path: Path, wanted: Wanted, block_rows: int = BLOCK_ROWS, read_bytes: int = READ_BYTES
) -> Iterator[CsvColumns]:
    """Read the wanted columns as `open_csv` does, so many rows at a time or some more.

    read_bytes : how much of the file is parsed at a time, which is more than its longest line.
    """
    start = 0
    with _opened(path) as stream:
        names, reader = _reader(path, stream, wanted, read_bytes)
        while batches := _next_batches(reader, block_rows):
            table = pa.Table.from_batches(batches)
            yield CsvColumns(path, dict(zip(names, table.columns, strict=True)), start)
            start += table.num_rows


def _next_batches(reader: pa_csv.CSVStreamingReader, least_rows: int) -> list[pa.RecordBatch]:
    batches: list[pa.RecordBatch] = []
    rows = 0
    for batch in reader:
        batches.append(batch)
        rows += batch.num_rows
        if rows >= least_rows:
            break
    return batches


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as stream:
            yield stream
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a recording") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected a recording") from error
    except pa.ArrowInvalid as error:
        raise _structural_error(path, error) from error


def _reader(
    path: Path, stream: BinaryIO, wanted: Wanted, read_bytes: int
) -> tuple[list[str], pa_csv.CSVStreamingReader]:
    """Names of the wanted columns, and what reads them in that order."""
    header = _header(path, stream)
    stream.seek(0)
    written = {name.strip(): name for name in header}
    names = wanted(path, [name.strip() for name in header])
    options = pa_csv.ConvertOptions(
        include_columns=[written[name] for name in names],
        column_types={written[name]: pa.string() for name in names},
        strings_can_be_null=True,
        null_values=EMPTY,
    )
    # One thread: of several, each has a block at work and others ahead, and memory is short before time is.
    reading = pa_csv.ReadOptions(use_threads=False, block_size=read_bytes)
    return names, pa_csv.open_csv(stream, reading, convert_options=options)


def _header(path: Path, stream: BinaryIO) -> list[str]:
    line = next((line for line in stream if line.strip()), b"")
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text; save it as CSV in UTF-8") from error
    if not text.strip():
        raise InputError(f"{path}: is empty; expected a tidy recording with a header line")
    return next(csv.reader(io.StringIO(text, newline="")))


def _structural_error(path: Path, error: Exception) -> InputError:
    try:
        records = _records(path)
        _, header = next(records)
        for line, record in records:
            if len(record) != len(header):
                return InputError(
                    f"{path}: line {line}: has {len(record)} cells; expected {len(header)} as in the header "
                    "(a cut-off line, or decimal commas: numbers need a decimal point)"
                )
    except UnicodeDecodeError:
        line = _first_undecodable_line(path)
        return InputError(f"{path}: line {line}: is not UTF-8 text; save it as CSV in UTF-8")
    except csv.Error as unreadable:
        return InputError(f"{path}: cannot be read as CSV ({unreadable})")
    return InputError(f"{path}: cannot be read as CSV ({' '.join(str(error).split())})")


def _first_undecodable_line(path: Path) -> int:
    with path.open("rb") as stream:
        for number, line in enumerate(stream, 1):
            try:
                line.decode("utf-8")
            except UnicodeDecodeError:
                return number
    raise AssertionError("every line can be decoded")


def _records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Give every record that is not an empty line, with the number of its (last) line."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        reader = csv.reader(stream)
        for record in reader:
            if record:
                yield reader.line_num, record


def _parsed(text: pa.ChunkedArray, kind: pa.DataType) -> pa.ChunkedArray | None:
    try:
        return text.cast(kind)
    except pa.ArrowInvalid:
        return None


def _trimmed(text: pa.ChunkedArray) -> pa.ChunkedArray:
    bare = pc.utf8_trim_whitespace(text)
    return pc.if_else(pc.is_in(bare, pa.array(EMPTY)), pa.scalar(None, pa.string()), bare)


def _first_bad(text: pa.ChunkedArray) -> int:
    """Find the first cell that is no number by halving; there is one."""
    low, high = 0, len(text)
    while high - low > 1:
        middle = (low + high) // 2
        if _parsed(text[low:middle], pa.float64()) is None:
            high = middle
        else:
            low = middle
    return low
