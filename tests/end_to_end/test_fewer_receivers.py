"""Every stage for a subject calibrated with sixteen receivers who performs a task with six."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import recorded
from small_study import QUICK, PlannedSubject, import_recording, write_plans, write_study
from stage_runs import check_recordings, evaluate_skeletons, of_plan, outputs

from shukotsu.simulate.random_hand import DIGITS
from shukotsu.simulate.recording import write_recording
from shukotsu.tables.catalogue import FINDINGS, POSES, SKELETON_SCORES
from shukotsu.tables.typed_table import read_metadata, read_table, rows_of

pytestmark = pytest.mark.slow

SIX = ("hand", *(f"{digit}_distal" for digit in DIGITS))
LAYOUTS = {"rom": "liberty16", "tips": "tips-and-hand"}


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    folder = tmp_path_factory.mktemp("fewer")
    (folder / "quick.yaml").write_text(QUICK)
    rows = ("01 right tips evaluation t.parquet - tips-and-hand", "01 right rom calibration r.parquet")
    write_plans(write_study(folder, *rows, models=["rigid", "quick.yaml"]))
    subject = PlannedSubject(folder)
    rom, task = (recorded(task=name, seed=4, n_frames=300)[0] for name in ("rom", "opposition"))
    worn = [task.segments.index(name) for name in SIX]
    few = replace(
        task, segments=SIX, position_mm=task.position_mm[:, worn], quaternion=task.quaternion[:, worn]
    )
    for name, recording in (("rom", rom), ("tips", few)):
        write_recording(folder / f"{name}.parquet", recording)
        subject.poses(name).parent.mkdir(parents=True)
        import_recording(folder / f"{name}.parquet", subject.poses(name), task=name, layout=LAYOUTS[name])
    folder = subject.plan_file.parent
    assert check_recordings([f"--plan={subject.plan_file}", f"--out={folder / 'findings.parquet'}"]) == 0
    subject.run_stages()
    stage = "evaluate_skeletons"
    assert evaluate_skeletons([*of_plan(stage, subject.plan_file), *outputs(stage, folder)]) == 0
    return subject


def test_the_larger_layout_is_used_and_unworn_receivers_are_not_absent(subject: PlannedSubject) -> None:
    assert subject.plan.layouts["right"].name == "liberty16"
    assert read_metadata(subject.poses("tips"))["parameters"]["absent"] == []
    assert set(read_table(subject.poses("tips"), POSES)["segment"].to_pylist()) == set(SIX)
    assert list(rows_of(read_table(subject.plan_file.with_name("findings.parquet"), FINDINGS))) == []


def test_a_fitted_hand_is_posed_completely_with_errors(subject: PlannedSubject) -> None:
    part, folder = subject.part("quick"), subject.fit_folder()
    for name, numbers, count in (
        ("joint_angles", ("flexion_deg", "flexion_sd_deg"), 17),
        ("bone_poses", ("x_mm", "sd_mm", "turn_sd_deg"), 20),
        ("posed_tips", ("tip_x_mm", "skin_tip_x_mm", "tip_sd_mm", "skin_tip_sd_mm", "error_mm"), 5),
    ):
        every = subject.rows(folder / f"{name}.parquet", name, part)
        rows = [row for row in every if row["task"] == "tips"]
        assert len(rows) == count * 300
        assert {row["task"] for row in every} == {"tips", "rom"}
        values = np.array([[row[number] for number in numbers] for row in rows], float)
        assert np.isfinite(values).all(), name


def test_the_reason_for_missing_scores_is_stated(subject: PlannedSubject) -> None:
    """A replay names the receivers that are missing; a fitted hand is scored nevertheless."""
    folder = subject.plan_file.parent
    for model in ("rigid", "quick"):
        errors = subject.rows(folder / "tip_errors.parquet", "tip_errors", subject.part(model))
        index = next(row for row in errors if row["digit"] == "index")
        assert index["mean_mm"] is None
        assert index["message"] == (
            "the recording has no pose of index_proximal and index_middle, which the replay needs"
        )
    scores = list(rows_of(read_table(folder / "skeleton_scores.parquet", SKELETON_SCORES)))
    fitted = [row for row in scores if row["model"] == "quick"]
    assert [row["digit"] for row in fitted] == list(DIGITS)
    assert all(row["posed_mean_mm"] < 2 for row in fitted)
    assert all("no pose of" in row["message"] for row in scores if row["model"] == "rigid")
