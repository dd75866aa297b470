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


def test_groups_are_those_of_the_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Eight subjects in two groups, which the participants sheet names; a table that is missing is named."""
    rows = [f"{row['subject']} right play evaluation {row['subject']}.csv - - - -" for row in RECORDINGS]
    people = "\n".join(["subject group", *(f"{row['subject']} {row['group']}" for row in RECORDINGS)])
    study = write_study(tmp_path, *rows, more="factors: [group]\n", participants=people)
    results = Results(tmp_path / "results")
    argv = ["--study", str(study), "--results", str(results.folder)]
    assert main(argv) == 2
    assert "problems.parquet" in capsys.readouterr().err
    drawn.write_movement(results, drawn.ranges(RECORDINGS))
    drawn.write(results, PROBLEMS, [])
    assert main(argv) == 0
    assert all(results.study_table(name).is_file() for name in MOVEMENT_COMPARISONS)
    path = results.study_table(MOVEMENT_DIFFERENCES.name)
    differences = read_table(path, MOVEMENT_DIFFERENCES).to_pylist()
    names = ("level", "other_level", "n", "n_other")
    assert {tuple(row[name] for name in names) for row in differences} == {("A", "B", 4, 4)}
    assert "participants.tsv" in {entry["file"] for entry in read_metadata(path)["inputs"]}
