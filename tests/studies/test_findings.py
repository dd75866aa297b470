"""A study with one mistake of a lab: it is named, the hand judges nothing, and a reason brings it back."""

from __future__ import annotations

import pyarrow.parquet as pq
import pytest
from studies.running import StudyRun, record, write_study

from schemas.catalogue import FINDINGS
from schemas.findings import SUSPECT, Finding, values_of
from schemas.tables import read_table, rows_of

pytestmark = pytest.mark.slow

MODELS = ["paper-fig4", "whole-hand"]
SWAPPED = {"index_middle": "index_distal", "index_distal": "index_middle"}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Three subjects; the second's two outer receivers of the index finger were exchanged."""
    folder = tmp_path_factory.mktemp("findings")
    for subject in ("01", "02", "03"):
        record(folder / f"{subject}.parquet", subject=subject, frames=2400)
    table = pq.read_table(folder / "02.parquet")
    names = [SWAPPED.get(name, name) for name in table["segment"].to_pylist()]
    place = table.schema.get_field_index("segment")
    pq.write_table(table.set_column(place, "segment", [names]), folder / "02.parquet")
    rows = [f"{subject}\tright\trom\tboth\t{subject}.parquet" for subject in ("01", "02", "03")]
    made = write_study(folder, "swapped", rows, MODELS)
    made.run()
    return made


def subject_page(study: StudyRun, subject: str) -> str:
    return study.results.subject_page(subject).read_text("utf-8")


def test_the_mistake_is_named_with_what_to_write(study: StudyRun) -> None:
    (problem,) = study.rows_where("problems", stage="check_recordings")
    assert (problem["subject"], problem["hand"], problem["task"]) == ("02", "right", "rom")
    assert (problem["kind"], problem["severity"]) == ("receivers-swapped", "suspect")
    assert (
        "index_distal and index_middle" in problem["message"]
        or "index_middle and index_distal" in problem["message"]
    )
    assert "exchange their names" in problem["message"]
    values = values_of(problem["values"])
    assert {values["segment"], values["segment_2"]} == {*SWAPPED}
    assert values["moved"] > 0
    assert Finding("receivers-swapped", SUSPECT, "", values).message == problem["message"]
    (finding,) = rows_of(read_table(study.results.subject("02") / "findings.parquet", FINDINGS))
    assert finding["message"] == problem["message"]


def test_none_of_its_joints_is_believed(study: StudyRun) -> None:
    for table in ("joint_centres", "bone_lengths"):
        assert {row["verdict"] for row in study.rows_where(table, subject="02")} == {"no"}
        assert {row["verdict"] for row in study.rows_where(table, subject="01")} > {"no"}
    reasons = {row["reason"] for row in study.rows_where("joint_centres", subject="02")}
    assert "suspect-recording" in reasons


def test_it_judges_nothing_and_that_is_said(study: StudyRun) -> None:
    page = study.page()
    assert "Settle this first" in page
    assert "Left out of these numbers, for what was found in their recordings: subject 02" in page
    assert "Settle this first" in subject_page(study, "02")
    assert "Settle this first" not in subject_page(study, "01")


def test_a_reason_in_the_sheet_brings_it_back(study: StudyRun) -> None:
    sheet = study.folder / "swapped.tsv"
    lines = sheet.read_text("utf-8").splitlines()
    reasons = ["as worn" if line.startswith("02") else "" for line in lines[1:]]
    accepted = [f"{line}\t\t{reason}" for line, reason in zip(lines[1:], reasons, strict=True)]
    sheet.write_text("\n".join([f"{lines[0]}\taccept", *accepted]) + "\n", "utf-8")
    assert {job.subject for job in study.planned() if job.subject} == {"02"}
    study.run()
    (problem,) = study.rows_where("problems", stage="check_recordings")
    assert problem["severity"] == "note"
    assert problem["message"].endswith("Accepted: as worn")
    assert "ok" in {row["status"] for row in study.rows_where("joint_centres", subject="02")}
    assert "Settle this first" not in study.page()
    assert study.page().count("as worn") == 1
    assert "Accepted in the recordings sheet" in subject_page(study, "02")
