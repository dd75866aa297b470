"""A study of sessions: receivers put on anew are solved by themselves, and nothing of two is mixed."""

from __future__ import annotations

from itertools import product

import pytest
from studies.running import StudyRun, record, write_study

from shukotsu.study.results import STUDY_TABLES, Results
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.subjects import path_token
from shukotsu.tables.typed_table import read_table, rows_of

pytestmark = pytest.mark.slow

MODELS = ["paper-fig4", "whole-hand"]
EVENTS = "subject\thand\tsession\ttask\tonset_s\tname"
HEADER = "subject\tsession\thand\ttask\trole\tfile"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Subject 01 in three sessions, of which the third's file is not there; 02 in none that is named."""
    folder = tmp_path_factory.mktemp("sessions")
    for session in ("1", "post op"):
        record(folder / f"01_{path_token(session)}.parquet", frames=2400, session=session)
    record(folder / "02.parquet", subject="02", frames=2400)
    rows = [
        HEADER,
        "01\t1\tright\trom\tboth\t01_1.parquet",
        "02\t\tright\trom\tboth\t02.parquet",
        "01\tpost op\tright\trom\tboth\t01_post%20op.parquet",
        "01\t3\tright\trom\tboth\tnowhere.parquet",
    ]
    events = [EVENTS, *(f"01\tright\t1\trom\t{onset}\tkey" for onset in (1.0, 2.5, 4.0))]
    (folder / "events.tsv").write_text("\n".join(events) + "\n", "utf-8")
    keys = {"events": "events.tsv", "factors": "[session]", "exports": "[bvh, bids]"}
    study = write_study(folder, "redonned", rows, MODELS, **keys)
    study.run()
    return study


def test_each_session_has_a_folder_and_rows_of_its_own(study: StudyRun) -> None:
    folders = {path.name for path in study.results.folder.glob("sub-*")}
    assert folders == {"sub-01_ses-1", "sub-01_ses-post%20op", "sub-01_ses-3", "sub-02"}
    for name in STUDY_TABLES:
        rows = list(rows_of(read_table(study.results.study_table(name), TABLES[name])))
        key = TABLES[name].key
        assert {(row["subject"], row["session"]) for row in rows} <= {
            ("01", "1"), ("01", "post op"), ("01", "3"), ("02", ""), ("", "")
        }, name  # fmt: skip
        if key:
            assert len({tuple(row[column] for column in key) for row in rows}) == len(rows), name
    centres = study.rows_where("joint_centres", model="whole-hand", joint="index_pip")
    places = {(row["subject"], row["session"]): row["child_x_mm"] for row in centres}
    assert places.pop(("01", "3")) is None
    assert set(places) == {("01", "1"), ("01", "post op"), ("02", "")}
    assert places["01", "1"] != places["01", "post op"]


def test_events_cut_the_movement_of_their_session_alone(study: StudyRun) -> None:
    events = study.rows("events")
    assert [(row["subject"], row["session"], row["onset_s"], row["source"]) for row in events] == [
        ("01", "1", onset, "sheet") for onset in (1.0, 2.5, 4.0)
    ]
    assert {row["session"] for row in study.rows("movement_cycles")} == {"1"}
    assert {row["factor"] for row in study.rows("movement_differences")} <= {"session"}
    assert {row["session"] for row in study.rows_where("ranges_of_motion", subject="01")} == {"1", "post op"}


def test_a_session_that_fails_fails_alone_and_is_named(study: StudyRun) -> None:
    problems = [row for row in study.rows("problems") if row["severity"] == "refused"]
    assert problems
    assert {(row["subject"], row["session"]) for row in problems} == {("01", "3")}
    statuses = {row["session"]: row["status"] for row in study.rows_where("recordings", subject="01")}
    assert statuses == {"1": "used", "post op": "used", "3": "failed"}


def test_pages_exports_and_the_dataset_name_the_session(study: StudyRun) -> None:
    pages, whole = Results(study.results.folder), study.page()
    for subject, session in (("01", "1"), ("01", "post op"), ("02", "")):
        page = pages.subject_page(subject, session).read_text("utf-8")
        assert ("session" in page) == bool(session)
        if session:
            assert f"{subject}, session {session}" in page
            assert f"{subject}, session {session}" in whole
    exports = {path.name for path in study.results.exports.glob("*.bvh")}
    units = ("sub-01_ses-1", "sub-01_ses-post%20op", "sub-02")
    assert exports == {f"{unit}_hand-right_task-rom_model-{m}.bvh" for unit, m in product(units, MODELS)}
    dataset = study.results.dataset
    motions = {path.relative_to(dataset).parent.as_posix() for path in dataset.rglob("*_motion.tsv")}
    assert motions == {"sub-01/ses-1/motion", "sub-01/ses-postQsop/motion", "sub-02/motion"}
    assert (dataset / "participants.tsv").read_text("utf-8").count("sub-01") == 1
