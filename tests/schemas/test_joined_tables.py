"""Joined tables: the rows of all parts and no others, whether bytes are copied or rows."""

from __future__ import annotations

import json
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from schemas import joined_tables
from schemas.catalogue import TABLES
from schemas.errors import InputError
from schemas.files import file_sha256
from schemas.joined_tables import join_tables, read_joined
from schemas.tables import (
    METADATA_KEY,
    Column,
    Provenance,
    Table,
    read_metadata,
    read_table,
    write_failure,
    write_table,
)

TYPES = list(dict.fromkeys(column.type for table in TABLES.values() for column in table.columns))
EVERY_TYPE = Table(
    "every_type",
    2,
    "what row it is",
    (
        Column("row", pa.int64(), "", "which row of all"),
        Column("word", pa.string(), "", "a word, seldom a new one"),
        *(Column(f"value_{i}", kind, "mm", f"a value, {kind}", True) for i, kind in enumerate(TYPES)),
    ),
    ("row",),
)
"""Every type of the catalogue, with nulls."""

WORDS = ("", "opposition", "Zeigefinger", "人差し指", "x" * 300)
Shape = list[list[int]]
"""Of every part the rows of its row groups."""

shapes = st.lists(st.lists(st.integers(1, 9), max_size=4), max_size=6)


def columns_of(first: int, n: int, seed: int) -> dict[str, Any]:
    """Columns of n rows, a third of the values null."""
    random = np.random.default_rng((seed, first))
    columns: dict[str, Any] = {
        "row": np.arange(first, first + n),
        "word": [WORDS[i] for i in random.integers(0, len(WORDS), n)],
    }
    for index, kind in enumerate(TYPES):
        there = random.random(n) < 2 / 3
        numbers = random.integers(0, 100, n).tolist()
        values: list[Any] = [number / 7 if pa.types.is_floating(kind) else number for number in numbers]
        if pa.types.is_string(kind):
            values = [WORDS[number % len(WORDS)] for number in numbers]
        elif pa.types.is_boolean(kind):
            values = [number % 2 == 0 for number in numbers]
        elif pa.types.is_fixed_size_list(kind):
            values = [[number + i / 3 for i in range(kind.list_size)] for number in numbers]
        kept = [value if here else None for value, here in zip(values, there, strict=True)]
        columns[f"value_{index}"] = pa.array(kept, kind)
    return columns


def write_parts(folder: Path, shape: Shape, seed: int = 0) -> list[Path]:
    """Write a part for each list of row groups."""
    sizes = [sum(groups) for groups in shape]
    paths = [folder / f"part-{index}.parquet" for index in range(len(shape))]
    for path, groups, end, size in zip(paths, shape, accumulate(sizes), sizes, strict=True):
        made_of = Provenance(((path.name, "0" * 64),))
        columns = columns_of(end - size, size, seed)
        write_table(path, EVERY_TYPE, columns, made_of, row_group_rows=groups)
    return paths


def join(out: Path, parts: list[Path], **settings_: Any) -> dict[Path, str]:
    """Join the parts; give what failed, why."""
    failed: dict[Path, str] = {}
    join_tables(
        out,
        EVERY_TYPE,
        parts,
        lambda digests: Provenance(tuple((path.name, digest) for path, digest in digests.items())),
        lambda path, error: failed.__setitem__(path, str(error)),
        **settings_,
    )
    return failed


def concatenated(parts: list[Path]) -> pa.Table:
    """The rows of the parts as Arrow puts them together."""
    empty = EVERY_TYPE.arrow_schema({}).remove_metadata().empty_table()
    return pa.concat_tables([empty, *(read_table(path, EVERY_TYPE).cast(empty.schema) for path in parts)])


@pytest.mark.parametrize("copied_from", [1, 1 << 14, 1 << 30])
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(shape=shapes, seed=st.integers(0, 99))
def test_all_rows_in_order(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    copied_from: int,
    shape: Shape,
    seed: int,
) -> None:
    monkeypatch.setattr(joined_tables, "COPIED_FROM_BYTES", copied_from)
    folder = tmp_path_factory.mktemp("join")
    parts, out = write_parts(folder, shape, seed), folder / "joined.parquet"
    assert join(out, parts, row_group_rows=11) == {}
    found = read_table(out, EVERY_TYPE)
    found.validate(full=True)
    wanted = concatenated(parts)
    assert found.replace_schema_metadata(None).equals(wanted)
    assert read_joined(EVERY_TYPE, parts, _unexpected).equals(wanted)
    once = out.read_bytes()
    join(out, parts, row_group_rows=11)
    assert out.read_bytes() == once


def _unexpected(path: Path, error: InputError) -> None:
    raise AssertionError(f"{path}: {error}")


@pytest.fixture
def every_part_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    """Copy row groups of any size."""
    monkeypatch.setattr(joined_tables, "COPIED_FROM_BYTES", 1)


@pytest.mark.usefixtures("every_part_copied")
def test_row_groups_are_copied_with_their_statistics(tmp_path: Path) -> None:
    parts = write_parts(tmp_path, [[3, 4], [], [5] * 20])
    out = tmp_path / "joined.parquet"
    join(out, parts)
    joined = pq.ParquetFile(out).metadata
    groups = [group for path in parts for group in _groups(path)]
    assert [group.to_dict()["num_rows"] for group in _groups(out)] == [3, 4] + [5] * 20
    for found, original in zip(_groups(out), groups, strict=True):
        for index in range(found.num_columns):
            own, was = found.column(index).to_dict(), original.column(index).to_dict()
            for place in ("data_page_offset", "dictionary_page_offset", "file_offset"):
                del own[place], was[place]
            assert own == was
    assert joined.num_rows == 107


def _groups(path: Path) -> list[pq.RowGroupMetaData]:
    metadata = pq.ParquetFile(path).metadata
    return [metadata.row_group(index) for index in range(metadata.num_row_groups)]


@pytest.mark.usefixtures("every_part_copied")
def test_what_is_copied_says_what_it_was_made_from(tmp_path: Path) -> None:
    parts, out = write_parts(tmp_path, [[3], [4]]), tmp_path / "joined.parquet"
    join(out, parts)
    found = read_metadata(out)
    assert found["inputs"] == [{"file": path.name, "sha256": file_sha256(path)} for path in parts]
    whole = tmp_path / "whole.parquet"
    inputs = Provenance(tuple((path.name, file_sha256(path)) for path in parts))
    write_table(whole, EVERY_TYPE, columns_of(0, 7, 0), inputs)
    assert pq.read_schema(out).equals(pq.read_schema(whole), check_metadata=True)


def test_long_files_and_long_footers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages go over several blocks, and a footer is longer than what is read of a file's end at first."""
    monkeypatch.setattr(joined_tables, "_TAIL", 100)
    monkeypatch.setattr(joined_tables, "_BLOCK", 1000)
    monkeypatch.setattr(joined_tables, "COPIED_FROM_BYTES", 1)
    parts = write_parts(tmp_path, [[2000], [3000], [1]])
    out = tmp_path / "joined.parquet"
    join(out, parts)
    assert [group.num_rows for group in _groups(out)] == [2000, 3000, 1]
    assert read_table(out, EVERY_TYPE).replace_schema_metadata(None).equals(concatenated(parts))


def test_small_parts_become_one_row_group_as_if_written_at_once(tmp_path: Path) -> None:
    parts, out = write_parts(tmp_path, [[5], [6]]), tmp_path / "joined.parquet"
    join(out, parts)
    whole = tmp_path / "whole.parquet"
    inputs = Provenance(tuple((path.name, file_sha256(path)) for path in parts))
    write_table(whole, EVERY_TYPE, pa_columns(concatenated(parts)), inputs)
    assert [group.num_rows for group in _groups(out)] == [11]
    assert read_table(out, EVERY_TYPE).equals(read_table(whole, EVERY_TYPE))


def pa_columns(table: pa.Table) -> dict[str, pa.ChunkedArray]:
    """A table's columns by name."""
    return {name: table.column(name) for name in table.column_names}


@pytest.mark.parametrize("copied_from", [1, 1 << 30])
def test_parts_that_failed_are_told_and_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, copied_from: int
) -> None:
    monkeypatch.setattr(joined_tables, "COPIED_FROM_BYTES", copied_from)
    good, failed, absent, older, cut, other = (tmp_path / f"{i}.parquet" for i in range(6))
    write_table(good, EVERY_TYPE, columns_of(0, 4, 0), Provenance())
    write_failure(failed, EVERY_TYPE, "no frame was valid", Provenance())
    version_1 = Table(EVERY_TYPE.name, 1, EVERY_TYPE.row, EVERY_TYPE.columns, EVERY_TYPE.key)
    write_table(older, version_1, columns_of(0, 4, 0), Provenance())
    cut.write_bytes(good.read_bytes()[:-20])
    renamed = Table("another", 2, EVERY_TYPE.row, EVERY_TYPE.columns, EVERY_TYPE.key)
    write_table(other, renamed, columns_of(0, 4, 0), Provenance())
    parts = [failed, absent, good, older, cut, other]
    out = tmp_path / "joined.parquet"
    told = join(out, parts)
    assert list(told) == [failed, absent, older, cut, other]
    for path, message in told.items():
        with pytest.raises(InputError) as error:
            read_table(path, EVERY_TYPE)
        assert message == str(error.value)
    assert read_table(out, EVERY_TYPE).num_rows == 4
    there = [path.name for path in parts if path != absent]
    assert [each["file"] for each in read_metadata(out)["inputs"]] == there


@pytest.mark.usefixtures("every_part_copied")
def test_pages_of_another_writer_are_decoded(tmp_path: Path) -> None:
    """Indexes of pages hold places in the file, which a copy would have to move."""
    mine, indexed, plain = (tmp_path / f"{i}.parquet" for i in range(3))
    write_table(mine, EVERY_TYPE, columns_of(0, 4, 0), Provenance())
    same = pq.read_table(mine)
    pq.write_table(same, indexed, write_page_index=True)
    nullable = pa.schema([field.with_nullable(True) for field in same.schema], same.schema.metadata)
    pq.write_table(same.cast(nullable), plain)
    out = tmp_path / "joined.parquet"
    assert join(out, [mine, indexed, plain, mine]) == {}
    assert [group.num_rows for group in _groups(out)] == [4, 8, 4]
    assert read_table(out, EVERY_TYPE).slice(4, 4).equals(read_table(mine, EVERY_TYPE))


@pytest.mark.usefixtures("every_part_copied")
def test_pandas_reads_it(tmp_path: Path) -> None:
    parts, out = write_parts(tmp_path, [[3, 2], [4]]), tmp_path / "joined.parquet"
    join(out, parts)
    found = pd.read_parquet(out)
    assert found["row"].tolist() == list(range(9))
    assert found["word"].tolist() == concatenated(parts)["word"].to_pylist()


def test_nothing_to_join_is_a_table_without_rows(tmp_path: Path) -> None:
    out = tmp_path / "joined.parquet"
    join(out, [])
    assert read_table(out, EVERY_TYPE).num_rows == 0
    assert read_joined(EVERY_TYPE, [], _unexpected).num_rows == 0


@pytest.mark.usefixtures("every_part_copied")
def test_what_was_there_stays_where_joining_ends_early(tmp_path: Path) -> None:
    parts, out = write_parts(tmp_path, [[3]]), tmp_path / "joined.parquet"
    out.write_bytes(b"before")

    def stop(_: dict[Path, str]) -> Provenance:
        raise InputError("stop")

    with pytest.raises(InputError, match="stop"):
        join_tables(out, EVERY_TYPE, parts, stop, _unexpected)
    assert out.read_bytes() == b"before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["joined.parquet", "part-0.parquet"]


@pytest.mark.usefixtures("every_part_copied")
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(place=st.floats(0, 1, exclude_max=True), byte=st.integers(0, 255))
def test_a_damaged_footer_is_told_or_read_but_never_a_crash(tmp_path: Path, place: float, byte: int) -> None:
    (part,), out = write_parts(tmp_path, [[2, 3]]), tmp_path / "joined.parquet"
    content = bytearray(part.read_bytes())
    length = int.from_bytes(content[-8:-4], "little")
    metadata_at = content.find(METADATA_KEY)
    begin = len(content) - 8 - length
    at = begin + int(place * (metadata_at - begin))
    assume(content[at] != byte)
    content[at] = byte
    part.write_bytes(bytes(content))
    told = join(out, [part])
    assert told == {} or list(told) == [part]
    assert json.loads(pq.read_schema(out).metadata[METADATA_KEY])["schema"] == EVERY_TYPE.name
