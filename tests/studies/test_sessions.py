"""A study with several sessions and exports: sessions are solved separately and never mixed.

Every format is exported for every model, or the reason is stated.
"""

import json
from itertools import product

import pytest
from studies.running import ALL_BUT_FIGURES, SHORT_FIT, StudyRun, record, write_study

from shukotsu.export.registry import FORMATS
from shukotsu.study.results import STUDY_TABLES, Results
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.subjects import path_token

pytestmark = pytest.mark.slow

MODELS = ("paper-fig4", "fitted")
FORMATS_ASKED = ("bvh", "glb", "osim", "c3d", "bids", "csv")
HEADER = "subject\tsession\thand\ttask\trole\tfile"
EVENTS = "subject\thand\tsession\ttask\tonset_s\tname"
ONSETS_S = (0.5, 1.0, 1.5)
FRAMES = 480


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Subject 01 in three sessions, the third with a missing file, and subject 02 without a session, whose
    index fingertip is lost every 50 frames.
    """
    folder = tmp_path_factory.mktemp("sessions")
    for session in ("1", "post op"):
        record(folder / f"01_{path_token(session)}.parquet", frames=FRAMES, session=session)
    lines = record(folder / "02.csv", subject="02", frames=FRAMES).read_text("utf-8").splitlines()
    rest = [line for line in lines if ',"index_distal",' not in line or int(line.split(",")[0]) % 50]
    assert len(rest) < len(lines)
    (folder / "02.csv").write_text("\n".join(rest) + "\n", "utf-8")
    rows = [
        HEADER,
        "01\t1\tright\trom\tboth\t01_1.parquet",
        "02\t\tright\trom\tboth\t02.csv",
        "01\tpost op\tright\trom\tboth\t01_post%20op.parquet",
        "01\t3\tright\trom\tboth\tnowhere.parquet",
    ]
    events = [EVENTS, *(f"01\tright\t1\trom\t{onset_s}\tkey" for onset_s in ONSETS_S)]
    (folder / "events.tsv").write_text("\n".join(events) + "\n", "utf-8")
    (folder / "fitted.yaml").write_text(SHORT_FIT, "utf-8")
    keys = {"events": "events.tsv", "factors": "[session]", "exports": f"[{', '.join(FORMATS_ASKED)}]"}
    keys["export_settings"] = "{rig: webxr, licence: CC-BY-4.0}"
    study = write_study(folder, "redonned", rows, [MODELS[0], "fitted.yaml"], **keys)
    study.run(*ALL_BUT_FIGURES)
    return study


def test_each_session_has_its_own_folder_and_rows(study: StudyRun) -> None:
    folders = {path.name for path in study.results.folder.glob("sub-*")}
    assert folders == {"sub-01_ses-1", "sub-01_ses-post%20op", "sub-01_ses-3", "sub-02"}
    for name in STUDY_TABLES:
        if name == "agreement":  # whose rows may be of two sessions
            continue
        rows, key = study.rows(name), TABLES[name].key
        assert {(row["subject"], row["session"]) for row in rows} <= {
            ("01", "1"), ("01", "post op"), ("01", "3"), ("02", ""), ("", "")
        }, name  # fmt: skip
        if key:
            assert len({tuple(row[column] for column in key) for row in rows}) == len(rows), name
    centres = study.rows_where("joint_centres", model="fitted", joint="index_pip")
    centre_x_mm = {(row["subject"], row["session"]): row["child_x_mm"] for row in centres}
    assert centre_x_mm.pop(("01", "3")) is None
    assert set(centre_x_mm) == {("01", "1"), ("01", "post op"), ("02", "")}
    assert centre_x_mm["01", "1"] != centre_x_mm["01", "post op"]


def test_events_apply_to_their_session_only(study: StudyRun) -> None:
    events = study.rows("events")
    assert [(row["subject"], row["session"], row["onset_s"], row["source"]) for row in events] == [
        ("01", "1", onset_s, "sheet") for onset_s in ONSETS_S
    ]
    assert {row["session"] for row in study.rows("movement_cycles")} == {"1"}
    assert {row["factor"] for row in study.rows("movement_differences")} <= {"session"}
    assert {row["session"] for row in study.rows_where("ranges_of_motion", subject="01")} == {"1", "post op"}


def test_a_failed_session_is_reported_and_affects_no_other(study: StudyRun) -> None:
    problems = [row for row in study.rows("problems") if row["severity"] == "refused"]
    assert ("01", "3") in {(row["subject"], row["session"]) for row in problems}
    assert {(row["subject"], row["session"]) for row in problems if row["stage"] != "export"} == {("01", "3")}
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
    units = ("sub-01_ses-1", "sub-01_ses-post%20op")
    assert exports >= {f"{unit}_hand-right_task-rom_model-{m}.bvh" for unit, m in product(units, MODELS)}
    dataset = study.results.exports / "bids"
    motions = {path.relative_to(dataset).parent.as_posix() for path in dataset.rglob("*_motion.tsv")}
    assert motions == {"sub-01/ses-1/motion", "sub-01/ses-postQsop/motion", "sub-02/motion"}
    assert (dataset / "participants.tsv").read_text("utf-8").count("sub-01") == 1


def test_every_export_is_written_or_its_reason_is(study: StudyRun) -> None:
    """Formats that cannot hold gaps are replaced by a file with the reason."""
    names, page = {path.name for path in study.results.exports.iterdir()}, study.page()
    for model in MODELS:
        stem = f"sub-01_ses-1_hand-right_task-rom_model-{model}"
        written = {stem + end for name in FORMATS_ASKED if name != "bids" for end in FORMATS[name].extensions}
        assert {name for name in names if name.startswith(stem)} == {*written, f"{stem}.bvh.txt"}
    stem = "sub-02_hand-right_task-rom_model-paper-fig4"
    holding = {name for name in FORMATS_ASKED if FORMATS[name].holds_gaps and name != "bids"}
    assert {stem + FORMATS[name].extensions[0] for name in holding} <= names
    failed = {f"{stem}_{name}.failed.txt" for name in ("bvh", "glb", "osim")}
    assert failed <= names
    assert [name for name in failed if name.removesuffix(".failed.txt") not in page] == []
    assert "choose --gaps hold, cut or interpolate" in page


def test_the_shared_export_folder_uses_hard_links(study: StudyRun) -> None:
    """Files in the folder of all exports are hard links to those of the subjects' folders."""
    folders = {path for path in study.results.exports.iterdir() if path.is_dir()}
    assert folders == {study.results.exports / name for name in ("bids", "tables")}
    package = json.loads((study.results.exports / "tables" / "datapackage.json").read_text("utf-8"))
    resources = {resource["name"] for resource in package["resources"]}
    assert resources >= {"recordings", "ranges_of_motion", "problems"}
    files = list(study.results.subject_exports("02").glob("sub-*"))
    assert files
    assert all((study.results.exports / file.name).samefile(file) for file in files)


def test_exports_of_a_removed_format_are_deleted(study: StudyRun) -> None:
    """It must run last, as it changes the study."""
    text = study.file.read_text("utf-8")
    study.file.write_text(text.replace("[bvh, ", "[").replace(", bids", ""), "utf-8")
    study.run(*ALL_BUT_FIGURES)
    names = {path.name for path in study.results.exports.iterdir()}
    assert not [name for name in names if "bvh" in name or "bids" in name]
    assert "sub-01_ses-1_hand-right_task-rom_model-paper-fig4.glb" in names
    assert study.planned(*ALL_BUT_FIGURES) == set()
