"""The paper's tables, the finding and the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from stage_runs import report

from shukotsu.schemas.model import read_model
from shukotsu.stages.report.paper_tables import printed_table, study_table
from shukotsu.stages.report.study_results import StudyResults


def _run(*words: str) -> int:
    return report(words)


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
    own = study_table(results, trial, read_model("paper-fig3"))
    for mine, printed in zip(own.blocks, printed_table(2).blocks, strict=True):
        assert mine.header == printed.header
        assert [row[0] for row in mine.rows] == [row[0] for row in printed.rows]


def test_the_command_writes_one_page(made: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "deep" / "report.html"
    assert _run("--study", str(made[0]), "--results", str(made[1]), "--out", str(out)) == 0
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")
    assert list(out.parent.rglob("*")) == [out]


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
