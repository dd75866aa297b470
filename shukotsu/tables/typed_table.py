"""Declare, write and read typed Parquet tables.

The metadata of a table contain its name and version, the unit and meaning of every column, the hashes of its
inputs and the version of the program. Gaps are null, never NaN.
"""

from __future__ import annotations

import base64
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

from shukotsu.arrays import Array
from shukotsu.errors import InputError, TableError
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.digests import digest_holds, file_sha256, store_digest
from shukotsu.tables.parquet_files import column_ends, naming_damage, open_parquet
from shukotsu.tables.whole_files import files_in, replacing

METADATA_KEY = b"shukotsu"
"""Key of the schema-level metadata, a JSON object, for programs that drop Arrow's field metadata."""

ROW_GROUP_ROWS = 1 << 17

ENCODINGS = {pa.float64(): "BYTE_STREAM_SPLIT"} | dict.fromkeys(
    (pa.int8(), pa.int64()), "DELTA_BINARY_PACKED"
)
"""Parquet encodings by type; text columns have a dictionary, others the plain encoding."""

SEARCHED = ("time_s",)
"""Floating-point columns whose smallest and largest value the footer states, as it does of all others."""

TEXT = pa.dictionary(pa.int32(), pa.string())
"""Type of text columns while a table is written; readers see strings. Arrow does not hash every row then."""


@dataclass(frozen=True)
class Column:
    """A column of a table: Arrow type, unit ("" if it has none) and meaning."""

    name: str
    type: pa.DataType
    unit: str
    description: str
    nullable: bool = False


@dataclass(frozen=True)
class Table:
    """Declaration of a table: meaning of a row, columns, and the key columns that identify a row."""

    name: str
    version: int
    row: str
    columns: tuple[Column, ...]
    key: tuple[str, ...]

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        assert len(set(names)) == len(names), f"{self.name}: a column is declared twice"
        assert set(self.key) <= set(names), f"{self.name}: the key names a column that does not exist"

    def column(self, name: str) -> Column:
        """Return a column by name. Raises KeyError if there is none."""
        return {column.name: column for column in self.columns}[name]

    def arrow_schema(self, metadata: Mapping[str, Any]) -> pa.Schema:
        """Return the Arrow schema, with units and meanings in the fields and also in one JSON object."""
        meanings = {c.name: {"unit": c.unit, "description": c.description} for c in self.columns}
        fields = [pa.field(c.name, c.type, c.nullable, meanings[c.name]) for c in self.columns]
        whole = {
            "schema": self.name,
            "schema_version": self.version,
            "program": PROGRAM,
            "program_version": VERSION,
            "columns": meanings,
            "key": list(self.key),
            **metadata,
        }
        return pa.schema(fields, {METADATA_KEY: json.dumps(whole, ensure_ascii=False, sort_keys=True)})


@dataclass(frozen=True)
class Provenance:
    """Inputs and parameters of a table; no dates or absolute paths, so that files are reproducible."""

    inputs: tuple[tuple[str, str], ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, inputs: Sequence[Path], folder: Path | None = None, **parameters: Any) -> Provenance:
        """Hash the readable input files; of a folder, all its files.

        Parameters
        ----------
        inputs : sequence of Path
            Files and folders.
        folder : Path, optional
            Folder to which names of files below it are relative; other files are named without their folders.
        **parameters : Any
            Parameters, as JSON types.

        Returns
        -------
        Provenance
            Names of files with their SHA-256, and the parameters.

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
        """Return inputs and parameters as entries of a file's metadata."""
        inputs = [{"file": name, "sha256": digest} for name, digest in self.inputs]
        return {"inputs": inputs, "parameters": dict(self.parameters)}


def write_table(path: Path, table: Table, columns: Mapping[str, Any], provenance: Provenance) -> None:
    """Write columns as one typed Parquet file, atomically.

    Parameters
    ----------
    path : Path
        File to write.
    table : Table
        Declaration of the table.
    columns : mapping
        Name -> values, all of one length: arrays, lists or Arrow arrays; NaN becomes null.
    provenance : Provenance
        Inputs and parameters.

    Raises
    ------
    ValueError
        A bug rather than bad input: columns are missing, undeclared, or null against the declaration.

    """
    schema = table.arrow_schema(provenance.metadata())
    data = arrow_table(table, columns, schema)
    with table_writer(path, table, schema) as writer:
        if data.num_rows:
            writer.write_table(data, row_group_size=ROW_GROUP_ROWS)


def write_table_in_parts(
    path: Path, table: Table, parts: Iterable[Mapping[str, Any]], provenance: Provenance
) -> None:
    """Write a table that does not fit into memory, atomically; every part becomes a row group.

    A part is compressed and written while the next one is computed.

    Parameters
    ----------
    path, table, provenance : Path, Table, Provenance
        As for `write_table`.
    parts : iterable of mapping
        Columns as for `write_table`, some rows at a time.

    """
    from concurrent.futures import Future, ThreadPoolExecutor

    schema = table.arrow_schema(provenance.metadata())
    with table_writer(path, table, schema) as writer, ThreadPoolExecutor(1) as pool:
        written: Future[None] | None = None
        for columns in parts:
            data = arrow_table(table, columns, schema)
            if written is not None:
                written.result()
            written = pool.submit(writer.write_table, data, row_group_size=max(1, data.num_rows))
        if written is not None:
            written.result()


def write_failure(path: Path, table: Table, message: str, provenance: Provenance) -> None:
    """Write the table without rows, with the reason in its metadata (see `open_table`)."""
    schema = table.arrow_schema({**provenance.metadata(), "failure": message})
    with table_writer(path, table, schema):
        pass


@dataclass(frozen=True)
class TableFile:
    """A table open for reading, see `open_table`; damage raises TableError.

    It is read by row groups rather than with a scanner of pyarrow.dataset: for an hour of bone poses, with
    all read-ahead off, the scanner takes twice the time and six times the memory, and it trusts a footer that
    has no digest.
    """

    path: Path
    table: Table
    file: pq.ParquetFile
    _ends: dict[tuple[int, str], tuple[Any, Any] | None] = field(default_factory=dict)

    @cached_property
    def group_rows(self) -> list[int]:
        """Number of rows of each row group."""
        return [self.file.metadata.row_group(group).num_rows for group in range(self.file.num_row_groups)]

    @cached_property
    def _index(self) -> dict[str, int]:
        """Index of each column."""
        return {name: index for index, name in enumerate(self.file.schema_arrow.names)}

    @cached_property
    def _sealed(self) -> bool:
        """Whether the file has a digest; cached, as `ends` is called thousands of times."""
        with naming_damage(self.path):
            return digest_holds(self.path) is not None

    def read(self, columns: Sequence[str] | None = None, groups: Sequence[int] | None = None) -> pa.Table:
        """Read columns of row groups.

        Parameters
        ----------
        columns : sequence of str, optional
            Names of the columns; all if omitted.
        groups : sequence of int, optional
            Indices of the row groups; all if omitted.

        Returns
        -------
        pyarrow.Table
            Their rows, checked to be valid.

        Raises
        ------
        TableError
            If the file is damaged.

        """
        names = None if columns is None else list(columns)
        with naming_damage(self.path):
            if groups is None:  # for a few rows, starting threads takes longer than reading
                threads = self.file.metadata.num_rows > ROW_GROUP_ROWS // 2
                rows = self.file.read(names, use_threads=threads)
            else:
                rows = self.file.read_row_groups(list(groups), names, use_threads=False)
            rows.validate(full=True)  # invalid UTF-8 would otherwise raise wherever the text is first used
        return rows

    def ends(self, group: int, name: str) -> tuple[Any, Any] | None:
        """Return the smallest and largest value of a column in a row group, see `column_ends`.

        Parameters
        ----------
        group : int
            Index of the row group.
        name : str
            Name of the column.

        Returns
        -------
        tuple or None
            The two values; None if the footer does not contain them, or if a column that may not be null has
            nulls.

        """
        if (group, name) not in self._ends:
            at, nullable = (group, self._index[name]), self.table.column(name).nullable
            ends = column_ends(self.path, self.file, *at, sealed=self._sealed, nullable=nullable)
            self._ends[group, name] = ends
        return self._ends[group, name]

    def rows_with(
        self,
        keys: Mapping[str, str],
        columns: Sequence[str] | None = None,
        between: Mapping[str, tuple[int, int]] | None = None,
        by: str = "",
    ) -> Iterator[tuple[str, pa.Table]]:
        """Read the rows with the given keys, one row group at a time to limit memory.

        Parameters
        ----------
        keys : mapping
            Key column -> value.
        columns : sequence of str, optional
            Columns to read; all if omitted.
        between : mapping, optional
            Column -> (low, high): row groups without a value in this range are skipped.
        by : str, optional
            Column that is returned as a single value if a row group has only one, and as a column otherwise.

        Yields
        ------
        tuple
            Value of `by` ("" if it is returned as a column), and the rows.

        """
        limits = {name: (value, value) for name, value in keys.items()} | dict(between or {})
        groups: Sequence[int] = range(self.file.num_row_groups)
        for name, (low, high) in limits.items():
            found = [(group, self.ends(group, name)) for group in groups]
            groups = [group for group, ends in found if ends is None or (ends[0] <= high and ends[1] >= low)]
        for group in groups:
            # key columns with several values; text is slow to read, so only these are read
            mixed = [name for name in keys if self.ends(group, name) != limits[name]]
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
    """Open a table of this program for reading.

    Raises
    ------
    InputError
        If the file does not exist, is not a Parquet file, does not match its digest, is another table or
        version, lacks a column or has one of another type, or if the stage that made it recorded a failure.

    """
    with open_parquet(path, f"a {table.name} table") as file:
        _check_schema(path, table, file.schema_arrow)
        yield TableFile(path, table, file)


def read_table(path: Path, table: Table, columns: Sequence[str] | None = None) -> pa.Table:
    """Read a table, or some of its columns. Raises InputError as `open_table`."""
    with open_table(path, table) as file:
        return file.read(columns)


def read_row_groups(path: Path, table: Table, columns: Sequence[str]) -> Iterator[pa.Table]:
    """Read columns of a table, one row group at a time. Raises InputError as `open_table`."""
    with open_table(path, table) as file:
        for group in range(len(file.group_rows)):
            yield file.read(columns, [group])


def read_metadata(path: Path, expected: str = f"a table of {PROGRAM}") -> dict[str, Any]:
    """Return the JSON metadata of a file of this program; all entries are present and of the right type.

    expected : what the file should be, for the error message. Raises InputError if there are no such
    metadata.
    """
    with open_parquet(path, expected) as file:
        return _metadata(path, file.schema_arrow)


def rows_of(table: pa.Table) -> Iterator[Any]:
    """Yield the rows of a small table as dictionaries, null as None; callers annotate their type."""
    for batch in table.to_batches():
        yield from batch.to_pylist()


def column_array(table: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a numerical column as a NumPy array, null as NaN."""
    return np.asarray(table.column(name).to_numpy())


def key_of(row: Mapping[str, Any], columns: Sequence[str]) -> tuple[Any, ...]:
    """Return the values of a row in the given columns, as a key."""
    return tuple(row[name] for name in columns)


def vector_columns(prefix: str, vector: Array, suffix: str = "") -> Any:
    """Return the components of a vector (3,) as columns of a row, named by axis."""
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def vector_of(row: Mapping[str, Any], prefix: str, suffix: str = "") -> Array:
    """Return the vector (3,) in the columns of a row that are named by axis, null as NaN."""
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"], float)


def columns_from_rows(table: Table, rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Convert rows to columns; a nullable column missing from a row becomes null."""
    missing = {c.name for c in table.columns if not c.nullable}
    for row in rows:
        if not missing <= row.keys():
            raise ValueError(f"{table.name}: a row lacks {', '.join(sorted(missing - row.keys()))}")
    return {c.name: [row.get(c.name) for row in rows] for c in table.columns}


def _arrow_array(table: Table, column: Column, values: Any) -> pa.Array:
    """Convert values to an Arrow array of the column's type, NaN as null."""
    if isinstance(values, pa.ChunkedArray):
        values = values.combine_chunks()
    if pa.types.is_string(column.type):
        array = values if isinstance(values, pa.Array) else pa.array(values, column.type, from_pandas=True)
        array = array if array.type == TEXT else array.cast(column.type).dictionary_encode()
    elif isinstance(values, pa.Array):
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
    """Convert columns to an Arrow table to write; text has the type `TEXT`.

    Raises ValueError if the columns are not those declared.
    """
    if set(columns) != {c.name for c in table.columns}:
        odd = sorted(set(columns) ^ {c.name for c in table.columns})
        raise ValueError(f"{table.name}: columns missing or left over: {', '.join(odd)}")
    arrays = [_arrow_array(table, column, columns[column.name]) for column in table.columns]
    return pa.Table.from_arrays(arrays, schema=_written(schema))


def repeated(value: str, count: int) -> pa.Array:
    """Return a text column with the same value in all rows."""
    return pa.DictionaryArray.from_arrays(np.zeros(count, np.int32), pa.array([value]))


def _written(schema: pa.Schema) -> pa.Schema:
    """Return the schema with which a table is written: text has the type `TEXT`."""
    fields = [field.with_type(TEXT) if pa.types.is_string(field.type) else field for field in schema]
    return pa.schema(fields, schema.metadata)


@contextmanager
def table_writer(path: Path, table: Table, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file of the table for writing; it is put in place when it is closed."""
    encodings = {c.name: ENCODINGS[c.type] for c in table.columns if c.type in ENCODINGS}
    with replacing(path) as temporary:
        with pq.ParquetWriter(
            temporary,
            _written(schema),
            store_schema=False,  # it is stored below, as readers are to see it
            compression="zstd",
            compression_level=3,
            use_dictionary=[c.name for c in table.columns if pa.types.is_string(c.type)],
            column_encoding=encodings,
            write_statistics=[c.name for c in table.columns if c.type != pa.float64() or c.name in SEARCHED],
            write_page_checksum=True,
        ) as writer:
            stored = base64.b64encode(schema.serialize().to_pybytes())
            writer.add_key_value_metadata({"ARROW:schema": stored, **schema.metadata})
            yield writer
        store_digest(temporary)


def _metadata(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """Return the checked metadata of a table of this program."""
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
    """Raise InputError if the file is another table or version, lacks columns, or records a failure."""
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
