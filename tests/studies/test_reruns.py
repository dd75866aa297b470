"""What is run again after a change, as Snakemake decides: nothing is hidden from it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from studies.running import Job, StudyRun, copy_of_the_program, hashes, record, write_study

from shukotsu.schemas.results import FIT_TABLES, SUBJECT_TABLES

pytestmark = pytest.mark.slow

PLAIN, CORRECTED, FITTED = "plain", "corrected", "fitted"
ROWS = ["01\tright\trom\tboth\t01.csv", "02\tright\trom\tboth\t02.csv", "late\tright\trom\tboth\tlate.csv"]
CORRECTIONS = "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t{}\t0\t0\n"
AFTER_CAPTURE = {"check_recordings", "align_events", "solve_joints"}
AFTER_CAPTURE |= {"fit_hand"}
AFTER_SOLVING = {
    "project_planes",
    "estimate_metacarpals",
    "evaluate_tips",
    "evaluate_skeletons",
    "measure_movement",
}
AT_THE_END = {"gather", "compare_models", "compare_movement", "report", "subject_pages", "print_figures"}
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
            f"model: {name}\ndescription: a short fit\njoints: {{calibration: all}}\n"
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


# --- nothing to do ----------------------------------------------------------------------------------------


def test_a_second_run_does_nothing(unchanged: StudyRun) -> None:
    assert unchanged.planned() == set()
    assert "Nothing to be done" in unchanged.run()


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
        f"{name}.parquet" for name in ("poses", *SUBJECT_TABLES, *FIT_TABLES, *FIT_TABLES)
    ), "of the fitted model, and of the hand that anatomy expects"


@pytest.mark.parametrize(
    ("table", "rules"),
    [
        ("sub-01/right/rom/poses.parquet", {"capture"}),
        ("sub-01/joint_solutions.parquet", {"plan", "capture", "check_recordings", "solve_joints"}),
        (
            f"sub-01/fits/right/{FITTED}/receivers.parquet",
            {"plan", "capture", "check_recordings", "fit_hand"},
        ),
        (
            "sub-01/tips.parquet",
            {"plan", "capture", "solve_joints", "project_planes", "fit_hand"}
            | {"check_recordings", "estimate_metacarpals", "evaluate_tips"},
        ),
    ],
)
def test_a_table_asked_for_is_made_with_what_it_needs(study: StudyRun, table: str, rules: set[str]) -> None:
    shutil.rmtree(study.results.folder)
    jobs = study.planned(f"results/twice/{table}")
    assert _rules(jobs) == rules
    assert _subjects(jobs) == {"01"}
    assert _rules(study.planned("--until", f"results/twice/{table}")) >= rules


def test_a_removed_table_is_made_again_and_nothing_twice(study: StudyRun) -> None:
    before = hashes(study.results.folder)
    removed = "sub-01/joint_centres.parquet"
    (study.results.folder / removed).unlink()
    assert "estimate_metacarpals" in _rules(study.planned())
    assert _subjects(study.planned()) == {"01"}
    study.run()
    assert hashes(study.results.folder) == before
    assert study.planned() == set()


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


def test_one_model_more_fits_that_model_only(study: StudyRun) -> None:
    """The cheap stages of each subject run again; no recording is imported, and no other hand fitted."""
    fits = study.results.folder / "sub-01" / "fits" / "right" / FITTED
    before = {path: path.stat().st_mtime_ns for path in fits.iterdir()}
    _edit(study.file, lambda text: text.replace("models: [", "models: [another.yaml, "))
    jobs = study.planned()
    assert {job.about for job in jobs if job.rule == "fit_hand"} == {
        f"subject {subject}, right hand, model another" for subject in ("01", "02", "late")
    }
    assert not _rules(jobs) & {"capture", "check_recordings", "align_events"}
    study.run()
    assert {path: path.stat().st_mtime_ns for path in fits.iterdir()} == before
    assert {row["model"] for row in study.rows("receivers")} == {FITTED, "another"}
    assert study.planned() == set()


def test_changed_corrections_run_whom_they_correct(study: StudyRun) -> None:
    (study.folder / "corrections.tsv").write_text(CORRECTIONS.format(2))
    jobs = study.planned()
    assert _subjects(jobs) == {"01"}
    assert _rules(jobs) >= {"project_planes", *AT_THE_END}
    assert not _rules(jobs) & {"capture", "fit_hand"}


def test_one_subject_more_runs_that_subject_only(study: StudyRun) -> None:
    shutil.copy(study.folder / "02.csv", study.folder / "03.csv")
    _edit(study.folder / "twice.tsv", lambda text: f"{text}03\tright\trom\tboth\t03.csv\n")
    jobs = study.planned()
    assert _rules(jobs) == {"plan", *EVERYTHING}
    assert _subjects(jobs) == {"03"}


def test_a_recording_that_came_late_is_captured(study: StudyRun) -> None:
    """A missing file has a row that says so, until it is there."""
    assert study.rows_where("recordings", subject="late")[0]["status"] == "failed"
    shutil.copy(study.folder / "02.csv", study.folder / "late.csv")
    jobs = study.planned()
    assert _rules(jobs) == EVERYTHING
    assert _subjects(jobs) == {"late"}


# --- what changed in the program --------------------------------------------------------------------------


def test_another_state_of_the_program_reruns_all_but_the_plans(study: StudyRun) -> None:
    _edit(study.repository / "stages/project_planes/plane.py", lambda before: f"{before}\nassert True\n")
    jobs = study.planned()
    assert _rules(jobs) == EVERYTHING
    assert _subjects(jobs) == {"01", "02", "late"}


# --- Snakemake's own options ------------------------------------------------------------------------------


def test_report_of_the_workflow(unchanged: StudyRun, tmp_path: Path) -> None:
    """With what `make demo` installs: the report's own dependencies are in the lock."""
    done = unchanged.snakemake("--report", str(tmp_path / "workflow.html"))
    assert done.returncode == 0, done.stderr
    assert "solve_joints" in (tmp_path / "workflow.html").read_text("utf-8")
