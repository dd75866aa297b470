"""Numbers that a page carries: exact to the last bit, and named where they are too many."""

from __future__ import annotations

import base64
import csv
import io
import zlib
from typing import Any

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_samples.many_subjects import many_subjects

from shukotsu.schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES, TIP_ERRORS
from shukotsu.schemas.study import read_study
from shukotsu.schemas.tables import Table, read_table
from shukotsu.stages.report.downloads import Download, csv_of, downloads
from shukotsu.stages.report.study_results import StudyResults, read_results

CELLS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**60), 2**60),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """Seven simulated subjects under two models."""
    study, folder = many_subjects(tmp_path_factory.mktemp("seven"), 7, ("paper-fig4", "whole-hand"))
    return read_results(read_study(study), folder)


def unpacked(file: Download) -> str:
    return zlib.decompress(base64.b64decode(file.data)).decode()


def rows_of_csv(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline="")))


def parsed(cell: str, kind: pa.DataType) -> Any:
    """What a cell says, in the column's type; an empty number or truth value is null."""
    if pa.types.is_string(kind):
        return cell
    if cell == "":
        return None
    if pa.types.is_boolean(kind):
        return {"true": True, "false": False}[cell]
    return int(cell) if pa.types.is_integer(kind) else float(cell)


def check_against_parquet(text: str, results: StudyResults, table: Table) -> None:
    """Every cell of every row, numbers by equality."""
    whole = read_table(results.paths.study_table(table.name), table).to_pylist()
    found = rows_of_csv(text)
    assert len(found) == len(whole) > 0
    columns = [column for column in table.columns if column.name != "message_values"]
    assert list(found[0]) == [column.name for column in columns]
    numbers = 0
    for row, wanted in zip(found, whole, strict=True):
        for column in columns:
            assert parsed(row[column.name], column.type) == wanted[column.name]
            numbers += isinstance(wanted[column.name], float)
    assert numbers > 100


@given(st.lists(st.tuples(CELLS, CELLS), max_size=20))
def test_cells_come_back(rows: list[tuple[Any, Any]]) -> None:
    """Numbers to the last bit, text with its commas, quotes and line breaks, formulas as text."""
    text = csv_of([{"a": one, "b": other} for one, other in rows], ["a", "b"])
    header, *found = csv.reader(io.StringIO(text, newline=""))
    assert header == ["a", "b"]
    assert len(found) == len(rows)
    for cells, values in zip(found, rows, strict=True):
        for cell, value in zip(cells, values, strict=True):
            if isinstance(value, bool):
                assert cell == str(value).lower()
            elif isinstance(value, int | float):
                assert type(value)(cell) == value
                assert cell[0] != "'"
            else:
                assert cell in (value or "", f"'{value}")
                assert cell[:1] not in tuple("=+-@\t\r") or parsed(cell, pa.float64()) is not None


@pytest.mark.parametrize(
    ("said", "cell"), [("=1+1", "'=1+1"), ("-1.5", "-1.5"), ("-1+2", "'-1+2"), ("@a", "'@a"), ("S-1", "S-1")]
)
def test_formulas_are_text(said: str, cell: str) -> None:
    """A name may look like one; a number of either sign stays."""
    assert csv_of([{"subject": said}], ["subject"]) == f"subject\r\n{cell}\r\n"


@pytest.mark.parametrize("table", [SKELETON_SCORES, JOINT_ERRORS, TIP_ERRORS], ids=lambda table: table.name)
def test_files_are_the_tables(results: StudyResults, table: Table) -> None:
    """All rows, all columns, every number as it is in the Parquet file."""
    files = {file.name: file for file in downloads(results).files}
    file = files[f"{table.name}.csv"]
    check_against_parquet(unpacked(file), results, table)
    assert file.n_rows == len(rows_of_csv(unpacked(file)))
