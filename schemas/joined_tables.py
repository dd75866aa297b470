"""Tables of many hands put together without decoding them: bytes are copied, and a new footer says where to.

A Parquet file is its row groups' pages and, behind them, a footer that says where each lies and what schema
they have (structures of Apache Parquet's parquet.thrift, in Thrift's compact protocol). Pages of files of one
schema and one writer may stand in one file as they are; only the offsets in the footer move. Small row groups
cost readers more than their rows do, so those are decoded and written as larger ones.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from schemas.errors import InputError
from schemas.files import file_sha256, replacing
from schemas.tables import (
    METADATA_KEY,
    ROW_GROUP_ROWS,
    Provenance,
    Table,
    open_table,
    write_table,
    write_table_in_parts,
)

COPIED_FROM_BYTES = 1 << 16
"""Files of so many bytes a row group are copied; of smaller ones the rows are put together."""

_MAGIC = b"PAR1"
_TAIL, _BLOCK = 1 << 16, 1 << 18

# Kinds of value in the compact protocol; true and false take a byte in a list, and none as a field.
_I16, _BINARY, _STRUCT = 4, 8, 12
_YES_NO, _VARINTS, _LISTS, _BYTES = (1, 2), (4, 5, 6), (9, 10), {1: 0, 2: 0, 3: 1, 7: 8}

# What must change in a RowGroup, by number of the field; all else is copied as it is.
_OFFSET, _ROWS, _ORDINAL, _ELSEWHERE, _TEXT = "offset", "rows", "ordinal", "elsewhere", "text"
_Wanted = Mapping[int, "str | _Wanted"]
_COLUMN_META_DATA: _Wanted = {
    9: _OFFSET,  # data_page_offset
    10: _OFFSET,  # index_page_offset
    11: _OFFSET,  # dictionary_page_offset
    14: _ELSEWHERE,  # bloom_filter_offset
}
_COLUMN_CHUNK: _Wanted = {
    1: _ELSEWHERE,  # file_path
    2: _OFFSET,  # file_offset; 0 means none
    3: _COLUMN_META_DATA,
    4: _ELSEWHERE,  # offset_index_offset
    6: _ELSEWHERE,  # column_index_offset
    8: _ELSEWHERE,  # crypto_metadata
}
_ROW_GROUP: _Wanted = {1: _COLUMN_CHUNK, 3: _ROWS, 5: _OFFSET, 7: _ORDINAL}
_NUM_ROWS, _ROW_GROUPS, _KEY_VALUES = 3, 4, 5  # of FileMetaData

_Edit = tuple[str, int, int, int, int]
"""A field to change: what it is, where it, its value and the next field begin, and its value."""


class _UnlikeError(Exception):
    """Why a file's pages cannot be copied."""


@dataclass(frozen=True)
class _RowGroup:
    """A row group's footer entry and what in it must change (places count from its start)."""

    entry: bytes
    rows: int
    edits: tuple[_Edit, ...]

    def shifted(self, by: int) -> bytes:
        """The entry of pages that moved so far, without its ordinal: optional, and no larger than 32767."""
        pieces, done = [], 0
        for what, begin, value_at, end, value in self.edits:
            if what == _OFFSET and value:
                pieces += [self.entry[done:value_at], _varint(value + by << 1)]
            elif what == _ORDINAL:
                pieces.append(self.entry[done:begin])
            else:
                continue
            done = end
        return b"".join([*pieces, self.entry[done:]])


@dataclass(frozen=True)
class _Footer:
    """A footer taken apart.

    fields : of FileMetaData, by number, as bytes with their headers. pages_end : where the footer begins.
    """

    fields: Mapping[int, bytes]
    groups: tuple[_RowGroup, ...]
    pages_end: int

    def like(self, other: _Footer) -> bool:
        """Whether version, schema, writer and order of columns are the same, and so may be the file."""
        mine, others = (
            {n: own for n, own in each.fields.items() if n not in (_NUM_ROWS, _ROW_GROUPS, _KEY_VALUES)}
            for each in (self, other)
        )
        return mine == others

    def with_groups(self, rows: int, entries: list[bytes]) -> bytes:
        """The footer of these row groups, from FileMetaData to the end of the file."""
        n = len(entries)
        size = bytes([n << 4 | _STRUCT]) if n < 15 else bytes([15 << 4 | _STRUCT]) + _varint(n)
        own = {
            **self.fields,
            _NUM_ROWS: self.fields[_NUM_ROWS][:1] + _varint(rows << 1),
            _ROW_GROUPS: b"".join([self.fields[_ROW_GROUPS][:1], size, *entries]),
        }
        whole = b"".join([*(own[number] for number in sorted(own)), b"\0"])
        return b"".join([whole, len(whole).to_bytes(4, "little"), _MAGIC])


@dataclass
class _Pages:
    """Pages of alike files behind each other, and their footer entries."""

    at: int = len(_MAGIC)
    rows: int = 0
    entries: list[bytes] = field(default_factory=list)

    def append(self, footer: _Footer) -> None:
        """Move a file's row groups to where its pages are copied to; those without rows are dropped."""
        shift = self.at - len(_MAGIC)
        kept = [group for group in footer.groups if group.rows]
        self.entries += [group.shifted(shift) for group in kept]
        self.rows += sum(group.rows for group in kept)
        self.at += footer.pages_end - len(_MAGIC)


def join_tables(
    path: Path,
    table: Table,
    parts: Iterable[Path],
    provenance: Callable[[dict[Path, str]], Provenance],
    failed: Callable[[Path, InputError], None],
    *,
    row_group_rows: int = ROW_GROUP_ROWS,
) -> None:
    """Write one table of the rows of its parts, in their order, atomically; memory does not grow with them.

    The same parts give the same bytes. Row groups of COPIED_FROM_BYTES are copied as they are, pages unread;
    smaller ones, and those of another writer, become row groups of row_group_rows or more.
    provenance : gets the SHA-256 of every part that is there, failed or not, in turn, and gives what is to be
    written down. failed : is called for a part that cannot be read or records that its own making failed.
    """
    parts = list(parts)
    with replacing(path) as temporary:
        failures = _join(temporary, table, parts, provenance, row_group_rows, COPIED_FROM_BYTES)
        if not _readable(temporary):  # a part's footer is damaged: decoding says whose
            failures = _join(temporary, table, parts, provenance, row_group_rows, None)
    for part, reason in failures.items():
        failed(part, reason)


def _join(
    path: Path,
    table: Table,
    parts: Iterable[Path],
    provenance: Callable[[dict[Path, str]], Provenance],
    row_group_rows: int,
    copied_from_bytes: int | None,
) -> dict[Path, InputError]:
    """Write the joined table, nothing copied where copied_from_bytes is None; give what failed."""
    digests: dict[Path, str] = {}
    failures: dict[Path, InputError] = {}
    with path.open("wb") as out, tempfile.TemporaryDirectory() as folder:
        joining = _Joining(table, out, Path(folder), row_group_rows, copied_from_bytes)
        for part in parts:
            try:
                digests[part] = joining.add(part)
            except InputError as error:
                failures[part] = error
                if part.is_file():
                    digests[part] = file_sha256(part)
        joining.finish(provenance(digests))
    return failures


def read_joined(table: Table, parts: Iterable[Path], failed: Callable[[Path, InputError], None]) -> pa.Table:
    """Read the rows of the parts as one table without metadata; `failed` as in `join_tables`."""
    bare = table.arrow_schema({}).remove_metadata()
    found = [bare.empty_table()]
    for part in parts:
        try:
            found.append(_rows(part, table, bare))
        except InputError as error:
            failed(part, error)
    return pa.concat_tables(found)


class _Joining:
    """A joined table while it is written: row groups copied, and rows that wait to become one."""

    def __init__(
        self, table: Table, out: BinaryIO, folder: Path, row_group_rows: int, copied_from_bytes: int | None
    ) -> None:
        self._table, self._out, self._folder = table, out, folder
        self._row_group_rows, self._copied_from_bytes = row_group_rows, copied_from_bytes
        self._bare = table.arrow_schema({}).remove_metadata()
        self._head = _empty(table, Provenance(), folder)
        self._pages = _Pages()
        self._waiting, self._n_waiting = [self._bare.empty_table()], 0
        self._out.write(_MAGIC)

    def add(self, part: Path) -> str:
        """Add a part's rows; give its SHA-256. Raises InputError as `read_table` does."""
        footer = self._copyable(part)
        if footer is not None:
            self._write_waiting()
            return self._copy(part, footer)
        rows = _rows(part, self._table, self._bare)
        self._waiting.append(rows)
        self._n_waiting += rows.num_rows
        if self._n_waiting >= self._row_group_rows:
            self._write_waiting()
        return file_sha256(part)

    def _copyable(self, part: Path) -> _Footer | None:
        """The footer of a part whose pages are to be copied; None where they are not."""
        least = self._copied_from_bytes
        try:
            size = part.stat().st_size
            if least is None or size < least:
                return None
            footer = _read_footer(part)
            found = _own_metadata(footer)
        except (OSError, ValueError, _UnlikeError):
            return None
        declared = (found.get("schema"), found.get("schema_version")) == (
            self._table.name,
            self._table.version,
        )
        sound = declared and "failure" not in found and footer.like(self._head)
        return footer if sound and size >= least * len(footer.groups) else None

    def finish(self, provenance: Provenance) -> None:
        """Write what waits, and the footer."""
        self._write_waiting()
        head = _empty(self._table, provenance, self._folder)
        self._out.write(head.with_groups(self._pages.rows, self._pages.entries))

    def _copy(self, part: Path, footer: _Footer) -> str:
        """Copy a file's pages; give the SHA-256 of the whole file."""
        digest, block, at = hashlib.sha256(), memoryview(bytearray(_BLOCK)), 0
        with part.open("rb", buffering=0) as stream:
            while n := stream.readinto(block):
                digest.update(block[:n])
                begin = len(_MAGIC) if at == 0 else 0
                self._out.write(block[begin : max(begin, min(n, footer.pages_end - at))])
                at += n
        self._pages.append(footer)
        return digest.hexdigest()

    def _write_waiting(self) -> None:
        """Write the rows that wait as one row group."""
        rows = pa.concat_tables(self._waiting)
        self._waiting, self._n_waiting = self._waiting[:1], 0
        if rows.num_rows:
            own = self._folder / "row_group.parquet"
            columns = {column.name: rows.column(column.name) for column in self._table.columns}
            write_table(own, self._table, columns, Provenance(), row_group_rows=[rows.num_rows])
            self._copy(own, _read_footer(own))


def _rows(part: Path, table: Table, bare: pa.Schema) -> pa.Table:
    """A part's rows without metadata. Raises InputError as `read_table` does, which is for longer tables."""
    with open_table(part, table) as file:
        try:
            rows = file.read(columns=bare.names, use_threads=False)
        except (OSError, ValueError, pa.ArrowException) as error:
            raise InputError(f"{part}: damaged Parquet file ({error}); make it again") from error
    return pa.Table.from_arrays(rows.columns, schema=bare)


def _empty(table: Table, provenance: Provenance, folder: Path) -> _Footer:
    """The footer of the table without rows."""
    path = folder / "empty.parquet"
    write_table_in_parts(path, table, (), provenance)
    return _read_footer(path)


def _readable(path: Path) -> bool:
    """Whether a file's footer can be read as a whole."""
    try:
        pq.read_metadata(path)
    except (OSError, ValueError, pa.ArrowException):
        return False
    return True


def _read_footer(path: Path) -> _Footer:
    """Read a file's footer. Raises OSError, and _UnlikeError where it is not as this program's are."""
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(-min(size, _TAIL), os.SEEK_END)
        tail = stream.read()
        length = int.from_bytes(tail[-8:-4], "little")
        if tail[-4:] != _MAGIC or not 0 < length <= size - 12:
            raise _UnlikeError
        if len(tail) < length + 8:
            stream.seek(-length - 8, os.SEEK_END)
            tail = stream.read()
    try:
        return _parsed(tail[-length - 8 : -8], size - length - 8)
    except (IndexError, RecursionError) as error:
        raise _UnlikeError from error


def _parsed(data: bytes, pages_end: int) -> _Footer:
    """Take a FileMetaData apart; IndexError where it ends before its end."""
    fields: dict[int, bytes] = {}
    groups: list[_RowGroup] = []
    at = number = 0
    while data[at]:
        begin = at
        number, kind, at = _field(data, at, number)
        if number == _ROW_GROUPS:
            n, _, at = _list(data, at)
            for _ in range(n):
                group, at = _row_group(data, at, pages_end)
                groups.append(group)
        else:
            at = _skipped(data, at, kind)
        fields[number] = data[begin:at]
    if at + 1 != len(data) or not fields.keys() >= {_NUM_ROWS, _ROW_GROUPS, _KEY_VALUES}:
        raise _UnlikeError
    return _Footer(fields, tuple(groups), pages_end)


def _row_group(data: bytes, begin: int, pages_end: int) -> tuple[_RowGroup, int]:
    found: list[_Edit] = []
    end = _walk(data, begin, _ROW_GROUP, found)
    rows = [value for what, _, _, _, value in found if what == _ROWS]
    astray = any(
        what == _ELSEWHERE or (what == _OFFSET and not 0 <= value < pages_end)
        for what, _, _, _, value in found
    )
    last, _, _, behind, _ = found[-1] if found else ("", 0, 0, 0, 0)
    if astray or len(rows) != 1 or rows[0] < 0 or (last == _ORDINAL and data[behind]):
        raise _UnlikeError  # of an ordinal followed by more fields the next one's number would change
    edits = tuple((what, a - begin, b - begin, c - begin, value) for what, a, b, c, value in found)
    return _RowGroup(data[begin:end], rows[0], edits), end


def _own_metadata(footer: _Footer) -> dict[str, Any]:
    """The JSON object that this program wrote into a footer's key-values; empty where there is none."""
    key_values = footer.fields[_KEY_VALUES]
    n, _, at = _list(key_values, 1)
    for _ in range(n):
        found: list[_Edit] = []
        at = _walk(key_values, at, {1: _TEXT, 2: _TEXT}, found)
        key, *values = [key_values[begin:end] for _, _, begin, end, _ in found]
        if key == METADATA_KEY and values:
            loaded: dict[str, Any] = json.loads(values[0])
            return loaded
    return {}


def _walk(data: bytes, at: int, wanted: _Wanted, found: list[_Edit]) -> int:
    """Go through a struct, add its wanted fields to `found`; give the place behind it."""
    number = 0
    while data[at]:
        begin = at
        number, kind, at = _field(data, at, number)
        inner = wanted.get(number)
        if inner is None:
            at = _skipped(data, at, kind)
        elif isinstance(inner, str):
            value, value_at = _unsigned(data, at)
            if kind == _BINARY:
                at = value_at + value
                found.append((inner, begin, value_at, at, value))
            else:
                found.append((inner, begin, at, value_at, value >> 1 ^ -(value & 1)))
                at = value_at
        elif kind == _STRUCT:
            at = _walk(data, at, inner, found)
        else:
            n, _, at = _list(data, at)
            for _ in range(n):
                at = _walk(data, at, inner, found)
    return at + 1


def _struct_skipped(data: bytes, at: int) -> int:
    """The place behind a struct. Most of a footer is statistics, so this is what reading one takes."""
    while head := data[at]:
        at += 1
        if head < 16:  # the number is not the one before it and a step, but stands here
            at = _skipped(data, at, _I16)
        kind = head & 15
        if kind == _BINARY and data[at] < 128:
            at += data[at] + 1
        elif kind in _VARINTS:
            while data[at] > 127:
                at += 1
            at += 1
        elif kind not in _YES_NO:
            at = _skipped(data, at, kind)
    return at + 1


def _field(data: bytes, at: int, before: int) -> tuple[int, int, int]:
    """A field's number and kind, and where its value begins; `before` is the number of the one before it."""
    head = data[at]
    if head >> 4:
        return before + (head >> 4), head & 15, at + 1
    number, at = _unsigned(data, at + 1)
    return number >> 1 ^ -(number & 1), head & 15, at


def _list(data: bytes, at: int) -> tuple[int, int, int]:
    """How long a list is, of which kind, and where its first element begins."""
    head = data[at]
    if head >> 4 < 15:
        return head >> 4, head & 15, at + 1
    n, at = _unsigned(data, at + 1)
    return n, head & 15, at


def _skipped(data: bytes, at: int, kind: int) -> int:
    """The place behind a value of that kind."""
    if kind in _VARINTS:
        while data[at] > 127:
            at += 1
        return at + 1
    if kind == _BINARY:
        n, at = _unsigned(data, at)
        return at + n
    if kind == _STRUCT:
        return _struct_skipped(data, at)
    if kind in _LISTS:
        n, kind, at = _list(data, at)
        if kind in _YES_NO:
            return at + n
        for _ in range(n):
            at = _skipped(data, at, kind)
        return at
    if kind in _BYTES:
        return at + _BYTES[kind]
    raise IndexError(f"no such kind: {kind}")


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    """A varint, and the place behind it."""
    value = data[at] & 127
    shift = 7
    while data[at] > 127:
        at += 1
        value |= (data[at] & 127) << shift
        shift += 7
    return value, at + 1


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    found.append(value)
    return bytes(found)
