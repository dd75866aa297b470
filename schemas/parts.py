"""Subject tables: rows of every skeleton of a subject in one file, each skeleton a part of it.

A part is one hand under one model, made without one task's recordings or of all. It has rows, or it failed
and the file says why; the file's metadata lists the parts with the parameters of each.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from schemas.errors import InputError, TableError
from schemas.parquet_files import naming_damage
from schemas.tables import (
    Provenance,
    Table,
    arrow_table,
    columns_from_rows,
    open_table,
    table_writer,
)

PARTS_KEY = "shukotsu_parts"
"""File-level metadata: a JSON list, an object a part."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """One skeleton's share of a subject table; a key that the table lacks is empty.

    made_without : the task whose recordings were left out, empty for the whole skeleton.
    """

    hand: str
    model: str = ""
    made_without: str = ""
    subject: str = ""

    def __str__(self) -> str:
        model = f", model {self.model}" if self.model else ""
        without = f", made without {self.made_without}" if self.made_without else ""
        return f"subject {self.subject}, {self.hand} hand{model}{without}"


class PartsWriter:
    """A subject table while it is written; see `parts_writer`."""

    def __init__(self, table: Table, schema: pa.Schema, writer: pq.ParquetWriter) -> None:
        self._table, self._schema, self._writer = table, schema, writer
        self._parts: dict[Part, dict[str, Any]] = {}
        self._waiting: list[tuple[Part, pa.Table]] = []

    def rows(self, part: Part, rows: Iterable[Mapping[str, Any]], **parameters: Any) -> None:
        """Add a part's rows; a nullable column that a row does not name is null there."""
        self._parts.setdefault(part, {}).update(parameters)
        keys = _named_keys(self._table, part)
        columns = columns_from_rows(self._table, [{**keys, **row} for row in rows])
        self._waiting.append((part, arrow_table(self._table, columns, self._schema)))

    def columns(self, part: Part, columns: Mapping[str, Any], **parameters: Any) -> None:
        """Add columns of a part, all of one recording, as a row group; keys of the part may be left out.

        A value that is a text is that of every row.
        """
        self._parts.setdefault(part, {}).update(parameters)
        count = next(len(values) for values in columns.values() if not isinstance(values, str))
        whole = {
            name: pa.repeat(pa.scalar(values), count) if isinstance(values, str) else values
            for name, values in {**_named_keys(self._table, part), **columns}.items()
        }
        rows = arrow_table(self._table, whole, self._schema)
        self._writer.write_table(rows, row_group_size=max(1, rows.num_rows))

    def failure(self, part: Part, message: str, **parameters: Any) -> None:
        """Record why a part has no rows; those of `rows` are dropped, and nobody reads those of `columns`."""
        self._waiting = [(own, rows) for own, rows in self._waiting if own != part]
        self._parts.setdefault(part, {}).update({**parameters, "failure": message})

    def finish(self) -> None:
        """Write the rows that wait as one row group, and the list of parts."""
        if self._waiting:
            self._writer.write_table(pa.concat_tables(rows for _, rows in self._waiting))
        listed = [{**asdict(part), **parameters} for part, parameters in self._parts.items()]
        text = json.dumps(listed, ensure_ascii=False, sort_keys=True)
        self._writer.add_key_value_metadata({PARTS_KEY: text})


@contextmanager
def parts_writer(path: Path, table: Table, provenance: Provenance) -> Iterator[PartsWriter]:
    """Open a subject table to write its parts in turn; atomic when it closes."""
    schema = table.arrow_schema(provenance.metadata())
    with table_writer(path, table, schema) as writer:
        parts = PartsWriter(table, schema, writer)
        yield parts
        parts.finish()


def part_metadata(path: Path, table: Table) -> dict[Part, dict[str, Any]]:
    """Give the parameters of every part of a subject table, `failure` among them where it failed.

    Raises InputError where the file is not that table or lists no parts.
    """
    with open_table(path, table) as file:
        return _parts_of(file, path)


def one_hand_of(path: Path, table: Table, subject: str | None, hand: str | None) -> tuple[str, str]:
    """Give the one subject and hand that a subject table is of, or those given.

    Raises InputError where the table is of several hands and none is given.
    """
    with open_table(path, table) as file:
        hands = {(part.subject, part.hand) for part in _parts_of(file, path)}
    matching = [own for own in sorted(hands) if subject in (None, own[0]) and hand in (None, own[1])]
    if len(matching) != 1:
        names = "; ".join(f"subject {own[0]}, {own[1]} hand" for own in sorted(hands)) or "none"
        raise InputError(f"{path}: holds hands of {names}; say with --subject and --hand which one to take")
    return matching[0]


def read_part(path: Path, table: Table, part: Part, columns: Sequence[str] | None = None) -> pa.Table:
    """Read one part's rows, or only some of their columns.

    Raises InputError where the file is not that table, lacks the part, or says that the part failed.
    """
    with open_table(path, table) as file:
        _check_part(_parts_of(file, path), part, path)
        keys = _named_keys(table, part)
        return _filtered(path, file, _groups_with(file, keys), keys, columns)


def read_recording(
    path: Path,
    table: Table,
    part: Part,
    task: str,
    trial: str,
    by: str,
    columns: Sequence[str],
    n_frames: int | None = None,
    between: tuple[int, int] | None = None,
) -> dict[str, Array]:
    """Read numbers of one recording from a frame-by-frame table.

    by : the column that names what there are rows of (segment, digit or joint). Gives (T, len(columns)) by
    that name, in the order of the file, null as NaN. between : the first and the last frame to read, all
    unless told. Raises InputError as `read_part`, and where n_frames is given and rows are missing.
    """
    with open_table(path, table) as file:
        _check_part(_parts_of(file, path), part, path)
        keys = _named_keys(table, part) | {"task": task, "trial": trial}
        pieces: dict[str, list[Array]] = {}
        # one group at a time: together they take several times the result
        for group in _groups_with(file, keys, {} if between is None else {"frame": between}):
            rows = _filtered(path, file, [group], keys, [*dict.fromkeys([by, "frame", *columns])])
            if between is not None:
                frame = rows.column("frame").to_numpy()
                rows = rows.filter(pa.array((frame >= between[0]) & (frame <= between[1])))
            for name, numbers in _by_name(rows, by, columns).items():
                pieces.setdefault(name, []).append(numbers)
    found = {name: np.concatenate(pieces.pop(name)) for name in list(pieces)}
    for name, own in found.items():
        if n_frames is not None and len(own) != n_frames:
            raise TableError(
                f"{path}: {task}{trial and ', '}{trial}, {name}: has {len(own)} frames and the recording "
                f"{n_frames}; remove it and run the study again"
            )
    return found


def _by_name(rows: pa.Table, by: str, columns: Sequence[str]) -> dict[str, Array]:
    """Columns (N, C) of the rows of each name, in the order in which names appear."""
    numbers = np.stack([np.asarray(rows.column(name).to_numpy(), float) for name in columns], -1)
    names = rows.column(by).combine_chunks().dictionary_encode()
    codes = names.indices.to_numpy()
    return {name: numbers[codes == code] for code, name in enumerate(names.dictionary.to_pylist())}


def _named_keys(table: Table, part: Part) -> dict[str, str]:
    names = {column.name for column in table.columns}
    return {name: value for name, value in asdict(part).items() if name in names}


def _check_part(parts: Mapping[Part, Mapping[str, Any]], part: Part, path: Path) -> None:
    if part not in parts:
        raise TableError(f"{path}: has no rows of {part}; remove it and run the study again")
    if "failure" in parts[part]:
        raise InputError(parts[part]["failure"])


def _parts_of(file: pq.ParquetFile, path: Path) -> dict[Part, dict[str, Any]]:
    try:
        listed = json.loads(file.metadata.metadata[PARTS_KEY.encode()])
        return {
            Part(*(one.pop(key) for key in ("hand", "model", "made_without", "subject"))): one
            for one in listed
        }
    except (KeyError, ValueError, AttributeError, TypeError) as error:
        raise TableError(
            f"{path}: does not list its parts ({error!r}); remove it and run the study again"
        ) from error


def _filtered(
    path: Path,
    file: pq.ParquetFile,
    groups: Sequence[int],
    keys: Mapping[str, str],
    columns: Sequence[str] | None,
) -> pa.Table:
    """Rows with those keys of those row groups."""
    wanted = None if columns is None else [*dict.fromkeys([*keys, *columns])]
    with naming_damage(path):
        rows = file.read_row_groups(groups, wanted, use_threads=False)
    matches = np.ones(rows.num_rows, bool)
    for name, value in keys.items():
        matches &= pc.equal(rows.column(name), value).to_numpy()
    rows = rows if matches.all() else rows.filter(pa.array(matches))
    return rows if columns is None else rows.select(list(columns))


def _groups_with(
    file: pq.ParquetFile, keys: Mapping[str, str], between: Mapping[str, tuple[int, int]] | None = None
) -> list[int]:
    """Row groups that may hold rows with those keys, and with a number between those two."""
    wanted = {name: (value, value) for name, value in keys.items()} | dict(between or {})
    groups = range(file.num_row_groups)
    return [group for group in groups if _may_hold(file.metadata.row_group(group), wanted)]


def _may_hold(group: pq.RowGroupMetaData, wanted: Mapping[str, tuple[Any, Any]]) -> bool:
    """Whether the least and the largest values of a row group leave room for what is wanted."""
    for index in range(group.num_columns):
        column = group.column(index)
        ends = wanted.get(column.path_in_schema)
        known = column.statistics
        if ends is None or known is None or not known.has_min_max:
            continue
        if known.min > ends[1] or known.max < ends[0]:
            return False
    return True
