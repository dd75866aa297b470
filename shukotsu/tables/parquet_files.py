"""Open Parquet files, in one place, so that damage is detected and reported, and never read as data.

A file written by this program contains the SHA-256 of its bytes, stored between the last page and the footer.
Parquet readers ignore that gap: the footer gives the positions of pages from the start of the file and is
itself found from the end. In addition every page has a CRC-32, which remains when another program rewrites
the file, but does not protect page headers and the footer with its statistics and metadata.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from shukotsu.errors import InputError, TableError
from shukotsu.tables import digests, limits, text_files, whole_files

_VALUE_BYTES = 8


def open_parquet(path: Path, expected: str, remedy: str = "", buffer_size: int = 0) -> pq.ParquetFile:
    """Open a Parquet file for reading in parts.

    Parameters
    ----------
    path : Path
        The file.
    expected, remedy : str
        What the file should be and what to do if it is not, for the error message.
    buffer_size : int
        Bytes of a column to read at a time; 0 for a whole row group.

    Returns
    -------
    ParquetFile
        The open file.

    Raises
    ------
    TableError
        If the file is absent, not a Parquet file, damaged, or declares far more data than its size allows.

    """
    try:
        with text_files.reading(path, expected), naming_damage(path, remedy, "not a readable Parquet file"):
            limits.check_regular(path, expected)
            if digests.digest_holds(path) is False:
                raise ValueError("its checksum does not match")
            file = pq.ParquetFile(
                path,
                buffer_size=buffer_size,
                pre_buffer=False,  # no read-ahead: some files are read in parts
                page_checksum_verification=True,
            )
        declared_bytes = _VALUE_BYTES * file.metadata.num_rows * file.metadata.num_columns
        limits.check_expansion(path, declared_bytes, lambda: remedy or whole_files.remedy_of(path))
    except InputError as refused:
        raise TableError(refused.message) from refused
    return file


@contextmanager
def naming_damage(path: Path, remedy: str = "", what: str = "damaged Parquet file") -> Iterator[None]:
    """Convert errors of reading a Parquet file into a TableError that names the file."""
    try:
        yield
    except (FileNotFoundError, InputError, MemoryError):
        raise
    except (OSError, ValueError, RuntimeError, pa.ArrowException) as damage:  # pyarrow's C++: RuntimeError
        # a UnicodeDecodeError has the attribute `reason`
        reason = getattr(damage, "strerror", None) or getattr(damage, "reason", None) or damage
        raise TableError(f"{path}: {what} ({reason}); {remedy or whole_files.remedy_of(path)}") from damage


def column_ends(
    path: Path, file: pq.ParquetFile, group: int, column: int, *, sealed: bool, nullable: bool
) -> tuple[Any, Any] | None:
    """Return the smallest and largest value of a column in a row group, from the footer's statistics.

    If a footer contradicts itself, pyarrow aborts the process when its statistics are read. For a file
    without a digest, whose footer may have been changed, the column is therefore read first, which raises an
    exception instead, and its type is compared.

    Parameters
    ----------
    path : Path
        The file.
    file : ParquetFile
        The same file, open.
    group, column : int
        Indices of the row group and the column.
    sealed : bool
        Whether the file has a digest (`digest_holds`).
    nullable : bool
        Whether the column may have nulls.

    Returns
    -------
    tuple or None
        Smallest and largest value; None if the statistics are missing or do not cover every row.

    Raises
    ------
    TableError
        If the file is damaged.

    """
    with naming_damage(path):
        if not sealed:
            file.read_row_group(group, [file.schema.column(column).path], use_threads=False)
        chunk = file.metadata.row_group(group).column(column)
        if not sealed and chunk.physical_type != file.schema.column(column).physical_type:
            raise ValueError("a column's type is not that of its schema")
        statistics = chunk.statistics
        if statistics is None or not statistics.has_min_max or (statistics.null_count and not nullable):
            return None
        return statistics.min, statistics.max
