"""What is run again after a change: jobs of whom it touches; in them, the tables that it touches."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from studies.running import Job, StudyRun, copy_of_the_program, hashes, record, write_study

pytestmark = pytest.mark.slow

PLAIN, CORRECTED = "plain", "corrected"
ROWS = [
    "01\tright\trom\tboth\t01.csv",
    "02\tright\trom\tboth\t02.csv",
    "late\tright\trom\tboth\tlate.csv",
]
CORRECTIONS = "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t{}\t0\t0\n"
OF_A_HAND = ["solve_joints", "project_planes", "estimate_metacarpals", "evaluate_tips"]
OF_ALL_MODELS = "evaluate_skeletons"
AT_THE_END = {"gather", "report", "subject_pages", "draw_figures"}
FRAMES = 700  # a CSV recording above 1 MB, the size from which Snakemake goes by the time of a file


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a copy of the program and of a study, run: two models, two subjects and one still to come."""
    folder = tmp_path_factory.mktemp("reruns") / "base"
    program = copy_of_the_program(folder / "the program")
    study = folder / "study"
    for subject in ("01", "02"):
        record(study / f"{subject}.csv", subject=subject, frames=FRAMES)
    (study / "corrections.tsv").write_text(CORRECTIONS.format(1))
    head = "description: a model of this study\nown_cmc: [thumb_cmc]\n"
    (study / f"{PLAIN}.yaml").write_text(f"model: {PLAIN}\n{head}")
    (study / f"{CORRECTED}.yaml").write_text(f"model: {CORRECTED}\n{head}planes: {{corrections: true}}\n")
    models = [f"{PLAIN}.yaml", f"{CORRECTED}.yaml"]
    made = write_study(study, "twice", ROWS, models, corrections="corrections.tsv")
    StudyRun(made.file, made.folder, program).run()
    return folder


@pytest.fixture
def study(base: Path, tmp_path: Path) -> StudyRun:
    """A copy of the base study, times of files kept, with a program of its own."""
    shutil.copytree(base, tmp_path / "copy", symlinks=True)
    folder = tmp_path / "copy" / "study"
    return StudyRun(folder / "twice.yaml", folder, tmp_path / "copy" / "the program")


def _rules(jobs: set[Job]) -> set[str]:
    return {job.rule for job in jobs}


def _own(jobs: set[Job], wildcard: str) -> set[str | None]:
    """Values of a wildcard over the jobs that have it."""
    return {job[wildcard] for job in jobs if job[wildcard] is not None}


def _made(study: StudyRun) -> set[str]:
    """Run the study; give the tables of subjects, by their paths, that were made in this run."""
    started = time.time_ns()
    study.run()
    folder = study.results.folder
    tables = [path for path in folder.rglob("*.parquet") if path.parent != folder]
    return {path.relative_to(folder).as_posix() for path in tables if path.stat().st_mtime_ns > started}


def _edit(file: Path, change: Callable[[str], str]) -> None:
    before = file.read_text("utf-8")
    after = change(before)
    assert after != before
    file.write_text(after, "utf-8")


def _after(text: str) -> Callable[[str], str]:
    return lambda before: f"{before}\n{text}\n"


def test_a_second_run_does_nothing(study: StudyRun) -> None:
    assert study.planned() == set()
    assert "Nothing to be done" in study.run()


def test_the_same_study_from_another_folder_does_nothing(study: StudyRun, tmp_path: Path) -> None:
    moved = study.folder.rename(study.folder.with_name("renamed"))
    assert StudyRun(moved / "twice.yaml", moved, study.repository).planned() == set()
    assert tmp_path in moved.parents


def test_a_touched_recording_reruns_its_subject_only(study: StudyRun) -> None:
    recording = study.folder / "01.csv"
    assert recording.stat().st_size > 1_000_000
    os.utime(recording)
    jobs = study.planned()
    assert _rules(jobs) == {"capture", "check_calibration", *OF_A_HAND, OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"01"}
    assert len(jobs) == 3 + len(OF_A_HAND) + 4


def test_a_changed_recording_changes_its_subject_only(study: StudyRun) -> None:
    """Run for real: the other's tables keep their bytes, and then nothing is left to do."""
    before = hashes(study.results.folder)
    record(study.folder / "01.csv", subject="01", frames=FRAMES - 20)
    study.run()
    after = hashes(study.results.folder)
    changed = {name for name in after if after[name] != before[name]}
    assert "report.html" in changed
    assert "tips.parquet" in changed
    assert "sub-01/right/rom/poses.parquet" in changed
    assert not [name for name in changed if "sub-02" in name]
    assert study.planned() == set()


def test_another_hand_leaves_the_first_ones_tables(study: StudyRun) -> None:
    """One job does both hands of a subject, and makes only what the new recording touches."""
    record(study.folder / "01-left.csv", subject="01", hand="left", frames=FRAMES)
    _edit(study.folder / "twice.tsv", lambda text: f"{text}01\tleft\trom\tboth\t01-left.csv\n")
    made = _made(study)
    assert made
    assert all("sub-01/left" in name for name in made)


def test_a_changed_model_file_makes_that_models_tables_only(study: StudyRun) -> None:
    _edit(study.folder / f"{PLAIN}.yaml", _after("joints: {singular_values: 6}"))
    jobs = study.planned()
    assert _rules(jobs) == {*OF_A_HAND, OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"01", "02", "late"}
    made = _made(study)
    assert {name.split("/")[1] for name in made if name.startswith("models/")} == {PLAIN}
    assert {name.split("/")[0] for name in made} == {"models", "hands"}
    assert study.planned() == set()


def test_changed_corrections_make_tables_of_whom_and_what_they_correct(study: StudyRun) -> None:
    (study.folder / "corrections.tsv").write_text(CORRECTIONS.format(2))
    jobs = study.planned()
    assert _rules(jobs) == {*OF_A_HAND[1:], OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"01"}
    made = {name for name in _made(study) if name.startswith("models/")}
    assert made
    assert all(name.startswith(f"models/{CORRECTED}/sub-01/") for name in made)


def test_one_model_more_makes_its_tables_only(study: StudyRun) -> None:
    _edit(study.file, lambda text: text.replace("models: [", "models: [rigid, "))
    jobs = study.planned()
    assert _rules(jobs) == {*OF_A_HAND, OF_ALL_MODELS, *AT_THE_END}
    made = _made(study)
    assert {name.split("/")[1] for name in made if name.startswith("models/")} == {"rigid"}
    assert not [name for name in made if name.startswith("sub-")]


def test_a_table_that_is_gone_is_made_again(study: StudyRun) -> None:
    """Somebody removed it to have it anew; its bytes are what they were, and then nothing is left to do."""
    before = hashes(study.results.folder)
    gone = "models/plain/sub-01/right/joint_centres.parquet"
    (study.results.folder / gone).unlink()
    made = _made(study)
    assert gone in made
    assert not [name for name in made if "sub-02" in name]
    assert hashes(study.results.folder) == before
    study.run()
    assert study.planned() == set()


def test_told_to_do_it_again_it_does(study: StudyRun) -> None:
    started = time.time_ns()
    assert study.snakemake("--forcerun", "solve_joints").returncode == 0
    found = list(study.results.folder.rglob("joint_solutions.parquet"))
    assert len(found) == 3 * 2
    assert all(path.stat().st_mtime_ns > started for path in found)


def test_one_subject_more_runs_that_subject_only(study: StudyRun) -> None:
    shutil.copy(study.folder / "02.csv", study.folder / "03.csv")
    _edit(study.folder / "twice.tsv", lambda text: f"{text}03\tright\trom\tboth\t03.csv\n")
    jobs = study.planned()
    assert _rules(jobs) == {"capture", "check_calibration", *OF_A_HAND, OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"03"}


def test_a_recording_that_came_late_is_captured(study: StudyRun) -> None:
    """A missing file has a row that says so, until it is there."""
    assert study.rows_where("recordings", subject="late")[0]["status"] == "failed"
    shutil.copy(study.folder / "02.csv", study.folder / "late.csv")
    jobs = study.planned()
    assert _rules(jobs) == {"capture", "check_calibration", *OF_A_HAND, OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"late"}


def test_a_comment_in_a_module_reruns_nothing(study: StudyRun) -> None:
    for module in ("stages/solve_joints/solve.py", "kinematics/rotations.py", "schemas/tables.py"):
        _edit(study.repository / module, _after("# said again"))
    assert study.planned() == set()


def test_code_of_a_stage_reruns_it_and_what_depends_on_it(study: StudyRun) -> None:
    _edit(study.repository / "stages/project_planes/plane.py", _after("MORE = 1"))
    jobs = study.planned()
    assert _rules(jobs) == {*OF_A_HAND[1:], OF_ALL_MODELS, *AT_THE_END}
    assert _own(jobs, "subject") == {"01", "02", "late"}


def test_code_that_a_stage_imports_reruns_it(study: StudyRun) -> None:
    """kinematics.skeleton is not the captures' business."""
    _edit(study.repository / "kinematics/skeleton.py", _after("MORE = 1"))
    rules = _rules(study.planned())
    assert "evaluate_tips" in rules
    assert "capture" not in rules
    assert rules >= AT_THE_END


def test_code_of_the_report_reruns_the_report_only(study: StudyRun) -> None:
    _edit(study.repository / "stages/report/base.html.j2", _after("<!-- more -->"))
    jobs = study.planned()
    assert _rules(jobs) == {"report", "subject_pages"}
    assert _own(jobs, "subject") == {"01", "02", "late"}
