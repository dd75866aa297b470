"""Names that Snakemake has uses for, and keys that no study has."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.running import record, write_study

pytestmark = pytest.mark.slow

LONG = "s" * 300
NAMES = ["{subject}", "a" * 24, "/" * 24, 'A & <b>"x"']


def test_no_name_in_a_sheet_stops_the_study(tmp_path: Path) -> None:
    """Nor one of a file that Snakemake would take for a pattern; what cannot be is a problem of its row."""
    rows = []
    for subject, file in zip(NAMES, ["{x}.parquet", "<b>.parquet", "a {b} c.csv", "d.parquet"], strict=True):
        record(tmp_path / file, subject=subject)
        rows.append(f"{subject}\tright\t{{rom}}\tboth\t{file}")
    rows += [f"{LONG}\tright\trom\tboth\td.parquet", f"gone\tright\trom\tboth\t{'f' * 300}.csv"]
    rows += ["other\tleft\trom\tboth\tdata\\rom.csv"]
    study = write_study(tmp_path, "names", rows, ["rigid"])
    text = study.run()
    used = {row["subject"] for row in study.rows("recordings") if row["status"] == "used"}
    assert used == set(NAMES)
    problems = {
        row["subject"]: row["message"] for row in study.rows("problems") if row["severity"] == "refused"
    }
    assert problems.keys() == {LONG, "gone", "other"}
    assert problems[LONG].startswith("names.tsv: row 6, columns subject, session, task, trial: have 3")
    assert problems["gone"].startswith("names.tsv: row 7, column file: has a part of more than 255 bytes")
    assert "folders are separated by / and not by \\" in problems["other"]
    assert text.count("the row was left out") == 2
    (tmp_path / "{x}.parquet").write_bytes((tmp_path / "d.parquet").read_bytes())
    assert {job.subject for job in study.planned() if job.rule == "capture"} == {"%7Bsubject%7D"}
