"""The paper's tables, the finding and the command line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from report_samples.read_page import rows_where

from shukotsu.schemas.findings import NOTE, problem_row, worded
from shukotsu.schemas.model import read_model
from shukotsu.stages import command_line
from shukotsu.stages.report.__main__ import build_parser, record_failure, report
from shukotsu.stages.report.headline import headline, mean_tip_errors
from shukotsu.stages.report.paper_tables import own_table, printed_table
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.terminal import WIDTH, terminal_tables


def _run(*words: str) -> int:
    return command_line.run(build_parser, words, report, record_failure)


@pytest.mark.parametrize(
    ("table", "block", "row", "cells"),
    [
        (1, 0, 0, ("Max [cm]", "1.94", "16.74", "16.98", "15.66", "13.93")),
        (2, 1, 2, ("Average [cm]", "0.99", "0.72", "0.74", "0.74", "8.28")),
        (3, 0, 3, ("Standard Deviation [cm]", "0.10", "0.07", "0.10", "0.06", "0.05")),
        (4, 1, 0, ("Max [cm]", "0.37", "1.00", "1.06", "2.25", "3.12")),
    ],
)
def test_printed_tables_are_the_papers(table: int, block: int, row: int, cells: tuple[str, ...]) -> None:
    """A row of each of the paper's four tables."""
    assert printed_table(table).blocks[block].rows[row] == cells


def test_own_and_printed_tables_have_one_layout(results: StudyResults) -> None:
    """Headers and row headings are the same, cell by cell."""
    trial = next(results.trials("S01"))
    own = own_table(results, trial, read_model("paper-fig3"))
    for mine, printed in zip(own.blocks, printed_table(2).blocks, strict=True):
        assert mine.header == printed.header
        assert [row[0] for row in mine.rows] == [row[0] for row in printed.rows]


def test_headline_names_means(results: StudyResults) -> None:
    """The means are over all digits and hands, best and worst told; nothing was held out, and it says so."""
    means = mean_tip_errors(results, held_out=False)
    mine = rows_where(results.tip_errors, model="rigid", binding="least-squares")
    values = [row["mean_mm"] for row in mine if row["mean_mm"] is not None]
    assert means["rigid"] == pytest.approx(sum(values) / len(values))
    text = headline(results)
    best, worst = sorted(means, key=lambda model: means[model])[:: len(means) - 1]
    assert f"between {means[best]:.2f} mm ({best}) and {means[worst]:.2f} mm ({worst}) on average" in text
    assert "(nothing is held out)" in text


def test_terminal_tables_fit_and_hold_the_numbers(results: StudyResults) -> None:
    """Four tables of the paper a subject, in 80 columns."""
    text = terminal_tables(results)
    assert max(map(len, text.splitlines())) < 80
    for table in range(1, 5):
        assert text.count(f"\nTable {table}. ") == 2
    row = results.tip_error_of["S01", "", "right", "opposition", "", "paper-fig3", "thumb", "first-frame"]
    assert f"{row['mean_mm'] / 10:.2f}" in text


def test_the_terminal_says_what_went_wrong_first(results: StudyResults) -> None:
    problems = [
        problem_row("capture", worded("recording", NOTE, f"{n} " * 60), task=f"rom{n}") for n in range(12)
    ]
    text = terminal_tables(replace(results, problems=problems))
    assert text.index("What went wrong:") < text.index("Table 1")
    assert text.count("rom") >= 10
    assert "- and 2 more; see the report" in text
    assert max(map(len, text.splitlines())) <= WIDTH
    assert "What went wrong" not in terminal_tables(replace(results, problems=[]))


def test_command_line_writes_and_prints(
    made: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One call does both; the last line says where the page is."""
    out = tmp_path / "deep" / "report.html"
    assert _run("--study", str(made[0]), "--results", str(made[1]), "--out", str(out), "--print") == 0
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")
    assert capsys.readouterr().out.splitlines()[-1] == f"The whole report: {out}"
    assert {path.relative_to(out.parent).as_posix() for path in out.parent.rglob("*.html")} == {
        "report.html",
    }


def test_absent_results_are_bad_input(
    made: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and a sentence; with --record-failure a page that says why."""
    out = tmp_path / "report.html"
    words = ("--study", str(made[0]), "--results", str(tmp_path), "--out", str(out))
    assert _run(*words) == 2
    assert "recordings.parquet: no such file" in capsys.readouterr().err
    assert _run(*words, "--record-failure") == 0
    assert "recordings.parquet: no such file" in out.read_text("utf-8")
