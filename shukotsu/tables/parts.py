"""Subject tables: one file with the rows of all skeletons of a subject, in which each skeleton is a part.

A part is one hand under one model, made from all calibration recordings or without those of one task. It
either has rows, or it failed and the file contains the reason. The file's metadata list the parts with their
parameters.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, fields
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError, TableError, count_of, list_names
from shukotsu.tables.parquet_files import open_parquet
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.typed_table import (
    Provenance,
    Table,
    TableFile,
    arrow_table,
    columns_from_rows,
    open_table,
    repeated,
    rows_of,
    table_writer,
)
from shukotsu.tables.whole_files import remedy_of

PARTS_KEY = "shukotsu_parts"
"""Key in the file-level metadata of a JSON list with one object per part."""


@dataclass(frozen=True)
class Part:
    """A part of a subject table: one skeleton. Keys without a column in the table are empty.

    made_without : task whose recordings were left out; "" for the skeleton from all recordings.
    """

    hand: str
    model: str = ""
    made_without: str = ""
    subject: str = ""
    session: str = ""

    def __str__(self) -> str:
        session = f", session {self.session}" if self.session else ""
        model = f", model {self.model}" if self.model else ""
        without = f", made without {self.made_without}" if self.made_without else ""
        return f"subject {self.subject}{session}, {self.hand} hand{model}{without}"


class PartsWriter:
    """Writer of a subject table, see `parts_writer`."""

    def __init__(self, table: Table, schema: pa.Schema, writer: pq.ParquetWriter) -> None:
        self._table, self._schema, self._writer = table, schema, writer
        self._parts: dict[Part, dict[str, Any]] = {}
        self._waiting: list[tuple[Part, pa.Table]] = []

    def rows(self, part: Part, rows: Iterable[Mapping[str, Any]], **parameters: Any) -> None:
        """Add rows to a part; a nullable column missing from a row becomes null."""
        self._parts.setdefault(part, {}).update(parameters)
        keys = _named_keys(self._table, part)
        columns = columns_from_rows(self._table, [{**keys, **row} for row in rows])
        self._waiting.append((part, arrow_table(self._table, columns, self._schema)))

    def columns(self, part: Part, columns: Mapping[str, Any], **parameters: Any) -> None:
        """Add columns to a part, all of one recording; keys of the part may be omitted.

        A text value applies to every row. If segments, joints or digits are arrays, they follow one after the
        other with equally many rows. Each becomes a row group, so that a reader of one skips the others.
        """
        self._parts.setdefault(part, {}).update(parameters)
        count = next(len(values) for values in columns.values() if not isinstance(values, str))
        whole = {
            name: repeated(values, count) if isinstance(values, str) else values
            for name, values in {**_named_keys(self._table, part), **columns}.items()
        }
        rows = arrow_table(self._table, whole, self._schema)
        names = rows.column(_name_column(self._table)).chunk(0).dictionary
        self._writer.write_table(rows, row_group_size=max(1, rows.num_rows // max(1, len(names))))

    def failure(self, part: Part, message: str, **parameters: Any) -> None:
        """Record why a part failed; pending rows are dropped, and readers ignore columns already written."""
        self._waiting = [(other, rows) for other, rows in self._waiting if other != part]
        self._parts.setdefault(part, {}).update({**parameters, "failure": message})

    def finish(self) -> None:
        """Write the pending rows as one row group, and the list of parts."""
        if self._waiting:
            rows = pa.concat_tables(rows for _, rows in self._waiting)
            self._writer.write_table(rows.unify_dictionaries())
        listed = [{**vars(part), **parameters} for part, parameters in self._parts.items()]
        text = json.dumps(listed, ensure_ascii=False, sort_keys=True)
        self._writer.add_key_value_metadata({PARTS_KEY: text})


@contextmanager
def parts_writer(path: Path, table: Table, provenance: Provenance) -> Iterator[PartsWriter]:
    """Open a subject table for writing its parts; the file is put in place when it is closed."""
    schema = table.arrow_schema(provenance.metadata())
    with table_writer(path, table, schema) as writer:
        parts = PartsWriter(table, schema, writer)
        yield parts
        parts.finish()


def part_metadata(path: Path, table: Table) -> dict[Part, dict[str, Any]]:
    """Return the parameters of each part of a subject table; a failed part has the reason as `failure`.

    Raises InputError if the file is another table or does not list its parts.
    """
    with open_table(path, table) as file:
        return _parts_of(file.file, path)


def parts_in(path: Path) -> list[Part]:
    """Return the parts of a subject table; an empty list if the file is absent or not a subject table."""
    if not path.is_file():
        return []
    with open_parquet(path, "a subject table") as file:
        return list(_parts_of(file, path)) if PARTS_KEY.encode() in (file.metadata.metadata or {}) else []


def check_subject(path: Path, subject: str, session: str = "") -> None:
    """Raise TableError if a subject table has only other subjects or sessions.

    A file that is absent or not a subject table is accepted here; its reader reports the error.
    """
    subjects = sorted({(part.subject, part.session) for part in parts_in(path)})
    if subjects and (subject, session) not in subjects:
        names = list_names([SubjectSession(*who).label for who in subjects])
        raise TableError(
            f"{path}: has no rows of {SubjectSession(subject, session)}, but of {names}; {remedy_of(path)}"
        )


def one_hand_of(path: Path, table: Table, subject: str | None, session: str | None, hand: str | None) -> Hand:
    """Return the only hand of a subject table, or the one that matches the given subject, session and side.

    Raises InputError unless exactly one hand matches.
    """
    with open_table(path, table) as file:
        hands = {Hand(part.subject, part.hand, part.session) for part in _parts_of(file.file, path)}
    matching = [
        side
        for side in hands
        if subject in (None, side.subject) and session in (None, side.session) and hand in (None, side.hand)
    ]
    if len(matching) != 1:
        names = "; ".join(sorted(map(str, hands))) or "none"
        raise InputError(f"{path}: has hands of {names}; select one with --subject, --session and --hand")
    return matching[0]


class PartsReader:
    """A subject table open for reading, see `open_parts`."""

    def __init__(self, file: TableFile) -> None:
        self._file = file
        self._parts = _parts_of(file.file, file.path)

    def _keys(self, part: Part) -> dict[str, str]:
        """Return the key columns of a part. Raises TableError if it is missing, InputError if it failed."""
        if part not in self._parts:
            raise TableError(f"{self._file.path}: has no rows of {part}; {remedy_of(self._file.path)}")
        if "failure" in self._parts[part]:
            raise InputError(self._parts[part]["failure"])
        return _named_keys(self._file.table, part)

    def rows(self, part: Part) -> list[Any]:
        """Return the rows of a part; the table, which must be short, is read as a whole on first use.

        Raises InputError as `part`.
        """
        return self._rows.get(tuple(self._keys(part).values()), [])

    @cached_property
    def _rows(self) -> dict[tuple[str, ...], list[Any]]:
        """Rows by the keys of their parts."""
        names = [*_named_keys(self._file.table, Part(""))]
        by_part: dict[tuple[str, ...], list[Any]] = {}
        for row in rows_of(self._file.read()):
            by_part.setdefault(tuple(row[name] for name in names), []).append(row)
        return by_part

    def part(self, part: Part, columns: Sequence[str] | None = None) -> pa.Table:
        """Read the rows of a part, or some of their columns.

        Raises InputError if the table lacks the part, or the part failed.
        """
        pieces = [rows for _, rows in self._file.rows_with(self._keys(part), columns)]
        return pa.concat_tables(pieces or [self._file.read(columns, [])])

    def recording(
        self,
        part: Part,
        task: str,
        trial: str,
        columns: Sequence[str],
        n_frames: int | None = None,
        frames: Integers | None = None,
        name: str = "",
    ) -> dict[str, Array]:
        """Read columns of one recording from a frame-by-frame table as arrays.

        Parameters
        ----------
        part : Part
            The skeleton.
        task, trial : str
            The recording.
        columns : sequence of str
            Numerical columns to read.
        n_frames : int, optional
            Number of rows that each name must have.
        frames : array of int, shape (T,), optional
            Ascending frame numbers to read; all rows if omitted.
        name : str
            Name of the only segment, digit or joint to read; all if empty.

        Returns
        -------
        dict
            Name of the segment, digit or joint -> array (T, C), null as NaN, in the order of the file; NaN
            for requested frames without a row.

        Raises
        ------
        InputError
            As `part`; TableError if the number of rows differs from n_frames.

        """
        by = _name_column(self._file.table)
        keys = self._keys(part) | {"task": task, "trial": trial} | ({by: name} if name else {})
        between = {} if frames is None or not len(frames) else {"frame": (int(frames[0]), int(frames[-1]))}
        needed = columns if frames is None else ["frame", *columns]
        pieces: dict[str, list[Array]] = {}
        counts: dict[str, int] = {}
        for value, rows in self._file.rows_with(keys, needed, between, by):
            if not rows.num_rows:
                continue
            numbers = {value: _numbers(rows, needed)} if value else numbers_by_name(rows, by, needed)
            for label, piece in numbers.items():
                if frames is None:
                    pieces.setdefault(label, []).append(piece)
                    counts[label] = counts.get(label, 0) + len(piece)
                    continue
                (aligned,) = pieces.setdefault(label, [np.full((len(frames), len(columns)), np.nan)])
                index = np.searchsorted(frames, piece[:, 0])
                shared = index < len(frames)
                shared[shared] = frames[index[shared]] == piece[shared, 0]
                aligned[index[shared]] = piece[shared, 1:]
                counts[label] = counts.get(label, 0) + int(shared.sum())
        for label, count in counts.items():
            if n_frames is not None and count != n_frames:
                where = ", ".join(filter(None, (task, trial, label)))
                raise TableError(
                    f"{self._file.path}: {where}: has {count_of(count, 'frame')} and the recording "
                    f"{n_frames}; {remedy_of(self._file.path)}"
                )
        return {label: np.concatenate(rows) if rows[1:] else rows[0] for label, rows in pieces.items()}


@contextmanager
def open_parts(path: Path, table: Table) -> Iterator[PartsReader]:
    """Open a subject table to read several of its parts or recordings.

    Raises InputError if the file is another table or does not list its parts.
    """
    with open_table(path, table) as file:
        yield PartsReader(file)


Opened = Callable[[Path, Table], AbstractContextManager[PartsReader]]
"""Function that opens a subject table: `open_parts`, or the one that `opened_once` yields."""


@contextmanager
def opened_once() -> Iterator[Opened]:
    """Yield a function that opens each subject table only once, until the end of the context."""
    with ExitStack() as stack:
        kept = cache(lambda path, table: stack.enter_context(open_parts(path, table)))
        yield lambda path, table: nullcontext(kept(path, table))


def read_part(path: Path, table: Table, part: Part, columns: Sequence[str] | None = None) -> pa.Table:
    """Read the rows of one part, or some of their columns.

    Raises InputError if the file is another table, lacks the part, or the part failed.
    """
    with open_parts(path, table) as parts:
        return parts.part(part, columns)


def numbers_by_name(rows: pa.Table, by: str, columns: Sequence[str]) -> dict[str, Array]:
    """Return for each name in the column `by` the columns of its rows (N, C), in order of appearance."""
    numbers = _numbers(rows, columns)
    names = rows.column(by).combine_chunks().dictionary_encode()
    codes = names.indices.to_numpy()
    return {name: numbers[codes == code] for code, name in enumerate(names.dictionary.to_pylist())}


def _numbers(rows: pa.Table, columns: Sequence[str]) -> Array:
    """Return numerical columns as one array (N, C), null as NaN."""
    return np.stack([np.asarray(rows.column(name).to_numpy(), float) for name in columns], -1)


def _name_column(table: Table) -> str:
    """Return the key column of a frame-by-frame table that names a segment, joint or digit."""
    return next(column for column in ("segment", "joint", "digit") if column in table.key)


def _named_keys(table: Table, part: Part) -> dict[str, str]:
    """Return the keys of a part for which the table has columns."""
    names = {column.name for column in table.columns}
    return {name: value for name, value in vars(part).items() if name in names}


def _parts_of(file: pq.ParquetFile, path: Path) -> dict[Part, dict[str, Any]]:
    """Return the parts listed in the file's metadata, with their parameters."""
    try:
        listed = json.loads(file.metadata.metadata[PARTS_KEY.encode()])
        names = [field.name for field in fields(Part)]
        texts = [entry[name] for entry in listed for name in names]
        texts += [entry.get(name, "") for entry in listed for name in ("failure", "note")]
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("a name or a reason is not text")
        return {Part(*(entry.pop(name) for name in names)): entry for entry in listed}
    except (KeyError, ValueError, AttributeError, TypeError, RecursionError) as error:
        raise TableError(f"{path}: does not list its parts; {remedy_of(path)}") from error
