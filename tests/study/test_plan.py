"""Subjects' plans: the study's resolved settings of one subject, independent of other subjects."""

import json
from pathlib import Path
from typing import Any

import pytest
from small_study import write_plans, write_study

from shukotsu.study import plan_file
from shukotsu.study.findings import finding_of_text
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import FINDINGS
from shukotsu.tables.parts import Part
from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

ROWS = (
    "01 right rom calibration data/rom.csv",
    "01 right opposition both data/o1.csv 1",
    "02 right rom both data/other.csv",
    "01 left rom both data/left.csv - - moved",
)
SHEETS = {
    "participants": "subject hand_length_mm hand_breadth_mm\n02 170 80\n01 190.5 ",
    "corrections": "subject hand joint dx_mm dy_mm dz_mm\n02 right wrist 1 2 3\n01 right thumb_ip 1 2 3.5",
    "measurements": "subject hand quantity value_mm sd_mm\n01 right hand_breadth 80 2",
}
MODELS = ("rigid", "whole-hand")
RIGHT, LEFT = "right", "left"


def content(study_file: Path, subject: str) -> dict[str, Any]:
    return plan_file.StudyPlans(read_study(study_file), Path("results/test")).content(subject)


def plan(folder: Path, *rows: str, subject: str = "01", **more: Any) -> SubjectPlan:
    file = write_study(folder, *rows, models=more.pop("models", MODELS), **more)
    return plan_file.plan_from_content(content(file, subject), "plan.json")


def test_a_plan_is_read_back_as_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = write_study(Path("study"), *ROWS, models=("rigid", "whole-hand"), **SHEETS)
    path = write_plans(file)["01"]
    read, study = plan_file.read_plan(path), read_study(file)
    assert read == plan_file.plan_from_content(json.loads(path.read_text()), "again")
    assert (read.study, read.who.subject, read.folder) == ("test", "01", Path("study/results/sub-01"))
    assert read.sizes_mm == {"hand_length_mm": 190.5, "hand_breadth_mm": None}
    assert [r.name for r in read.recordings] == ["rom", "opposition_1", "rom"]
    for recording, row in zip(read.recordings, study.of_session("01").recordings, strict=True):
        assert (recording.hand, recording.role, recording.exclude) == (row.hand, row.role, row.exclude)
        assert recording.source.file == Path("study") / row.source.file_as_written
    assert read.layouts == {hand: read_layout("liberty16") for hand in (RIGHT, LEFT)}
    assert list(read.models.values()) == [read_model("rigid"), read_model("whole-hand")]
    (correction,), (measurement,) = read.rows["corrections"], read.rows["measurements"]
    assert correction.values | {"joint": "thumb_ip", "dz_mm": 3.5} == correction.values
    assert (measurement["quantity"], measurement["value_mm"]) == ("hand_breadth", 80.0)
    assert read.sheets["corrections"] == Path("study/sheets/corrections.tsv")
    assert (read.rows["touches"], read.recordings[0].truth) == ((), None)


OTHER_ROW = "03 left rom both data/third.csv"
CORRECTED = SHEETS["corrections"].replace("\n", "\n02 left wrist 1 1 1\n", 1)


@pytest.mark.parametrize(
    ("sheets", "rows", "same"),
    [
        ({}, (OTHER_ROW,), True),
        ({"participants": SHEETS["participants"].replace("170", "171")}, (), True),
        ({"corrections": CORRECTED}, (), True),
        ({"participants": SHEETS["participants"].replace("190.5", "191")}, (), False),
    ],
    ids=["other-row", "other-size", "row-above", "own-size"],
)
def test_a_plan_changes_only_with_its_own_subject(
    tmp_path: Path, sheets: dict[str, str], rows: tuple[str, ...], same: bool
) -> None:
    before = content(write_study(tmp_path, *ROWS, **SHEETS), "01")
    after = content(write_study(tmp_path, *rows, *ROWS, **SHEETS | sheets), "01")
    assert (plan_file.plan_text(after) == plan_file.plan_text(before)) == same
    assert (plan_file.plan_digest(after) == plan_file.plan_digest(before)) == same


def test_the_wanted_error_affects_only_the_judging_stages(tmp_path: Path) -> None:
    """Checks of recordings and fits do not run again after a change of wanted_mm."""
    file = write_study(tmp_path, *ROWS, models=("rigid", "whole-hand"))

    def plans() -> tuple[dict[str, Any], ...]:
        plan = plan_file.StudyPlans(read_study(file), Path("results/test")).content("01")
        return plan, plan_file.recordings_part(plan), plan_file.fit_part(plan, RIGHT, "whole-hand")

    before = plans()
    assert plan_file.plan_from_content(before[0], "plan.json").layouts[RIGHT].wanted_mm == 2.0
    file.write_text(file.read_text() + "\nwanted_mm: 1.5\n")
    after = plans()
    assert plan_file.plan_from_content(after[0], "plan.json").layouts[RIGHT].wanted_mm == 1.5
    assert read_study(file).judged_layout(read_study(file).hands[0]).wanted_mm == 1.5
    assert after[1:] == before[1:]


ROLES = ("01 right a calibration a.csv", "01 right b both b.csv", "01 right c evaluation c.csv")


def tasks(recordings: Any) -> str:
    return "".join(recording.task for recording in recordings)


@pytest.mark.parametrize(
    ("rows", "from_evaluated", "from_all", "evaluated"),
    [
        (ROLES, "b", "ab", "bc"),
        ((ROLES[0], ROLES[2]), "a", "a", "c"),
        ((ROLES[2],), "", "", "c"),
        ((ROLES[0], ROLES[1] + " - - moved", ROLES[2]), "a", "a", "c"),
        ((*ROLES, "02 right a both other.csv", "01 left a both left.csv"), "b", "ab", "bc"),
    ],
    ids=["all-roles", "none-of-both", "only-evaluation", "excluded", "other-hands"],
)
def test_roles_decide_which_recordings_calibrate_and_are_evaluated(
    tmp_path: Path, rows: tuple[str, ...], from_evaluated: str, from_all: str, evaluated: str
) -> None:
    read = plan(tmp_path, *rows)
    assert tasks(read.calibrating(RIGHT, "rigid")) == from_evaluated
    assert tasks(read.calibrating(RIGHT, "whole-hand")) == tasks(read.all_calibrating(RIGHT)) == from_all
    assert tasks(read.evaluated(RIGHT)) == evaluated


@pytest.mark.parametrize(
    ("rows", "model", "left_out"),
    [
        (("01 right c calibration 1", "01 right b both 2"), "whole-hand", {"b": "c"}),
        (("01 right c calibration 1", "01 right b both 2"), "rigid", {"b": "c"}),
        (("01 right b both 1", "01 right d both 2"), "rigid", {"b": "d", "d": "b"}),
        (("01 right c calibration 1", "01 right e evaluation 2"), "whole-hand", {}),
        (("01 right b both 1",), "whole-hand", {}),
        (("01 right b both 1", "01 left c calibration 2"), "whole-hand", {}),
    ],
    ids=["with-a-calibration", "the-papers", "each-other", "held-out-anyhow", "nothing-left", "other-hands"],
)
def test_tasks_are_left_out_in_turn_for_held_out_scores(
    tmp_path: Path, rows: tuple[str, ...], model: str, left_out: dict[str, str]
) -> None:
    read = plan(tmp_path, *rows)
    assert read.left_out(RIGHT, model) == list(left_out)
    for task, used in left_out.items():
        assert tasks(read.calibrating(RIGHT, model, task)) == used
        assert tasks(read.evaluated(RIGHT, task)) == task
    parts = [part for part in read.parts(model) if part.hand == RIGHT]
    assert parts == [Part(RIGHT, model, task, "01") for task in ("", *left_out)]


def test_a_hand_with_a_suspect_or_refused_recording_is_doubted(tmp_path: Path) -> None:
    rows = ("01 right rom both a.csv", "01 left rom both b.csv", "01 left grip evaluation c.csv")
    plan = plan_file.read_plan(write_plans(write_study(tmp_path, *rows))["01"])
    for severity, doubted in (("note", ""), ("suspect", "grip"), ("refused", "grip")):
        row = {"subject": "01", "session": "", "hand": "left", "task": "grip", "trial": ""}
        row |= finding_of_text("units", severity, "In inch.").columns
        write_table(plan.table("findings"), FINDINGS, columns_from_rows(FINDINGS, [row]), Provenance())
        checked = plan.checked(plan.table("findings"))
        assert (checked.doubted("left"), checked.doubted("right")) == (doubted, "")
