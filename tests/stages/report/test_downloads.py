"""Numbers that a page carries: exact to the last bit, and named where they are too many."""

from __future__ import annotations

import base64
import csv
import io
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from browser import WatchedPage, watched
from hypothesis import given
from hypothesis import strategies as st
from report_samples.many_subjects import many_subjects
from report_samples.small_page import small_page

from schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES, TIP_ERRORS
from schemas.study import read_study
from schemas.tables import Table, read_table
from stages.report.comparison.answers import observations
from stages.report.comparison.comparisons import Comparison, compare
from stages.report.comparison.questions import JOINT_ERROR
from stages.report.downloads import Download, Downloads, comparison_row, csv_of, downloads, packed
from stages.report.study_results import StudyResults, read_results

BODY = """{% from "downloads.html.j2" import downloads_of %}{{ downloads_of(offered) }}"""

COMPARISON_COLUMNS = """metric table unit held_out digit model other n_subjects n_compared_subjects
mean_difference median_difference lowest_difference highest_difference interval_95_low interval_95_high
p p_holm n_comparisons effect_size n_better n_equal"""

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
    assert list(found[0]) == [column.name for column in table.columns]
    numbers = 0
    for row, wanted in zip(found, whole, strict=True):
        for column in table.columns:
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
    files = {file.name: file for file in downloads(results, ()).files}
    file = files[f"{table.name}.csv"]
    check_against_parquet(unpacked(file), results, table)
    assert file.n_rows == len(rows_of_csv(unpacked(file)))


def test_joint_centres_are_a_file(fitted: StudyResults) -> None:
    """Every hand and model, each number as it is in the table; a covariance is left to that."""
    (file,) = [file for file in downloads(fitted, ()).files if file.name == "joint_centres.csv"]
    found = rows_of_csv(unpacked(file))
    assert len(found) == len(fitted.joints) == file.n_rows > 50
    assert "covariance_mm2" not in found[0]
    for row, wanted in zip(found, fitted.joints, strict=True):
        assert (row["joint"], row["model"]) == (wanted["joint"], wanted["model"])
        for name in ("parent_x_mm", "child_z_mm", "sd_mm"):
            assert parsed(row[name], pa.float64()) == wanted[name]


def _compared(results: StudyResults) -> tuple[Comparison, ...]:
    earlier, later = list(results.models)[:2]
    seen = observations(results, JOINT_ERROR, results.models, held_out=True)
    return compare(seen, JOINT_ERROR, [(later, earlier)], subjects=results.subjects)


def test_comparisons_are_a_file(results: StudyResults) -> None:
    """Each with its numbers in full; those of which there are none are empty."""
    made = _compared(results)
    (file,) = [file for file in downloads(results, made).files if file.name == "comparisons.csv"]
    found = rows_of_csv(unpacked(file))
    assert len(found) == len(made) == 6
    for row, each in zip(found, made, strict=True):
        assert list(row) == COMPARISON_COLUMNS.split()
        assert each.statistics is not None
        assert each.statistics.interval is not None
        assert (row["model"], row["other"], row["digit"]) == (each.model, each.other, each.digit)
        assert float(row["mean_difference"]) == each.statistics.mean
        assert (float(row["interval_95_low"]), float(row["interval_95_high"])) == each.statistics.interval
        assert (float(row["p"]), float(row["p_holm"])) == (each.statistics.p, each.p_holm)
        assert float(row["effect_size"]) == each.statistics.effect
        assert (row["n_subjects"], row["n_compared_subjects"], row["n_comparisons"]) == ("7", "7", "6")
    nothing = comparison_row(replace(made[0], statistics=None, p_holm=None, subjects=()))
    assert nothing["mean_difference"] is nothing["interval_95_low"] is nothing["p"] is None
    assert (nothing["n_subjects"], nothing["model"]) == (0, made[0].model)


def test_what_is_too_large_stays_where_it_is(results: StudyResults, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table that does not fit is named, and smaller ones after it are taken."""
    scores, *others = downloads(results, ()).files
    rng = np.random.default_rng(1)
    many = [{**row, "message": rng.bytes(800).hex()} for row in results.scores]
    limit = sum(len(file.data) for file in others) + len(scores.data)
    monkeypatch.setattr("stages.report.downloads.MOST_BYTES", limit)
    assert len(downloads(results, ()).not_packed) == 0
    offered = downloads(replace(results, scores=many), ())
    assert offered.not_packed == (("skeleton_scores.parquet", len(many)),)
    assert [file.name for file in offered.files] == ["joint_errors.csv", "tip_errors.csv"]
    page = small_page(BODY, offered=offered)
    assert f"skeleton_scores.parquet ({len(many)} rows)" in page


@pytest.mark.slow
def test_without_scripting(browser: Any, results: StudyResults, tmp_path: Path) -> None:
    """No button that does nothing, but where the tables lie."""
    page = tmp_path / "page.html"
    page.write_text(small_page(BODY, offered=downloads(results, ())), "utf-8")
    with watched(browser, java_script_enabled=False) as still:
        still.open(page)
        assert not still.page.locator("button").first.is_visible()
        assert "as Parquet files" in still.page.locator("main").inner_text()


@pytest.mark.slow
def test_saved_by_a_browser(watched_page: WatchedPage, results: StudyResults, tmp_path: Path) -> None:
    """The file that a reader gets is the table, to the last bit; a mark is before more than ASCII alone."""
    scores = next(f for f in downloads(results, ()).files if f.name == "skeleton_scores.csv")
    named = [packed(f"{name}.csv", [{"a": name}], ["a"]) for name in ("é", "e")]
    offered = Downloads((scores, *filter(None, named)), ())
    page = tmp_path / "page.html"
    page.write_text(small_page(BODY, offered=offered), "utf-8")
    watched_page.open(page)
    for file in offered.files:
        button = watched_page.page.get_by_role("button", name=f"Download {file.name} ({file.n_rows} rows)")
        with watched_page.page.expect_download() as told:
            button.click()
        assert told.value.suggested_filename == file.name
        told.value.save_as(tmp_path / file.name)
    check_against_parquet((tmp_path / scores.name).read_bytes().decode("ascii"), results, SKELETON_SCORES)
    assert (tmp_path / "é.csv").read_bytes().decode() == "\ufeffa\r\né\r\n"
    assert (tmp_path / "e.csv").read_bytes() == b"a\r\ne\r\n"
