"""Gathering the subjects' tables into the study's, and listing failures as problems."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
import yaml
from simulated_poses import recorded, write_poses
from small_study import write_plans, write_study

from shukotsu.study.findings import REFUSED, Finding
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import read_plan
from shukotsu.study.results import FIT_TABLES, GATHERED_TABLES, STUDY_TABLES, Results
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import CLOCKS, FINDINGS, TABLES
from shukotsu.tables.parts import Part, parts_writer
from shukotsu.tables.typed_table import (
    Provenance,
    Table,
    columns_from_rows,
    read_metadata,
    read_table,
    rows_of,
    write_table,
)
from shukotsu.workflow.study_tables import gather_study

ROWS = (
    "01 right rom calibration a.csv",
    "01 right pinch both b.csv 1",
    "01 left pinch evaluation c.csv",
    "02 right pinch both d.csv",
    "02 right rom both e.csv - - moved",
)
MODELS = ("rigid", "whole-hand")
CORRECTIONS = "subject hand joint dx_mm dy_mm dz_mm\n01 right thumb_ip 1 2 3\n03 right thumb_ip 1 2 3"


def row_of(table: Table, **values: Any) -> dict[str, Any]:
    """Return a row with the given values and defaults for the other non-nullable columns."""
    filled = {
        c.name: {pa.string(): "", pa.bool_(): False}.get(c.type, 1) for c in table.columns if not c.nullable
    }
    return filled | {name: value for name, value in values.items() if name in {c.name for c in table.columns}}


def write_findings(plan: SubjectPlan, *rows: dict[str, Any], **parameters: Any) -> None:
    columns = columns_from_rows(FINDINGS, [{**plan.who._asdict(), "trial": "", **row} for row in rows])
    write_table(plan.table("findings"), FINDINGS, columns, Provenance((), {"digests": {}, **parameters}))


def write_subject(plan: SubjectPlan, failures: dict[tuple[str, Part], str] | None = None) -> None:
    """Write all tables that are gathered, two rows per part, and poses of four frames.

    failures : the message that replaces the rows of a table's part.
    """
    for recording in plan.recordings:
        if not recording.exclude:
            poses, hand = recorded(seed=1, n_frames=4)[1], recording.hand
            names = {"subject": hand.subject, "trial": recording.trial}
            write_poses(plan.poses(recording), poses, hand.hand, recording.task, **names)
    write_findings(plan)
    for name in (*GATHERED_TABLES, "length_pulls"):
        for path in plan.files_of(name):
            parts = plan.parts()
            if name in FIT_TABLES:
                parts = [p for p in parts if path == plan.table(name, p.hand, p.model)]
            if "made_without" not in TABLES[name].key:  # scores: a part is a hand
                parts = [plan.part(hand) for hand in plan.hands]
            _write_parts(path, TABLES[name], parts, failures or {})


def _write_parts(path: Path, table: Table, parts: list[Part], failures: dict[tuple[str, Part], str]) -> None:
    with parts_writer(path, table, Provenance()) as writer:
        for part in parts:
            if (table.name, part) in failures:
                writer.failure(part, failures[table.name, part])
            else:
                names = ("joint", "segment", "digit", "quantity", "unknown", "without", "trial")
                name = next(name for name in names if name in table.key)
                writer.rows(part, [row_of(table, **vars(part), **{name: text}, pull_mm=0.5) for text in "ab"])


@pytest.fixture
def plans(tmp_path: Path) -> list[SubjectPlan]:
    """Plans of a study whose subjects' tables are written."""
    file = write_study(tmp_path, *ROWS, models=MODELS, corrections=CORRECTIONS)
    read = [read_plan(path) for path in write_plans(file).values()]
    for plan in read:
        write_subject(plan)
    return read


def gathered(folder: Path) -> dict[str, list[dict[str, Any]]]:
    results = Results(folder / "results")
    gather_study(read_study(folder / "study.yaml"), results)
    return {name: list(rows_of(read_table(results.study_table(name), TABLES[name]))) for name in STUDY_TABLES}


def whose(row: dict[str, Any]) -> tuple[str, str, str]:
    return row["subject"], row["hand"], row["model"]


def test_findings_are_problems_and_a_refused_recording_is_not_used(
    plans: list[SubjectPlan], tmp_path: Path
) -> None:
    finding = Finding("spikes", REFUSED, "all")
    row = {"hand": "right", "task": "pinch", "trial": "1", **finding.columns}
    digests = {"01//right/rom/": "a", "01//right/pinch/1": ""}
    write_findings(plans[0], row, digests=digests)
    write_findings(plans[1], digests={"02//right/pinch/": "a", "02//right/rom/": ""})
    tables = gathered(tmp_path)
    rows = [row for row in tables["problems"] if row["stage"] == "check_recordings"]
    keys = ("subject", "hand", "task", "kind", "severity")
    assert [tuple(row[key] for key in keys) for row in rows] == [
        ("01", "right", "pinch, 1", "spikes", "refused"),
        ("02", "right", "pinch", "same-file", "suspect"),
    ]
    assert rows[0]["message"] == finding.message
    assert "those of subject 01, right hand, rom:" in rows[1]["message"]
    statuses = {(row["subject"], row["task"], row["hand"]): row["status"] for row in tables["recordings"]}
    assert statuses["01", "pinch", "right"] == "refused"
    assert statuses["02", "pinch", "right"] == "used"


@pytest.mark.usefixtures("plans")
def test_further_columns_of_the_sheet_are_copied_to_the_table(tmp_path: Path) -> None:
    """Their values are unchanged and a note names them; one with the name of a column of the table is
    renamed.
    """
    sheet = tmp_path / "sheets" / "recordings.tsv"
    head, *rows = sheet.read_text().splitlines()
    width = head.count("\t")
    lines = [row + "\t" * (width - row.count("\t")) + f"\tn{index}\tx" for index, row in enumerate(rows)]
    sheet.write_text("\n".join([f"{head}\tnote\tstatus", *lines]))
    tables = gathered(tmp_path)
    assert [row["note"] for row in tables["recordings"]] == [f"n{index}" for index in range(len(rows))]
    assert {row["status_of_sheet"] for row in tables["recordings"]} == {"x"}
    assert tables["recordings"][0]["status"] != "x"
    (note,) = (row["message"] for row in tables["problems"] if "further columns" in row["message"])
    assert note.endswith("note, status")


def test_an_uncertain_clock_is_a_problem_of_its_recording(plans: list[SubjectPlan], tmp_path: Path) -> None:
    hand = vars(plans[0].hand("right"))
    rows = [
        row_of(CLOCKS, **hand, task="pinch", trial=trial, status=status, message=status)
        for trial, status in (("1", "weak"), ("2", "failed"), ("3", "ok"))
    ]
    with parts_writer(plans[0].table("clocks"), CLOCKS, Provenance()) as writer:
        writer.rows(plans[0].part("right"), rows)
    rows = [row for row in gathered(tmp_path)["problems"] if row["kind"] == "events"]
    assert [(row["task"], row["severity"]) for row in rows] == [("pinch, 1", "note"), ("pinch, 2", "note")]


@pytest.mark.usefixtures("plans")
def test_gathered_tables_have_every_skeleton_in_the_sheets_order(tmp_path: Path) -> None:
    tables = gathered(tmp_path)
    hands = [("01", "right"), ("01", "left"), ("02", "right")]
    skeletons = [(*hand, model) for hand in hands for model in MODELS]
    for name in GATHERED_TABLES:
        rows = tables[name]
        assert not any(row.get("made_without") for row in rows), name
        if "made_without" not in TABLES[name].key:
            assert [(row["subject"], row["hand"]) for row in rows] == [hand for hand in hands for _ in "ab"]
        else:
            fitted = [skeleton for skeleton in skeletons if skeleton[2] == "whole-hand"]
            expected = fitted if name in FIT_TABLES else skeletons
            assert [whose(row) for row in rows] == [skeleton for skeleton in expected for _ in "ab"], name


@pytest.mark.usefixtures("plans")
def test_a_gathered_table_records_its_sources(tmp_path: Path) -> None:
    gathered(tmp_path)
    inputs = read_metadata(tmp_path / "results/joint_centres.parquet")["inputs"]
    assert [entry["file"] for entry in inputs] == [f"sub-{n}/joint_centres.parquet" for n in ("01", "02")]
    resolved = yaml.safe_load((tmp_path / "results/resolved.yaml").read_text())
    assert resolved["study"]["models"] == list(MODELS)
    assert [model["model"] for model in resolved["models"]] == list(MODELS)
    assert resolved["models"][0]["joints"]["calibration"] == "evaluated", "defaults are filled in"
    assert [layout["layout"] for layout in resolved["layouts"]] == ["liberty16"]


def test_a_failed_part_is_one_problem_and_the_others_are_gathered(
    plans: list[SubjectPlan], tmp_path: Path
) -> None:
    """The same message in several tables is one problem, of the first stage that recorded it; a failed
    skeleton made without a task is not a problem.
    """
    rigid, without = plans[0].part("right", "rigid"), plans[0].part("right", "rigid", "pinch")
    assert without in plans[0].parts()
    tables = ("joint_centres", "bone_lengths", "tip_errors")
    failures = {(name, rigid): "no frame was valid" for name in tables}
    failures |= {(name, without): "too few frames" for name in tables}
    failures["skeleton_scores", plans[0].part("left")] = "no recording"
    write_subject(plans[0], failures)
    tables = gathered(tmp_path)
    assert ("01", "right", "rigid") not in {whose(row) for row in tables["joint_centres"]}
    assert ("01", "right", "whole-hand") in {whose(row) for row in tables["joint_centres"]}
    others = ("solve_joints", "project_planes", "fit_hand")
    problems = [row for row in tables["problems"] if row["stage"] not in others]
    assert [(*whose(row), row["stage"], row["kind"], row["message"]) for row in problems] == [
        ("01", "right", "rigid", "estimate_metacarpals", "skeleton", "no frame was valid"),
        ("01", "left", "", "evaluate_skeletons", "hand", "no recording"),
    ]
