"""The stage on a study on disk."""

from __future__ import annotations

from pathlib import Path

from report_samples.made_study import many_subjects
from stage_runs import compare_models as main

from shukotsu.study.results import MODEL_COMPARISONS, Results
from shukotsu.tables.catalogue import PROBLEMS, TABLES
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_metadata, read_table, write_table


def test_tables_are_written_and_a_suspect_hand_is_in_none(tmp_path: Path) -> None:
    """The same study twice: with a finding against one hand of the first subject, its places are gone."""
    study, folder = many_subjects(tmp_path, 2, ("paper-fig4", "whole-hand"))
    results = Results(folder)

    def places() -> int:
        assert main(["--study", str(study), "--results", str(folder)]) == 0
        rows = read_table(results.study_table("model_pairs"), TABLES["model_pairs"]).to_pylist()
        return sum(row["n_places"] for row in rows if (row["subject"], row["digit"]) == ("S001", ""))

    whole = places()
    assert "skeleton_scores.parquet" in {
        Path(entry["file"]).name for entry in read_metadata(results.study_table("model_values"))["inputs"]
    }
    where = {"subject": "S001", "hand": "left", "severity": "suspect"}
    texts = {column.name: "" for column in PROBLEMS.columns}
    row = {**texts, **where, "accepted": ""}
    columns = columns_from_rows(PROBLEMS, [row])
    write_table(results.study_table(PROBLEMS.name), PROBLEMS, columns, Provenance((), {}))
    assert places() == whole // 2
    assert all(results.study_table(name).is_file() for name in MODEL_COMPARISONS)
