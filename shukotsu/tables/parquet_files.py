"""Parquet files: opened in one place, so that damage is noticed, named, and never read as a number.

A file that this program writes carries the SHA-256 of its bytes. It stands between the last page and the
footer, where no Parquet reader looks: the footer names pages by their place from the file's start, and is
itself found from the end. Every page has a CRC-32 besides, which holds when another program wrote the file
again; those leave pages' headers and the footer, with its statistics and metadata, unprotected.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from shukotsu.errors import InputError, TableError
from shukotsu.tables.limits import check_expansion, check_regular
from shukotsu.tables.text_files import reading
from shukotsu.tables.whole_files import file_state, remedy_of

_MARK = b"SHUKOTSU SHA-256"
_DIGEST_BYTES = 32
_PIECE_BYTES = 1 << 20
_VALUE_BYTES = 8
_END_BYTES = 8
"""The footer's length and the letters that end every Parquet file."""


def store_digest(path: Path) -> None:
    """Put the digest of a finished Parquet file into it; the file is as readable as before."""
    with path.open("r+b") as stream:
        footer_at = _footer_at(stream)
        stream.seek(0)
        digest = hashlib.file_digest(stream, "sha256").digest()
        stream.seek(footer_at)
        footer = stream.read()
        stream.seek(footer_at)
        stream.write(_MARK + digest + footer)


@lru_cache(maxsize=4096)
def _digest_holds(path: Path, *_: int) -> bool | None:
    """Return whether a file has the digest that it carries; None where it carries none (see the module).

    It is read once for as long as its state stays as it is.
    """
    with path.open("rb") as stream:
        footer_at = _footer_at(stream)
        stored_at = footer_at - len(_MARK) - _DIGEST_BYTES
        if stored_at < 0:
            return None
        stream.seek(stored_at)
        if stream.read(len(_MARK)) != _MARK:
            return None
        stored = stream.read(_DIGEST_BYTES)
        digest = hashlib.sha256()
        stream.seek(0)
        while left := stored_at - stream.tell():
            digest.update(stream.read(min(left, _PIECE_BYTES)))
        stream.seek(footer_at)
        digest.update(stream.read())
    return digest.digest() == stored


def _footer_at(stream: BinaryIO) -> int:
    """Return the footer's start, as the file's last bytes say; they may be anything, and this below 0."""
    end = stream.seek(0, 2)
    stream.seek(max(0, end - _END_BYTES))
    return end - _END_BYTES - int.from_bytes(stream.read(4), "little")


def open_parquet(
    path: Path,
    expected: str,
    remedy: str = "",
    buffer_size: int = 0,
) -> pq.ParquetFile:
    """Open a Parquet file for reading piece by piece; `expected` and `remedy` are for the sentences.

    buffer_size : how many bytes of a column are read at a time, 0 for all of a row group's.
    Raises TableError where the file is absent, is none, is damaged, or holds far more than its size.
    """
    try:
        with reading(path, expected), naming_damage(path, remedy, "not a readable Parquet file"):
            check_regular(path, expected)
            if _digest_holds(path.absolute(), *file_state(path)) is False:
                raise ValueError("not the bytes of its checksum")
            file = pq.ParquetFile(
                path,
                buffer_size=buffer_size,
                pre_buffer=False,  # not far ahead: some are read in parts
                page_checksum_verification=True,
            )
        check_expansion(
            path, _VALUE_BYTES * file.metadata.num_rows * file.metadata.num_columns, remedy or remedy_of(path)
        )
    except InputError as refused:
        raise TableError(refused.message) from refused
    return file


@contextmanager
def naming_damage(path: Path, remedy: str = "", what: str = "damaged Parquet file") -> Iterator[None]:
    """Turn what goes wrong when a Parquet file is read into a TableError that names it."""
    try:
        yield
    except (FileNotFoundError, InputError, MemoryError):
        raise
    except (OSError, ValueError, RuntimeError, pa.ArrowException) as damage:  # RuntimeError: of pyarrow's C++
        reason = getattr(damage, "strerror", None) or damage
        raise TableError(f"{path}: {what} ({reason}); {remedy or remedy_of(path)}") from damage


def column_ends(
    path: Path, file: pq.ParquetFile, group: int, column: int, *, with_nulls: bool = False
) -> tuple[Any, Any] | None:
    """Return a column's least and largest value in a row group of an open file; None where not known of every
    row, or with_nulls of every one that has a value.

    Where a footer contradicts itself, pyarrow ends the process when it is asked for that. So of a file that
    carries no digest, whose footer anything may have changed, the column is read first, which raises, and its
    type compared. Raises TableError where the file is damaged.
    """
    with naming_damage(path):
        sealed = _digest_holds(path.absolute(), *file_state(path)) is not None
        if not sealed:
            file.read_row_group(group, [file.schema.column(column).path], use_threads=False)
        chunk = file.metadata.row_group(group).column(column)
        if not sealed and chunk.physical_type != file.schema.column(column).physical_type:
            raise ValueError("a column's type is not that of its schema")
        statistics = chunk.statistics
        if statistics is None or not statistics.has_min_max or (statistics.null_count and not with_nulls):
            return None
        return statistics.min, statistics.max
