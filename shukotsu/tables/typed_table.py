"""Typed Parquet tables: one way to declare, to write and to read them.

A table carries, in the file's own metadata, its name and version, the unit and meaning of every column,
the hashes of the inputs that it was made from and the program's version. Gaps are nulls, never NaN.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from shukotsu.errors import InputError, TableError
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.parquet_files import column_ends, naming_damage, open_parquet, store_digest
from shukotsu.tables.whole_files import file_sha256, files_in, replacing

METADATA_KEY = b"shukotsu"
"""Schema-level metadata: one JSON object, for programs that do not keep Arrow's field metadata."""

ROW_GROUP_ROWS = 1 << 17


@dataclass(frozen=True)
class Column:
    """One column: its Arrow type, its unit (empty where it has none) and what it means."""

    name: str
    type: pa.DataType
    unit: str
    description: str
    nullable: bool = False


@dataclass(frozen=True)
class Table:
    """One table of the contract: what it holds, its columns and the columns that identify a row."""

    name: str
    version: int
    row: str
    columns: tuple[Column, ...]
    key: tuple[str, ...]

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        assert len(set(names)) == len(names), f"{self.name}: a column is declared twice"
        assert set(self.key) <= set(names), f"{self.name}: the key names a column that is not there"

    def column(self, name: str) -> Column:
        """Return the column of that name; KeyError where there is none."""
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(name)

    def arrow_schema(self, metadata: Mapping[str, Any]) -> pa.Schema:
        """Return the Arrow schema, units and meanings in the fields, everything again in one JSON object."""
        fields = [
            pa.field(c.name, c.type, c.nullable, {"unit": c.unit, "description": c.description})
            for c in self.columns
        ]
        whole = {
            "schema": self.name,
            "schema_version": self.version,
            "program": PROGRAM,
            "program_version": VERSION,
            "columns": {c.name: {"unit": c.unit, "description": c.description} for c in self.columns},
            "key": list(self.key),
            **metadata,
        }
        return pa.schema(fields, {METADATA_KEY: json.dumps(whole, ensure_ascii=False, sort_keys=True)})


@dataclass(frozen=True)
class Provenance:
    """Record what a table was made from. Holds no date and no absolute path: same input, same bytes."""

    inputs: tuple[tuple[str, str], ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, inputs: Sequence[Path], folder: Path | None = None, **parameters: Any) -> Provenance:
        """Hash the input files that can be read, all of a folder's; `parameters` are JSON types.

        folder : names of files below it are relative to it; others are named without their folders.
        """
        files = [file for path in inputs for file in (files_in(path) if path.is_dir() else [path])]
        names = {
            file: file.relative_to(folder).as_posix() if folder and file.is_relative_to(folder) else file.name
            for file in files
        }
        readable = [file for file in names if file.is_file() and os.access(file, os.R_OK)]
        hashed = tuple((names[file], file_sha256(file)) for file in readable)
        return cls(hashed, parameters)

    def metadata(self) -> dict[str, Any]:
        """Return the part of a file's metadata that says where it came from."""
        return {
            "inputs": [{"file": name, "sha256": digest} for name, digest in self.inputs],
            "parameters": dict(self.parameters),
        }


def write_table(
    path: Path,
    table: Table,
    columns: Mapping[str, Any],
    provenance: Provenance,
    *,
    row_group_rows: int = ROW_GROUP_ROWS,
) -> None:
    """Write the columns as one typed Parquet file, atomically.

    columns: name -> values, all of one length (arrays, lists or Arrow arrays); NaN becomes null.
    row_group_rows: the most rows of a row group.
    Raises ValueError (a bug, not a user's error) where columns are missing, left over or null against
    the declaration.
    """
    data = arrow_table(table, columns, table.arrow_schema(provenance.metadata()))
    with table_writer(path, table, data.schema) as writer:
        if data.num_rows:
            writer.write_table(data, row_group_size=row_group_rows)


def write_table_in_parts(
    path: Path, table: Table, parts: Iterable[Mapping[str, Any]], provenance: Provenance
) -> int:
    """Write a table that is too long for memory, atomically; every part becomes a row group.

    parts : columns as in `write_table`, some rows at a time. Gives the number of rows. A part is compressed
    and written while the next one is made.
    """
    from concurrent.futures import Future, ThreadPoolExecutor

    schema = table.arrow_schema(provenance.metadata())
    rows = 0
    with table_writer(path, table, schema) as writer, ThreadPoolExecutor(1) as pool:
        written: Future[None] | None = None
        for columns in parts:
            data = arrow_table(table, columns, schema)
            if written is not None:
                written.result()
            written = pool.submit(writer.write_table, data, row_group_size=max(1, data.num_rows))
            rows += data.num_rows
        if written is not None:
            written.result()
    return rows


def write_failure(path: Path, table: Table, message: str, provenance: Provenance) -> None:
    """Write the table without rows, the reason why it has none in its metadata (see `read_table`)."""
    schema = table.arrow_schema({**provenance.metadata(), "failure": message})
    with table_writer(path, table, schema):
        pass


@dataclass(frozen=True)
class TableFile:
    """A table that is open for reading, see `open_table`. What is damaged raises TableError.

    It is read by row groups and not by a scanner of pyarrow.dataset, which takes an hour of bone poses at
    twice the time and six times the memory, with all read-ahead off, and trusts a footer without a digest.
    """

    path: Path
    table: Table
    file: pq.ParquetFile

    @cached_property
    def group_rows(self) -> list[int]:
        """Rows of each row group."""
        return [self.file.metadata.row_group(group).num_rows for group in range(self.file.num_row_groups)]

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.file.schema_arrow.names)}

    def read(self, columns: Sequence[str] | None = None, groups: Sequence[int] | None = None) -> pa.Table:
        """Read some columns, or all, of some row groups, or all."""
        names = None if columns is None else list(columns)
        with naming_damage(self.path):
            if groups is None:  # threads start more slowly than a few rows are read
                threads = self.file.metadata.num_rows > ROW_GROUP_ROWS // 2
                rows = self.file.read(names, use_threads=threads)
            else:
                rows = self.file.read_row_groups(list(groups), names, use_threads=False)
            rows.validate(
                full=True
            )  # texts that are no UTF-8 raise where they are looked at, which is anywhere
        return rows

    def ends(self, group: int, name: str, *, with_nulls: bool = False) -> tuple[Any, Any] | None:
        """Return a column's least and largest value in a row group, see `column_ends`."""
        return column_ends(self.path, self.file, group, self._index[name], with_nulls=with_nulls)

    def rows_with(
        self,
        keys: Mapping[str, str],
        columns: Sequence[str] | None = None,
        between: Mapping[str, tuple[int, int]] | None = None,
        by: str = "",
    ) -> Iterator[tuple[str, pa.Table]]:
        """Read the rows that have those keys, a row group at a time, for memory.

        between : numbers that some row of a row group must lie between for it to be read. by : a column of
        which only the value is wanted where it is the same in all of a row group's rows, and which is added
        to the columns elsewhere. Yields that value, empty where there is none, with the rows.
        """
        limits = {name: (value, value) for name, value in keys.items()} | dict(between or {})
        for group in range(self.file.num_row_groups):
            mixed = []  # to read texts costs more than numbers
            for name, limit in limits.items():
                ends = self.ends(group, name)
                if ends is not None and (ends[0] > limit[1] or ends[1] < limit[0]):
                    break
                if ends != limit and name in keys:
                    mixed.append(name)
            else:
                ends = self.ends(group, by) if by else None
                value = ends[0] if ends is not None and ends[0] == ends[1] else ""
                names = None if columns is None else [*columns, *([by] if by and not value else [])]
                wanted = None if names is None else [*dict.fromkeys([*mixed, *names])]
                rows = self.read(wanted, [group])
                for name in mixed:
                    rows = rows.filter(pc.equal(rows.column(name), keys[name]))
                yield value, rows if names is None else rows.select(names)


@contextmanager
def open_table(path: Path, table: Table) -> Iterator[TableFile]:
    """Open a table of the contract for reading.

    Raises InputError where the file is absent, is no Parquet file, has not the bytes of its digest, is
    another table or another version, lacks a column or has one of another type, or records that its own
    making failed.
    """
    with open_parquet(path, f"a {table.name} table") as file:
        _check_schema(path, table, file.schema_arrow)
        yield TableFile(path, table, file)


def read_table(path: Path, table: Table, columns: Sequence[str] | None = None) -> pa.Table:
    """Read a table of the contract, or only some of its columns; raises InputError as `open_table` does."""
    with open_table(path, table) as file:
        return file.read(columns)


def read_row_groups(path: Path, table: Table, columns: Sequence[str]) -> Iterator[pa.Table]:
    """Read some columns of a table one row group after another; raises InputError as `open_table` does."""
    with open_table(path, table) as file:
        for group in range(len(file.group_rows)):
            yield file.read(columns, [group])


def read_metadata(path: Path, expected: str = f"a table of {PROGRAM}") -> dict[str, Any]:
    """Return the JSON object that this program wrote into the file; InputError where there is none.

    All that `Table.arrow_schema` and `Provenance.metadata` write is there, and of its type. expected : what
    the file should be, for the sentences.
    """
    with open_parquet(path, expected) as file:
        return _metadata(path, file.schema_arrow)


def rows_of(table: pa.Table) -> Iterator[dict[str, Any]]:
    """Return the rows of a small table as dictionaries, null as None."""
    for batch in table.to_batches():
        yield from batch.to_pylist()


def column_array(table: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a numeric column as a NumPy array; null as NaN."""
    return np.asarray(table.column(name).to_numpy())


def vector_columns(prefix: str, vector: npt.NDArray[np.float64], suffix: str = "") -> dict[str, float]:
    """Return a vector (3,) as the columns of a row that are named by its axes."""
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def vector_of(row: Mapping[str, Any], prefix: str, suffix: str = "") -> npt.NDArray[np.float64]:
    """Return the columns of a row that are named by the axes of a vector as (3,); null as NaN."""
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"], float)


def columns_from_rows(table: Table, rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Turn rows into columns; a nullable column that a row does not name is null there."""
    missing = {c.name for c in table.columns if not c.nullable}
    for row in rows:
        if not missing <= row.keys():
            raise ValueError(f"{table.name}: a row lacks {', '.join(sorted(missing - row.keys()))}")
    return {c.name: [row.get(c.name) for row in rows] for c in table.columns}


def _arrow_array(table: Table, column: Column, values: Any) -> pa.Array:
    if isinstance(values, pa.ChunkedArray):
        values = values.combine_chunks()
    if isinstance(values, pa.Array):
        array = values.cast(column.type)
        if pa.types.is_floating(column.type):
            array = pa.array(array.to_numpy(zero_copy_only=False), column.type, from_pandas=True)
    elif isinstance(values, np.ndarray) and values.ndim == 2:
        flat = pa.array(values.ravel(), column.type.value_type, from_pandas=True)
        array = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    else:
        array = pa.array(values, column.type, from_pandas=True)
    if array.null_count and not column.nullable:
        raise ValueError(f"{table.name}: column {column.name} may not be null")
    return array


def arrow_table(table: Table, columns: Mapping[str, Any], schema: pa.Schema) -> pa.Table:
    """Return columns as one Arrow table of that schema; ValueError where they are not those declared."""
    if set(columns) != {c.name for c in table.columns}:
        odd = sorted(set(columns) ^ {c.name for c in table.columns})
        raise ValueError(f"{table.name}: columns missing or left over: {', '.join(odd)}")
    arrays = [_arrow_array(table, column, columns[column.name]) for column in table.columns]
    return pa.Table.from_arrays(arrays, schema=schema)


@contextmanager
def table_writer(path: Path, table: Table, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file of the table for writing; it takes its name when it closes."""
    encodings = {}
    for column in table.columns:
        if pa.types.is_floating(column.type):
            encodings[column.name] = "BYTE_STREAM_SPLIT"
        elif pa.types.is_integer(column.type):
            encodings[column.name] = "DELTA_BINARY_PACKED"
    with replacing(path) as temporary:
        with pq.ParquetWriter(
            temporary,
            schema,
            compression="zstd",
            compression_level=3,
            use_dictionary=[c.name for c in table.columns if pa.types.is_string(c.type)],
            column_encoding=encodings,
            write_page_checksum=True,
        ) as writer:
            yield writer
        store_digest(temporary)


def _metadata(path: Path, schema: pa.Schema) -> dict[str, Any]:
    key = METADATA_KEY.decode()
    raw = (schema.metadata or {}).get(METADATA_KEY)
    if raw is None:
        raise TableError(f"{path}: a Parquet file, but not one that {PROGRAM} wrote (no {key} metadata)")
    program = {"program": "", "program_version": ""}
    try:
        loaded = json.loads(raw)
        whole: dict[str, Any] = {**program, "inputs": [], "parameters": {}, "columns": {}, **loaded}
        entries = [(entry, ("file", "sha256")) for entry in whole["inputs"]]
        entries += [(entry, ("unit", "description")) for entry in whole["columns"].values()]
        checked = all(isinstance(text, str) for text in (whole["schema"], whole.get("failure", "")))
        checked &= all(isinstance(whole[name], str) for name in program)
        checked &= all(isinstance(entry[name], str) for entry, names in entries for name in names)
        checked &= isinstance(whole["schema_version"], int) and isinstance(whole["parameters"], dict)
        if checked:
            return whole
        raise TypeError("an entry is of another type")
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise TableError(f"{path}: its {key} metadata are damaged; make it again") from error


def _check_schema(path: Path, table: Table, schema: pa.Schema) -> None:
    metadata = _metadata(path, schema)
    if metadata["schema"] != table.name:
        raise TableError(f"{path}: is a {metadata['schema']} table; expected {table.name}")
    if metadata["schema_version"] != table.version:
        raise TableError(
            f"{path}: {table.name} version {metadata['schema_version']}; this program reads version "
            f"{table.version}; make the file again"
        )
    types = {field.name: field.type for field in schema}
    for column in table.columns:
        if types.get(column.name) != column.type:
            kind = f"is {types[column.name]}" if column.name in types else "is missing"
            raise TableError(f"{path}: column {column.name} {kind}; expected {column.type}")
    if "failure" in metadata:
        raise InputError(metadata["failure"])
