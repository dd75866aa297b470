"""The stage's command line on a study on disk."""

from __future__ import annotations

from pathlib import Path

import drawn_movement as drawn
import pytest
from small_study import write_study
from stage_runs import compare_movement as main

from shukotsu.study.results import MOVEMENT_COMPARISONS, Results
from shukotsu.tables.catalogue import MOVEMENT_DIFFERENCES, PROBLEMS
from shukotsu.tables.typed_table import read_metadata, read_table

RECORDINGS = drawn.recordings(8, ("",))


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study of eight subjects in two groups, which the participants sheet names."""
    rows = [f"{row['subject']} right play evaluation {row['subject']}.csv - - - -" for row in RECORDINGS]
    people = "\n".join(["subject group", *(f"{row['subject']} {row['group']}" for row in RECORDINGS)])
    return write_study(tmp_path, *rows, more="factors: [group]\n", participants=people)


def compare(study: Path) -> int:
    return main(["--study", str(study), "--results", str(study.parent / "results")])


def test_groups_are_those_of_the_sheet(study: Path) -> None:
    results = Results(study.parent / "results")
    drawn.write_movement(results, drawn.ranges(RECORDINGS))
    drawn.write(results, PROBLEMS, [])
    assert compare(study) == 0
    assert all(results.study_table(name).is_file() for name in MOVEMENT_COMPARISONS)
    path = results.study_table(MOVEMENT_DIFFERENCES.name)
    rows = read_table(path, MOVEMENT_DIFFERENCES).to_pylist()
    assert {(row["level"], row["other_level"], row["n"], row["n_other"]) for row in rows} == {
        ("A", "B", 4, 4)
    }
    assert "participants.tsv" in {entry["file"] for entry in read_metadata(path)["inputs"]}


def test_a_missing_table_is_named(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compare(study) == 2
    assert "problems.parquet" in capsys.readouterr().err
