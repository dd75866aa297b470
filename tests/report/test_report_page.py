"""The report's pages: self-contained, escaped, complete, with the tables' numbers; and the command."""

import os
import re
from itertools import product
from pathlib import Path
from urllib.parse import unquote

import pytest
from report_samples.made_study import HOSTILE, NO_SOURCE, PAPERS, MadeStudy, make_study, write
from report_samples.pages import read_page, rows_where, table_called
from stage_runs import report

from shukotsu.report.score_tables import printed_table, study_table
from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import StudyResults
from shukotsu.report.subject_page import render_subject
from shukotsu.study.layout import FINGER_MM
from shukotsu.study.model import read_model
from shukotsu.study.results import STUDY_FIGURES, STUDY_TABLES
from shukotsu.study.verdict import UNJUDGED, judged_joint
from shukotsu.tables.catalogue import JOINT_CENTRES, TABLES, TIP_ERRORS
from shukotsu.tables.subjects import path_token
from shukotsu.tables.typed_table import write_failure


def _links(page: str) -> set[str]:
    return {str(attrs["href"]) for tag, attrs in read_page(page).tags if tag == "a" and "href" in attrs}


def _target(page: Path, link: str) -> Path:
    return Path(os.path.normpath(page.parent / unquote(link.partition("#")[0])))


def test_pages_load_nothing_from_outside(pages: dict[Path, str]) -> None:
    """Scripts, styles and pictures are inside the page, and its content security policy forbids all
    others.
    """
    for page in pages.values():
        reader = read_page(page)
        (policy,) = [attrs["content"] for _, attrs in reader.tags if "http-equiv" in attrs]
        assert str(policy).startswith("default-src 'none'; script-src 'unsafe-inline'; ")
        assert not re.search(r"https?:|\*|-eval", str(policy))
        assert not {"iframe", "object", "embed"} & {tag for tag, _ in reader.tags}
        targets = [
            attrs[name]
            for tag, attrs in reader.tags
            for name in ("src", "href")
            if name in attrs and tag != "a"
        ]
        assert all(target == "data:," or str(target).startswith("#") for target in targets)
        assert not re.search(r"url\((?!#)", page)
        assert "@import" not in page


def test_every_link_leads_to_a_file_or_anchor(pages: dict[Path, str], results: StudyResults) -> None:
    """The study's page links to every page, and every other page back to it."""
    shown = {results.paths.recording_page(recording) for recording in results.shown}
    for path, page in pages.items():
        tags = read_page(page).tags
        ids = [attrs["id"] for _, attrs in tags if "id" in attrs]
        assert len(ids) == len(set(ids))
        links = _links(page)
        assert {link for link in links if link.startswith("#")} <= {f"#{name}" for name in ids}
        others = {_target(path, link) for link in links if not link.startswith("#")}
        figures = {results.paths.report.parent / "figures" / f"{name}.{kind}" for name in STUDY_FIGURES
                   for kind in ("svg", "pdf", "txt")}  # fmt: skip
        tables = {results.paths.study_table(name) for name in TABLES} | {results.paths.resolved}
        tables |= {target for target in others if target.suffix == ".parquet" and target.is_file()}
        assert others <= {*pages, *shown, *figures, *tables} - {path}
        study = results.paths.report
        assert ({*pages, *shown} - {study} if path == study else {study}) <= others


@pytest.mark.slow
def test_hostile_names_are_escaped(tmp_path: Path) -> None:
    name = "<script>alert(1)</script> 手 ' \" </svg><img src=x onerror=y>"
    studies = (
        make_study(tmp_path / folder, models=("rigid",), n_frames=4, subjects=(subject,))
        for folder, subject in (("plain", "A"), ("hostile", name))
    )
    expected, page = (read_page("".join(study.pages.values())) for study in studies)
    assert [tag for tag, _ in page.tags] == [tag for tag, _ in expected.tags]
    assert f"Subject {name}" in page.text


def test_tables_have_captions_and_headers_and_pictures_have_titles(page: str) -> None:
    for table in read_page(page).tables:
        assert table.caption
        headers = [cell for row in table.attributes for cell in row if cell["tag"] == "th"]
        assert headers
        assert all(cell["scope"] in ("row", "col", "colgroup") for cell in headers)
    pictures = re.findall(r'<svg viewBox="[^"]*" role="img">(<title>[^<]{20,})?', page)
    assert pictures
    assert all(pictures)


def test_tables_in_cm_equal_the_parquet_table(results: StudyResults, page: str) -> None:
    """Every cell of the study's Tables 1 to 4 is the first-frame value, rounded to two decimals."""
    tables, starts = read_page(page).tables, {"right": 0, "left": 5}
    for subject, model in product(results.subjects, PAPERS):
        ending = f"subject {subject}, opposition, model {model}."
        (table,) = [table for table in tables if table.caption.endswith(ending)]
        rows = rows_where(results.rows.tip_errors, subject=subject, model=model, binding="first-frame")
        assert rows
        for row in rows:
            start = starts[row["hand"]]
            column = table.rows[start].index(row["digit"].capitalize())
            for offset, name in enumerate(("max_mm", "min_mm", "mean_mm", "sd_mm"), 1):
                printed = table.rows[start + offset][column]
                assert printed == ("–" if row[name] is None else f"{row[name] / 10:.2f}")


def test_least_squares_table_equals_the_parquet_table(results: StudyResults, page: str) -> None:
    caption = (
        "Tip error, least-squares binding, mean and 95th percentile (p95) [mm]: subject S01, opposition."
    )
    table = table_called(page, caption)
    left = next(i for i, row in enumerate(table.rows) if row[0] == "Left hand")
    for row in rows_where(results.rows.tip_errors, subject="S01", hand="right", binding="least-squares"):
        column = table.rows[0].index(f"{row['digit'].capitalize()} mean")
        cells = next(cells for cells in table.rows[1:left] if cells[0] == row["model"])
        assert cells[column : column + 2] == [f"{row['mean_mm']:.2f}", f"{row['p95_mm']:.2f}"]


def test_every_problem_is_on_the_page(page: str) -> None:
    text = " ".join(read_page(page).text)
    assert "3 of 4 recordings used (1 failed)" in text
    assert "row 7, column x_mm" in text
    assert "Right hand, ring: joint ring_dip failed." in text


def test_a_study_without_a_usable_recording_has_a_page_with_reasons(tmp_path: Path) -> None:
    """The page names every recording and the reason why it was not used."""
    study = make_study(tmp_path, models=PAPERS[:1], n_frames=4)
    for name in STUDY_TABLES:
        write(study.paths.study_table(name), TABLES[name], [])
    write_failure(study.paths.study_table("tip_errors"), TIP_ERRORS, "no hand was left", NO_SOURCE)
    for path in study.folder.rglob("poses.parquet"):
        path.unlink()
    text = " ".join(read_page(render_study(study.results, study.study)).text)
    assert "0 of 4 recordings used (4 missing)" in text
    assert "no hand was left" in text
    assert "missing: the results do not name this recording" in text
    assert all(f"{name}-right.csv" in text for name in ("S01", path_token(HOSTILE)))


@pytest.mark.slow
def test_a_study_whose_joints_all_failed_has_a_page(fitted_study: MadeStudy) -> None:
    gone = {**UNJUDGED, **dict.fromkeys(c.name for c in JOINT_CENTRES.columns if c.nullable)}
    gone |= {"status": "failed", "message": "no frames"}
    failed = [judged_joint(row | gone, FINGER_MM) for row in fitted_study.results.rows.joint_centres]
    pages = (
        render_study(fitted_study.results.with_rows(joint_centres=failed), fitted_study.study),
        render_subject(fitted_study.subject().with_rows(joint_centres=failed)),
    )
    n, n_others = (len(rows_where(failed, model=model)) for model in ("whole-hand", "paper-fig4"))
    text = " ".join(read_page("".join(pages)).text)
    assert f"0 of {n} joints can be believed" in text
    assert f"paper-fig4: ✕ no {n_others // 2}" in text


@pytest.mark.parametrize(
    ("table", "block", "row", "cells"),
    [
        (1, 0, 0, ("Max [cm]", "1.94", "16.74", "16.98", "15.66", "13.93")),
        (2, 1, 2, ("Average [cm]", "0.99", "0.72", "0.74", "0.74", "8.28")),
        (3, 0, 3, ("Standard Deviation [cm]", "0.10", "0.07", "0.10", "0.06", "0.05")),
        (4, 1, 0, ("Max [cm]", "0.37", "1.00", "1.06", "2.25", "3.12")),
    ],
)
def test_printed_tables_equal_the_papers(table: int, block: int, row: int, cells: tuple[str, ...]) -> None:
    assert printed_table(table).blocks[block].rows[row] == cells


def test_the_studys_tables_have_the_printed_tables_layout(results: StudyResults) -> None:
    trial = next(results.trials("S01"))
    table = study_table(results, trial, read_model("paper-fig3"))
    for mine, printed in zip(table.blocks, printed_table(2).blocks, strict=True):
        assert mine.header == printed.header
        assert [row[0] for row in mine.rows] == [row[0] for row in printed.rows]


@pytest.mark.slow
def test_the_command_writes_one_page_or_the_reason(
    study: MadeStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without results it exits with 2 and a sentence, or with --record-failure writes a page with the
    reason.
    """
    out = tmp_path / "deep" / "report.html"
    words = ("--study", str(study.file), "--out", str(out), "--results")
    assert report([*words, str(tmp_path)]) == 2
    assert "recordings.parquet: no such file" in capsys.readouterr().err
    assert report([*words, str(tmp_path), "--record-failure"]) == 0
    assert "recordings.parquet: no such file" in out.read_text("utf-8")
    assert report([*words, str(study.folder)]) == 0
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")
    assert list(out.parent.rglob("*")) == [out]
    assert str(study.folder.parent) not in out.read_text("utf-8"), "pages do not contain the folder's path"
