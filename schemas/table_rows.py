"""Rows of long tables: read by their words a row group at a time, and parts packed into row groups."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from schemas.errors import InputError
from schemas.tables import Table, open_table

Array = npt.NDArray[np.float64]
Words = tuple[str, ...]

LONG_ROW_GROUP_ROWS = 1 << 15
"""Of tables that are written while they are made, a row group in memory at a time."""


class TableRows:
    """Number columns of a long table, read by what its words are.

    words : the columns that say what a row is of; rows alike in them follow each other. numbers : columns to
    read, null as NaN. Raises InputError where the file is not that table.
    """

    def __init__(self, path: Path, table: Table, words: Sequence[str], numbers: Sequence[str]) -> None:
        open_table(path, table).close()
        self._path, self._table = path, table
        self._words, self._numbers = tuple(words), tuple(numbers)
        self._last: tuple[int, list[tuple[Words, Array]]] = (-1, [])

    def of(self, *wanted: str) -> Joined:
        """Numbers (N, columns) of the rows with those words, in order."""
        place = f"{self._path}: {', '.join(filter(None, wanted))}"
        return Joined((numbers for _, numbers in self.runs(*wanted)), len(self._numbers), place)

    def runs(self, *wanted: str) -> Iterator[tuple[Words, Array]]:
        """Rows whose first words are those, in order: words and numbers (N, columns) of rows alike in words.

        Raises InputError where the file is damaged.
        """
        with open_table(self._path, self._table) as file:
            for group in range(file.metadata.num_row_groups):
                if _may_hold(file.metadata.row_group(group), self._words, wanted):
                    for words, numbers in self._read(file, group):
                        if words[: len(wanted)] == wanted:
                            yield words, numbers

    def _read(self, file: pq.ParquetFile, group: int) -> list[tuple[Words, Array]]:
        """A row group cut where its words change; the last one is kept, as digits share row groups."""
        if self._last[0] == group:
            return self._last[1]
        try:
            read = file.read_row_group(group, columns=[*self._words, *self._numbers], use_threads=False)
        except (OSError, ValueError, pa.ArrowException) as error:
            raise InputError(f"{self._path}: damaged Parquet file ({error}); make it again") from error
        numbers = np.stack([column.to_numpy() for column in read.select(self._numbers).columns], -1)
        encoded = [read.column(name).combine_chunks().dictionary_encode() for name in self._words]
        changes = np.zeros(len(numbers), bool)
        changes[:1] = True
        for words in encoded:
            changes[1:] |= np.diff(words.indices.to_numpy()) != 0
        starts = np.flatnonzero(changes).tolist()
        runs = [
            (tuple(words[start].as_py() for words in encoded), numbers[start:end])
            for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True)
        ]
        self._last = (group, runs)
        return runs


def _may_hold(group: pq.RowGroupMetaData, words: Sequence[str], wanted: Words) -> bool:
    """Whether a row group's least and largest words leave room for those wanted."""
    of_name = {group.column(index).path_in_schema: index for index in range(group.num_columns)}
    for name, word in zip(words, wanted, strict=False):
        told = group.column(of_name[name]).statistics
        if told is not None and told.has_min_max and not told.min <= word <= told.max:
            return False
    return True


class Joined:
    """Arrays (N, width) as if they were one, to be taken from the front; place : where they are from."""

    def __init__(self, parts: Iterator[Array], width: int, place: str) -> None:
        self._parts, self._waiting, self._place = parts, np.empty((0, width)), place

    def take(self, count: int) -> Array:
        """Give the next rows. Raises InputError where there are fewer."""
        found = [self._waiting]
        while sum(map(len, found)) < count:
            more = next(self._parts, None)
            if more is None:
                raise InputError(
                    f"{self._place} has fewer frames than the recording; make it again from the same poses"
                )
            found.append(more)
        joined = np.concatenate(found)
        self._waiting = joined[count:]
        return joined[:count]


def in_row_groups(
    parts: Iterable[Mapping[str, Any]], rows: int = LONG_ROW_GROUP_ROWS
) -> Iterator[dict[str, Any]]:
    """Columns joined and cut again into parts of so many rows, the last one of fewer; all in order."""
    waiting: list[pa.Table] = []
    for part in parts:
        waiting.append(pa.table(dict(part)))
        while sum(table.num_rows for table in waiting) >= rows:
            joined = pa.concat_tables(waiting)
            yield _columns(joined.slice(0, rows))
            waiting = [joined.slice(rows)]
    if sum(table.num_rows for table in waiting):
        yield _columns(pa.concat_tables(waiting))


def constant(word: str, count: int) -> pa.Array:
    """The same word in every row."""
    return pa.repeat(pa.scalar(word, pa.string()), count)


def _columns(table: pa.Table) -> dict[str, Any]:
    return {name: table.column(name) for name in table.column_names}
