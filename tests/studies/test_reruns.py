"""What is run again after a change, as Snakemake decides: nothing is hidden from it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from studies.running import Job, StudyRun, copy_of_the_program, hashes, record, write_study

from schemas.plan import read_plan
from schemas.results import FIT_TABLES, PRIOR_TABLES, STUDY_TABLES, SUBJECT_TABLES

pytestmark = pytest.mark.slow

PLAIN, CORRECTED, FITTED = "plain", "corrected", "fitted"
ROWS = [
    "01\tright\trom\tboth\t01.csv",
    "02\tright\trom\tboth\t02.csv",
    "late\tright\trom\tboth\tlate.csv",
]
CORRECTIONS = "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t{}\t0\t0\n"
CHECKED = {"plan_check", "check_recordings"}
AFTER_CAPTURE = {"check_recordings", "align_events", "check_calibration", "solve_joints"}
AFTER_CAPTURE |= {"fit_prior", "fit_hand"}
AFTER_SOLVING = {
    "project_planes",
    "estimate_metacarpals",
    "evaluate_tips",
    "evaluate_skeletons",
    "measure_movement",
}
AT_THE_END = {"gather", "compare_movement", "report", "subject_pages", "print_figures"}
EVERYTHING = {"capture", *AFTER_CAPTURE, *AFTER_SOLVING, *AT_THE_END}
FRAMES = 700  # a CSV recording above 1 MB, the size from which Snakemake goes by the time of a file


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a copy of the program and of a study, run: three models, two subjects and one to come."""
    folder = tmp_path_factory.mktemp("reruns") / "base"
    program = copy_of_the_program(folder / "the program")
    study = folder / "study"
    for subject in ("01", "02"):
        record(study / f"{subject}.csv", subject=subject, frames=FRAMES)
    (study / "corrections.tsv").write_text(CORRECTIONS.format(1))
    head = "description: a model of this study\nown_cmc: [thumb_cmc]\n"
    (study / f"{PLAIN}.yaml").write_text(f"model: {PLAIN}\n{head}")
    (study / f"{CORRECTED}.yaml").write_text(f"model: {CORRECTED}\n{head}planes: {{corrections: true}}\n")
    for name in (FITTED, "another"):
        (study / f"{name}.yaml").write_text(
            f"model: {name}\ndescription: a short fit\njoints: {{solver: anatomical, calibration: all}}\n"
            "planes: {cut: false}\nfit: {whole_hand: true, frames: 40, steps: 1}\n"
            "metacarpals: {unmeasured: fitted, measured: fitted}\n"
        )
    models = [f"{PLAIN}.yaml", f"{CORRECTED}.yaml", f"{FITTED}.yaml"]
    written = write_study(study, "twice", ROWS, models, corrections="corrections.tsv")
    StudyRun(written.file, written.folder, program).run()
    return folder


@pytest.fixture
def study(base: Path, tmp_path: Path) -> StudyRun:
    """A copy of the base study, times of files kept, with a program of its own."""
    shutil.copytree(base, tmp_path / "copy", symlinks=True)
    folder = tmp_path / "copy" / "study"
    return StudyRun(folder / "twice.yaml", folder, tmp_path / "copy" / "the program")


@pytest.fixture
def unchanged(base: Path) -> StudyRun:
    """The base study itself, for tests that change nothing in it."""
    return StudyRun(base / "study" / "twice.yaml", base / "study", base / "the program")


def _rules(jobs: set[Job]) -> set[str]:
    return {job.rule for job in jobs}


def _subjects(jobs: set[Job]) -> set[str]:
    return {job.subject for job in jobs if job.subject is not None}


def _edit(file: Path, change: Callable[[str], str]) -> None:
    before = file.read_text("utf-8")
    after = change(before)
    assert after != before
    file.write_text(after, "utf-8")


def _after(text: str) -> Callable[[str], str]:
    return lambda before: f"{before}\n{text}\n"


def _tables(study: StudyRun, subject: str) -> list[str]:
    """Every table of a subject, below the results folder."""
    folder = study.results.subject(subject)
    return sorted(path.relative_to(study.results.folder).as_posix() for path in folder.rglob("*.parquet"))


# --- nothing to do ----------------------------------------------------------------------------------------


def test_a_second_run_does_nothing(unchanged: StudyRun) -> None:
    assert unchanged.planned() == set()
    assert "Nothing to be done" in unchanged.run()


def test_the_same_study_from_another_folder_does_nothing(study: StudyRun) -> None:
    moved = study.folder.rename(study.folder.with_name("renamed"))
    assert StudyRun(moved / "twice.yaml", moved, study.repository).planned() == set()


def test_a_comment_in_a_module_reruns_nothing(study: StudyRun) -> None:
    for module in ("stages/solve_joints/solve.py", "skeleton/rotations.py", "schemas/tables.py"):
        _edit(study.repository / module, _after("# said again"))
    assert study.planned() == set()


def test_the_recorders_live_view_reruns_nothing(study: StudyRun) -> None:
    _edit(study.repository / "trackers/record/display.py", _after("MORE = 1"))
    assert study.planned() == set()


# --- tables as targets ------------------------------------------------------------------------------------


def test_every_table_is_declared(unchanged: StudyRun) -> None:
    """What lies in the results folder is what `--summary` lists: nothing is hidden from Snakemake."""
    done = unchanged.snakemake("--summary")
    assert done.returncode == 0, done.stderr
    listed = {line.split("\t")[0] for line in done.stdout.splitlines()[1:]}
    tables = {
        path.relative_to(unchanged.folder).as_posix() for path in unchanged.results.folder.rglob("*.parquet")
    }
    assert tables <= listed
    subject = unchanged.results.subject("01")
    names = [path.name for path in subject.rglob("*.parquet")]
    assert sorted(names) == sorted(
        f"{name}.parquet" for name in ("poses", *SUBJECT_TABLES, *PRIOR_TABLES, *FIT_TABLES)
    )


@pytest.mark.parametrize(
    ("table", "rules"),
    [
        ("sub-01/right/rom/poses.parquet", {"capture"}),
        ("sub-01/joint_solutions.parquet", {"plan", "capture", "solve_joints"} | CHECKED),
        (f"sub-01/fits/right/{FITTED}/receivers.parquet", {"plan_fit", "capture", "fit_hand"} | CHECKED),
        (
            "sub-01/tips.parquet",
            {"plan", "plan_fit", "capture", "solve_joints", "project_planes", "fit_hand"}
            | {"estimate_metacarpals", "evaluate_tips"}
            | CHECKED,
        ),
    ],
)
def test_a_table_asked_for_is_made_with_what_it_needs(study: StudyRun, table: str, rules: set[str]) -> None:
    shutil.rmtree(study.results.folder)
    jobs = study.planned(f"results/twice/{table}")
    assert _rules(jobs) == rules
    assert _subjects(jobs) == {"01"}
    assert _rules(study.planned("--until", f"results/twice/{table}")) >= rules


@pytest.mark.parametrize("table", STUDY_TABLES)
def test_a_table_of_the_study_can_be_asked_for(study: StudyRun, table: str) -> None:
    path = study.results.study_table(table)
    path.unlink()
    assert _rules(study.planned(path.relative_to(study.folder).as_posix())) == {"gather"}


def test_a_removed_table_is_made_again_and_nothing_twice(study: StudyRun) -> None:
    before = hashes(study.results.folder)
    removed = "sub-01/joint_centres.parquet"
    (study.results.folder / removed).unlink()
    assert "estimate_metacarpals" in _rules(study.planned())
    assert _subjects(study.planned()) == {"01"}
    study.run()
    assert hashes(study.results.folder) == before
    assert study.planned() == set()


# --- tables that are not what they should be --------------------------------------------------------------


def _refused(study: StudyRun, table: str, reason: str) -> None:
    """A run names the table and what is wrong; once it is removed, a run puts the study right."""
    done = study.snakemake()
    assert done.returncode != 0
    assert f"results/twice/{table}: " in done.stderr
    assert reason in done.stderr
    assert "Traceback" not in done.stderr
    (study.results.folder / table).unlink()
    study.run()
    assert study.planned() == set()


@pytest.mark.parametrize("table", ["sub-01/right/rom/poses.parquet", "sub-01/joint_solutions.parquet"])
def test_junk_in_a_table_is_noticed(study: StudyRun, table: str) -> None:
    before = hashes(study.results.folder)
    (study.results.folder / table).write_bytes(b"junk")
    _refused(study, table, "not a readable Parquet file")
    assert hashes(study.results.folder) == before


@pytest.mark.parametrize(
    "table",
    ["right/rom/poses.parquet", "joint_centres.parquet", f"fits/right/{FITTED}/fitted_joints.parquet"],
)
def test_anothers_table_is_noticed(study: StudyRun, table: str) -> None:
    folder = study.results.folder
    shutil.copyfile(folder / "sub-02" / table, folder / "sub-01" / table)
    _refused(study, f"sub-01/{table}", "subject 0")


def test_a_table_of_an_older_version_is_noticed(study: StudyRun) -> None:
    table = "sub-01/projected_joints.parquet"
    _age(study.results.folder / table)
    _refused(study, table, "version 0; this program reads version")


def _age(path: Path) -> None:
    """Write the table as a program before this one would have."""
    table = pq.read_table(path)
    metadata = json.loads(table.schema.metadata[b"shukotsu"]) | {"schema_version": 0}
    parts = pq.read_metadata(path).metadata[b"shukotsu_parts"]
    aged = {b"shukotsu": json.dumps(metadata).encode(), b"shukotsu_parts": parts}
    pq.write_table(table.replace_schema_metadata(aged), path)


# --- what changed in the study ----------------------------------------------------------------------------


def test_a_changed_recording_runs_its_subject_only(study: StudyRun) -> None:
    """Run for real: the other's tables keep their bytes, and then nothing is left to do."""
    before = hashes(study.results.folder)
    record(study.folder / "01.csv", subject="01", frames=FRAMES - 20)
    jobs = study.planned()
    assert _rules(jobs) == EVERYTHING
    assert _subjects(jobs) == {"01"}
    study.run()
    after = hashes(study.results.folder)
    changed = {name for name in after if after[name] != before[name]}
    assert changed >= {"report.html", "tip_errors.parquet", "sub-01/right/rom/poses.parquet"}
    assert not [name for name in changed if "sub-02" in name]
    assert study.planned() == set()


def test_a_touched_recording_runs_its_subject_only(study: StudyRun) -> None:
    recording = study.folder / "01.csv"
    assert recording.stat().st_size > 1_000_000
    os.utime(recording)
    assert _subjects(study.planned()) == {"01"}


def test_another_hand_leaves_the_first_ones_fit(study: StudyRun) -> None:
    record(study.folder / "01-left.csv", subject="01", hand="left", frames=FRAMES)
    _edit(study.folder / "twice.tsv", lambda text: f"{text}01\tleft\trom\tboth\t01-left.csv\n")
    jobs = study.planned()
    assert _subjects(jobs) == {"01"}
    assert {job.about for job in jobs if job.rule == "capture"} == {"subject 01, left hand, rom"}


def test_one_model_more_fits_that_model_only(study: StudyRun) -> None:
    """The cheap stages of each subject run again; no recording is imported, and no other hand fitted."""
    fits = study.results.folder / "sub-01" / "fits" / "right" / FITTED
    before = {path: path.stat().st_mtime_ns for path in fits.iterdir()}
    _edit(study.file, lambda text: text.replace("models: [", "models: [another.yaml, "))
    jobs = study.planned()
    assert {job.about for job in jobs if job.rule == "fit_hand"} == {
        f"subject {subject}, right hand, model another" for subject in ("01", "02", "late")
    }
    assert "capture" not in _rules(jobs)
    study.run()
    assert {path: path.stat().st_mtime_ns for path in fits.iterdir()} == before
    assert {row["model"] for row in study.rows("receivers")} == {FITTED, "another"}
    assert study.planned() == set()


def test_a_changed_model_file_fits_that_model_only(study: StudyRun) -> None:
    _edit(study.folder / f"{PLAIN}.yaml", _after("joints: {singular_values: 6}"))
    jobs = study.planned()
    assert not _rules(jobs) & {"capture", "fit_hand"}
    _edit(study.folder / f"{FITTED}.yaml", lambda text: text.replace("frames: 40", "frames: 41"))
    assert len([job for job in study.planned() if job.rule == "fit_hand"]) == 3


def test_changed_corrections_run_whom_they_correct(study: StudyRun) -> None:
    (study.folder / "corrections.tsv").write_text(CORRECTIONS.format(2))
    jobs = study.planned()
    assert _subjects(jobs) == {"01"}
    assert not _rules(jobs) & {"capture", "fit_hand"}


def test_one_subject_more_runs_that_subject_only(study: StudyRun) -> None:
    shutil.copy(study.folder / "02.csv", study.folder / "03.csv")
    _edit(study.folder / "twice.tsv", lambda text: f"{text}03\tright\trom\tboth\t03.csv\n")
    jobs = study.planned()
    assert _rules(jobs) == {"plan", "plan_fit", "plan_check", *EVERYTHING}
    assert _subjects(jobs) == {"03"}


def test_a_recording_that_came_late_is_captured(study: StudyRun) -> None:
    """A missing file has a row that says so, until it is there."""
    assert study.rows_where("recordings", subject="late")[0]["status"] == "failed"
    shutil.copy(study.folder / "02.csv", study.folder / "late.csv")
    jobs = study.planned()
    assert _rules(jobs) == EVERYTHING
    assert _subjects(jobs) == {"late"}


# --- what changed in the program --------------------------------------------------------------------------


def test_code_of_a_stage_reruns_it_and_what_depends_on_it(study: StudyRun) -> None:
    _edit(study.repository / "stages/project_planes/plane.py", _after("MORE = 1"))
    jobs = study.planned()
    assert _rules(jobs) == {*AFTER_SOLVING, *AT_THE_END}
    assert _subjects(jobs) == {"01", "02", "late"}


def test_code_that_a_stage_imports_reruns_it(study: StudyRun) -> None:
    """Chains of digits are not the captures' business."""
    _edit(study.repository / "skeleton/digit_chain.py", _after("MORE = 1"))
    rules = _rules(study.planned())
    assert "evaluate_tips" in rules
    assert "capture" not in rules


def test_code_of_the_report_reruns_the_report_only(study: StudyRun) -> None:
    _edit(study.repository / "stages/report/base.html.j2", _after("<!-- more -->"))
    assert _rules(study.planned()) == {"report", "subject_pages", "print_figures"}


# --- Snakemake's own options ------------------------------------------------------------------------------


def test_forcerun_does_a_rule_again(study: StudyRun) -> None:
    jobs = study.planned("--forcerun", "project_planes")
    assert _rules(jobs) == {*AFTER_SOLVING, *AT_THE_END}


def test_until_a_rule_stops_there(study: StudyRun) -> None:
    shutil.rmtree(study.results.folder)
    done = study.snakemake("--until", "solve_joints")
    assert done.returncode == 0, done.stderr
    names = {path.name for path in study.results.folder.rglob("*.parquet")}
    assert names == {"poses.parquet", "findings.parquet", "joint_solutions.parquet"}


def test_delete_all_output_leaves_no_result(study: StudyRun) -> None:
    done = study.snakemake("--delete-all-output")
    assert done.returncode == 0, done.stderr
    assert not hashes(study.results.folder)


def test_report_of_the_workflow(unchanged: StudyRun, tmp_path: Path) -> None:
    """With what `make demo` installs: the report's own dependencies are in the lock."""
    done = unchanged.snakemake("--report", str(tmp_path / "workflow.html"))
    assert done.returncode == 0, done.stderr
    assert "solve_joints" in (tmp_path / "workflow.html").read_text("utf-8")


def test_plans_say_what_the_study_says(unchanged: StudyRun) -> None:
    plan = read_plan(unchanged.results.plan("01"))
    assert plan.subject == "01"
    assert list(plan.models) == [PLAIN, CORRECTED, FITTED]
    assert [row["joint"] for row in plan.corrections] == ["ring_dip"]
