"""What is run again after a change, as Snakemake decides: nothing is hidden from it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from studies.running import Job, StudyRun, copy_of_the_program, hashes, record, write_study

from shukotsu.study.results import FIT_TABLES, SUBJECT_TABLES

pytestmark = pytest.mark.slow

PLAIN, CORRECTED, FITTED = "plain", "corrected", "fitted"
ROWS = ["01\tright\trom\tboth\t01.csv", "02\tright\trom\tboth\t02.csv", "late\tright\trom\tboth\tlate.csv"]
CORRECTIONS = "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t1\t0\t0\n"
EVERYTHING = {"capture", "check_recordings", "align_events", "solve_joints", "fit_hand", "project_planes"}
EVERYTHING |= {"estimate_metacarpals", "evaluate_tips", "evaluate_skeletons", "measure_movement", "gather"}
EVERYTHING |= {"compare_models", "compare_movement", "report", "subject_pages", "print_figures"}
FRAMES = 700  # a CSV recording above 1 MB, the size from which Snakemake goes by the time of a file


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a copy of the program and of a study, run: three models, two subjects and one to come."""
    folder = tmp_path_factory.mktemp("reruns") / "base"
    program = copy_of_the_program(folder / "the program")
    study = folder / "study"
    for subject in ("01", "02"):
        record(study / f"{subject}.csv", subject=subject, frames=FRAMES)
    (study / "corrections.tsv").write_text(CORRECTIONS)
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


def test_a_second_run_does_nothing(unchanged: StudyRun) -> None:
    assert unchanged.planned() == set()
    assert "Nothing to be done" in unchanged.run()


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


def test_another_state_of_the_program_reruns_all_but_the_plans(study: StudyRun) -> None:
    _edit(study.repository / "shukotsu/paper/plane.py", lambda before: f"{before}\nassert True\n")
    jobs = study.planned()
    assert _rules(jobs) == EVERYTHING
    assert _subjects(jobs) == {"01", "02", "late"}


@pytest.mark.parametrize("memory", [True, False])
def test_a_copy_makes_nothing_again(base: Path, tmp_path: Path, memory: bool) -> None:
    """Also in a folder at another depth, with other times."""
    leave = None if memory else shutil.ignore_patterns(".snakemake")
    folder = tmp_path / "deeper" / "copy"
    shutil.copytree(base, folder, ignore=leave, copy_function=shutil.copyfile)
    assert StudyRun(folder / "study/twice.yaml", folder / "study", folder / "the program").planned() == set()


def test_what_no_run_left_so_is_made_anew(study: StudyRun) -> None:
    """Cut with its time kept, removed, or of unknown origin: to the same bytes, and nothing is left."""
    before = hashes(study.results.folder)
    for name in ("report.html", "sub-01/plan.json", "sub-01/findings.parquet", "sub-02/tips.parquet"):
        file = study.results.folder / name
        state = file.stat()
        os.truncate(file, state.st_size // 2)
        os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    (study.results.folder / "sub-01/joint_centres.parquet").unlink()
    rules = _rules(study.planned())
    assert {"check_recordings", "estimate_metacarpals", "evaluate_tips", "gather", "report"} <= rules
    assert study.planned("results/twice/sub-01/right/rom/poses.parquet") == set(), "and no other target"
    assert "note: not as a run left them, and made anew: " in study.run()
    assert hashes(study.results.folder) == before
    assert study.planned() == set()
    (study.results.folder / "logs" / "made_from.json").unlink()
    assert study.planned() == set()
    shutil.rmtree(study.folder / ".snakemake")
    assert {"capture", "solve_joints", "report"} <= _rules(study.planned()), "nothing says what made them"


def test_report_of_the_workflow(unchanged: StudyRun, tmp_path: Path) -> None:
    """With what `make demo` installs: the report's own dependencies are in the lock."""
    done = unchanged.snakemake("--report", str(tmp_path / "workflow.html"))
    assert done.returncode == 0, done.stderr
    assert "solve_joints" in (tmp_path / "workflow.html").read_text("utf-8")
