"""A bug in the check and the pages of one subject: the study ends, its report names both."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.running import StudyRun, copy_of_the_program, record, write_study

pytestmark = pytest.mark.slow

PLANTED = {
    "check_recordings/__main__.py": (
        "return command_line.checked_poses(",
        'assert recording.hand.subject != "02", "planted"; return command_line.checked_poses(',
    ),
    "report/subject.py": (
        "results = read_subject(read_plan(arguments.plan))",
        'results = read_subject(read_plan(arguments.plan)); assert results.subjects != ["02"], "planted"',
    ),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Two subjects, run by a program that fails on the second; Snakemake ended with exit code 0."""
    folder = tmp_path_factory.mktemp("bug")
    repository = copy_of_the_program(folder / "program")
    for module, (sound, planted) in PLANTED.items():
        path = repository / "stages" / module
        text = path.read_text("utf-8")
        assert text.count(sound) == 1
        path.write_text(text.replace(sound, planted), "utf-8")
    for subject in ("01", "02"):
        record(folder / f"{subject}.parquet", subject=subject)
    rows = [f"{subject}\tright\trom\tboth\t{subject}.parquet" for subject in ("01", "02")]
    made = write_study(folder, "buggy", rows, ["paper-fig4"])
    run = StudyRun(made.file, made.folder, repository)
    run.run()
    return run


def sentence(stage: str) -> str:
    return f"internal error in {stage} (AssertionError: planted); please report it with the log"


def test_the_check_that_failed_is_a_problem_of_its_subject_and_accuses_nobody(study: StudyRun) -> None:
    (problem,) = study.rows("problems")
    assert (problem["subject"], problem["stage"], problem["severity"]) == ("02", "check_recordings", "note")
    assert sentence("check_recordings") in problem["message"]
    assert sentence("check_recordings") in study.page()
    assert {row["subject"] for row in study.rows("tip_errors")} == {"01", "02"}


def test_the_page_that_failed_says_so_and_so_does_the_report(study: StudyRun) -> None:
    assert sentence("report.subject") in study.page()
    for page in ("subject.html", "right/rom.html"):
        text = (study.results.subject_pages("02") / page).read_text("utf-8")
        assert sentence("report.subject") in text
        assert "planted" not in (study.results.subject_pages("01") / page).read_text("utf-8")


def test_the_log_has_all_of_it(study: StudyRun) -> None:
    for stage in ("check_recordings", "subject_pages"):
        log: Path = study.results.folder / "logs" / stage / "sub-02.log"
        assert "Traceback (most recent call last)" in log.read_text("utf-8")
