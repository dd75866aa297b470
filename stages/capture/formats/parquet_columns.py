"""A Parquet file's columns, in whatever number type their writer chose, at once or in blocks of rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from schemas.errors import InputError
from stages.capture.formats.columns import Columns

BLOCK_ROWS = 1 << 16
_READ_BYTES = 1 << 20
"""How much of a column is read at a time: one row group may hold the whole recording."""

Wanted = Callable[[Path, Sequence[str]], list[str]]


class ParquetColumns(Columns):
    """The wanted columns of a Parquet file, in whatever number types it has, from row `start` on."""

    def __init__(self, path: Path, table: pa.Table, start: int = 0) -> None:
        self._path = path
        self._table = table
        self._start = start

    @property
    def names(self) -> list[str]:
        """The columns that were wanted."""
        return list(self._table.column_names)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return int(self._table.num_rows)

    def reals(self, name: str) -> npt.NDArray[np.float64]:
        """Numbers, shape (N,), NaN where null; InputError where the column holds none."""
        column = self._table.column(name)
        if not _is_number(column.type):
            raise InputError(f"{self._path}: column {name} is {column.type}; expected numbers")
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), float)

    def integers(self, name: str) -> npt.NDArray[np.int64] | None:
        """The column, shape (N,), where it is of an integer type and has no null; else None."""
        column = self._table.column(name)
        if column.null_count or not pa.types.is_integer(column.type):
            return None
        try:
            return np.asarray(column.cast(pa.int64()).to_numpy(), np.int64)
        except pa.ArrowInvalid:  # unsigned and beyond what int64 holds
            return None

    def words(self, name: str) -> tuple[npt.NDArray[np.int64], list[str]]:
        """Text as (N,) indices into a list of words; InputError at the first that is null."""
        column = self._table.column(name)
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            raise InputError(f"{self._path}: column {name} is {kind}; expected text")
        encoded = column.cast(kind).cast(pa.string()).dictionary_encode().combine_chunks()
        self.refuse_first(encoded.is_null().to_numpy(zero_copy_only=False), name, "a name")
        return np.asarray(encoded.indices.to_numpy(), np.int64), encoded.dictionary.to_pylist()

    def place(self, row: int) -> str:
        """File and row, counted from 1."""
        return f"{self._path}: row {self._start + row + 1}"

    def cell(self, name: str, row: int) -> object:
        """The value of a cell; None where it is null."""
        value: object = self._table.column(name)[row].as_py()
        return value


def open_parquet(path: Path, wanted: Wanted) -> ParquetColumns:
    """Read the wanted columns; `wanted` picks them from the file's names or refuses them.

    Raises InputError where the file is absent, is no Parquet file or is damaged.
    """
    with _opened(path) as file:
        names = wanted(path, file.schema_arrow.names)
        return ParquetColumns(path, file.read(columns=names))


def parquet_blocks(path: Path, wanted: Wanted, block_rows: int = BLOCK_ROWS) -> Iterator[ParquetColumns]:
    """Read the wanted columns as `open_parquet` does, some rows at a time."""
    start = 0
    with _opened(path) as file:
        names = wanted(path, file.schema_arrow.names)
        for batch in file.iter_batches(block_rows, columns=names):
            yield ParquetColumns(path, pa.Table.from_batches([batch]), start)
            start += batch.num_rows


@contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    try:
        with pq.ParquetFile(path, buffer_size=_READ_BYTES, pre_buffer=False) as file:
            yield file
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; expected a recording") from error
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{path}: not a readable Parquet file ({error}); copy it again") from error


def _is_number(kind: pa.DataType) -> bool:
    return bool(
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_null(kind)
    )
