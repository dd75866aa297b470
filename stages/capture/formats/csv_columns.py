"""A CSV file's columns, read at once by pyarrow; what is wrong is looked for only when something is."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

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


class CsvColumns(Columns):
    """The wanted columns of a CSV file, as text until asked for."""

    def __init__(self, path: Path, data: bytes, columns: dict[str, pa.ChunkedArray]) -> None:
        self._path = path
        self._data = data
        self._columns = columns

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
        for index, (line, _) in enumerate(_records(self._data)):
            if index == row + 1:  # record 0 is the header
                return f"{self._path}: line {line}"
        return f"{self._path}: row {row + 1}"

    def cell(self, name: str, row: int) -> object:
        """The text of a cell; None where it is empty."""
        text: object = self._columns[name][row].as_py()
        return text


def open_csv(path: Path, wanted: Callable[[Path, Sequence[str]], list[str]]) -> CsvColumns:
    """Read the wanted columns; `wanted` picks them from the header or refuses it.

    Raises InputError where the file cannot be read, is not UTF-8, or a row has another number of cells.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a recording") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected a recording") from error
    header = _header(path, data)
    written = {name.strip(): name for name in header}
    names = wanted(path, [name.strip() for name in header])
    options = pa_csv.ConvertOptions(
        include_columns=[written[name] for name in names],
        column_types={written[name]: pa.string() for name in names},
        strings_can_be_null=True,
        null_values=EMPTY,
    )
    try:
        table = pa_csv.read_csv(pa.BufferReader(data), convert_options=options)
    except pa.ArrowInvalid as error:
        raise _structural_error(path, data, len(header), error) from error
    return CsvColumns(path, data, {name: table.column(written[name]) for name in names})


def _header(path: Path, data: bytes) -> list[str]:
    line = next((line for line in io.BytesIO(data) if line.strip()), b"")
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text; save it as CSV in UTF-8") from error
    if not text.strip():
        raise InputError(f"{path}: is empty; expected a tidy recording with a header line")
    return next(csv.reader(io.StringIO(text, newline="")))


def _structural_error(path: Path, data: bytes, cells: int, error: Exception) -> InputError:
    try:
        for line, record in _records(data):
            if len(record) != cells:
                return InputError(
                    f"{path}: line {line}: has {len(record)} cells; expected {cells} as in the header "
                    "(a cut-off line, or decimal commas: numbers need a decimal point)"
                )
    except UnicodeDecodeError as undecodable:
        line = data.count(b"\n", 0, undecodable.start) + 1
        return InputError(f"{path}: line {line}: is not UTF-8 text; save it as CSV in UTF-8")
    except csv.Error as unreadable:
        return InputError(f"{path}: cannot be read as CSV ({unreadable})")
    return InputError(f"{path}: cannot be read as CSV ({' '.join(str(error).split())})")


def _records(data: bytes) -> Iterator[tuple[int, list[str]]]:
    """Give every record that is not an empty line, with the number of its (last) line."""
    reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""))
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
