"""Typed tables: round trips, metadata and refusals."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shukotsu.errors import InputError
from shukotsu.tables.catalogue import POSES, TABLES
from shukotsu.tables.typed_table import (
    METADATA_KEY,
    Column,
    Provenance,
    Table,
    column_array,
    columns_from_rows,
    open_table,
    read_metadata,
    read_table,
    rows_of,
    write_failure,
    write_table,
    write_table_in_parts,
)

SMALL = Table(
    "small",
    3,
    "one thing",
    (
        Column("name", pa.string(), "", "its name"),
        Column("count", pa.int64(), "", "how many"),
        Column("length_mm", pa.float64(), "mm", "how long", nullable=True),
    ),
    ("name",),
)
COLUMNS = {"name": ["a", "b"], "count": [1, 2], "length_mm": [0.5, None]}


def values_of(column: Column) -> st.SearchStrategy[Any]:
    numbers = st.floats(allow_nan=False, width=32 if column.type == pa.float32() else 64)
    if pa.types.is_fixed_size_list(column.type):
        size = column.type.list_size
        values: st.SearchStrategy[Any] = st.lists(numbers, min_size=size, max_size=size)
    elif pa.types.is_floating(column.type):
        values = numbers
    elif pa.types.is_integer(column.type):
        limits = np.iinfo(column.type.to_pandas_dtype())
        values = st.integers(int(limits.min), int(limits.max))
    elif pa.types.is_boolean(column.type):
        values = st.booleans()
    else:
        values = st.text()
    return st.none() | values if column.nullable else values


@settings(max_examples=40)
@given(table=st.sampled_from([*TABLES.values()]), data=st.data())
def test_every_table_survives_a_round_trip(
    tmp_path_factory: pytest.TempPathFactory, table: Table, data: st.DataObject
) -> None:
    columns = table.columns
    row = st.fixed_dictionaries({column.name: values_of(column) for column in columns})
    rows = data.draw(st.lists(row, max_size=4))
    path = tmp_path_factory.mktemp("tables") / "table.parquet"
    write_table(path, table, columns_from_rows(table, rows), Provenance())
    assert list(rows_of(read_table(path, table))) == rows


def test_units_are_in_names_and_metadata() -> None:
    """A column whose name ends in a unit declares that unit, and the file's metadata contains it."""
    units = {"_mm_s": "mm/s", "_deg_s": "deg/s", "_mm": "mm", "_s": "s", "_ms": "ms", "_deg": "deg"}
    units |= {"_percent": "%", "_mm2": "mm^2", "_ppm": "ppm"}  # the longer ending first
    for table in TABLES.values():
        schema = table.arrow_schema({})
        metadata = json.loads(schema.metadata[METADATA_KEY])
        for column in table.columns:
            ending = next((e for e in units if column.name.endswith(e)), None)
            assert column.unit == (units[ending] if ending else ""), column.name
            entry = {"unit": column.unit, "description": column.description}
            assert column.description
            assert metadata["columns"][column.name] == entry
            assert schema.field(column.name).metadata == {k.encode(): v.encode() for k, v in entry.items()}


def test_nan_becomes_null_from_every_kind_of_array(tmp_path: Path) -> None:
    floats = [0.5, float("nan")]
    for values in (floats, np.array(floats), pa.array(floats), pa.chunked_array([[0.5], [float("nan")]])):
        write_table(tmp_path / "t.parquet", SMALL, COLUMNS | {"length_mm": values}, Provenance())
        read = read_table(tmp_path / "t.parquet", SMALL)
        assert read["length_mm"].to_pylist() == [0.5, None]
        np.testing.assert_array_equal(column_array(read, "length_mm"), floats)
    pairs = Table("pairs", 1, "", (Column("pair", pa.list_(pa.float64(), 2), "", "two", True),), ())
    lists = np.array([[1, float("nan")], [float("nan"), 2]])
    for values in (lists, list(lists)):
        write_table(tmp_path / "t.parquet", pairs, {"pair": values}, Provenance())
        assert read_table(tmp_path / "t.parquet", pairs)["pair"].to_pylist() == [[1, None], [None, 2]]


def test_the_same_columns_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_table(tmp_path / f"{name}.parquet", SMALL, COLUMNS, Provenance(parameters={"b": 1, "a": 2}))
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "two.parquet").read_bytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": [1, None]}, "small: column count may not be null"),
        ({"count": np.array([1.0, np.nan])}, "small: column count may not be null"),
        ({"more": [1, 2]}, "small: columns missing or left over: more"),
    ],
)
def test_columns_that_violate_the_schema_are_not_written(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        write_table(tmp_path / "t.parquet", SMALL, COLUMNS | changes, Provenance())
    with pytest.raises(ValueError, match="a row lacks count, name"):
        columns_from_rows(SMALL, [{"length_mm": 1.0}])
    assert list(tmp_path.iterdir()) == []


def test_a_table_in_parts_has_a_row_group_per_part(tmp_path: Path) -> None:
    """Without any part the table has no rows; if a part fails, no table is written."""
    parts = [{"name": [name], "count": [n], "length_mm": [None]} for n, name in enumerate("abc")]
    path = tmp_path / "t.parquet"
    write_table_in_parts(path, SMALL, iter(parts), Provenance())
    assert pq.ParquetFile(path).num_row_groups == 3
    assert read_table(path, SMALL)["count"].to_pylist() == [0, 1, 2]
    write_table_in_parts(path, SMALL, [], Provenance())
    assert read_table(path, SMALL).num_rows == 0
    path.unlink()
    with pytest.raises(ValueError, match="columns missing or left over: count"):
        write_table_in_parts(path, SMALL, [*parts, {"name": [], "length_mm": []}], Provenance())
    assert list(tmp_path.iterdir()) == []


def rewrite(path: Path, table: pa.Table, **metadata: Any) -> None:
    content = json.loads(table.schema.metadata[METADATA_KEY]) | metadata
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(content)}), path)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p, _: p.unlink(), "no such file; expected a small table"),
        (lambda p, _: p.write_bytes(p.read_bytes()[:100]), "not a readable Parquet file"),
        (lambda p, _: p.write_text("name,count"), "not a readable Parquet file"),
        (lambda p, _: (p.unlink(), p.mkdir()), "is a folder; expected a small table"),
        (lambda p, t: pq.write_table(t.replace_schema_metadata(None), p), "but not one that shukotsu wrote"),
        (lambda p, t: rewrite(p, t, schema="tips"), "is a tips table; expected small"),
        (lambda p, t: rewrite(p, t, schema_version=2), "small version 2; this program reads version 3"),
        (lambda p, t: rewrite(p, t.drop_columns(["count"])), "column count is missing; expected int64"),
        (
            lambda p, t: rewrite(p, t.set_column(1, "count", pa.array(["1", "2"]))),
            "column count is string; expected int64",
        ),
    ],
    ids=["absent", "cut", "text", "folder", "foreign", "other", "version", "column", "type"],
)
def test_a_table_that_is_not_the_expected_one_is_refused(tmp_path: Path, spoil: Any, message: str) -> None:
    path = tmp_path / "t.parquet"
    write_table(path, SMALL, COLUMNS, Provenance())
    spoil(path, read_table(path, SMALL))
    with pytest.raises(InputError, match=message) as caught, open_table(path, SMALL):
        pass
    assert str(caught.value).startswith(str(path))


def test_reading_a_recorded_failure_raises_its_message(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    write_failure(path, POSES, "rom.csv: line 3: the reason", Provenance(parameters={"subject": "01"}))
    with pytest.raises(InputError, match=r"^rom\.csv: line 3: the reason$"):
        read_table(path, POSES)
    assert read_metadata(path)["parameters"] == {"subject": "01"}
