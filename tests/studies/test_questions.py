"""A study that asks: each question is answered, and dated by its first run, whatever runs again."""

from __future__ import annotations

import pytest
from studies.running import StudyRun, record, write_study

from shukotsu.commands.plan_study import main

pytestmark = pytest.mark.slow

SUBJECTS = [f"P{number}" for number in range(8)]
ASKED = "  - {name: PIP, quantity: range_deg, joint: index_pip, angle: flexion, factor: group}\n"
LATER = "  - {name: reach, quantity: path_length_mm, digit: index, covariate: years}\n"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Eight subjects in two groups, with one question."""
    folder = tmp_path_factory.mktemp("asking")
    rows = []
    for subject in SUBJECTS:
        record(folder / f"{subject}.parquet", subject=subject)
        rows.append(f"{subject}\tright\trom\tboth\t{subject}.parquet\t")
    people = ["subject\tgroup\tyears", *(f"{s}\t{'AB'[i % 2]}\t{3 * i}" for i, s in enumerate(SUBJECTS))]
    (folder / "people.tsv").write_text("\n".join(people) + "\n", "utf-8")
    made = write_study(folder, "asking", rows, ["rigid"], participants="people.tsv", questions=f"\n{ASKED}")
    made.run()
    return made


def test_a_question_is_dated_by_its_first_run(study: StudyRun) -> None:
    """It is answered in the report; one that is added when there are results is said to be; none is lost."""
    (first,) = study.rows("questions")
    assert (first["asked_after_results"], first["n"], first["n_other"], first["model"]) == (
        False,
        4,
        4,
        "rigid",
    )
    assert "PIP:" in study.page()
    assert not study.planned()
    study.file.write_text(study.file.read_text("utf-8") + LATER, "utf-8")
    planned = study.planned()
    assert {"record_questions", "compare_movement", "report"} <= {job.rule for job in planned}
    assert not any(job.subject for job in planned)
    study.run()
    again, later = study.rows("questions")
    assert again["first_asked"] == first["first_asked"]
    assert (later["question"], later["asked_after_results"]) == ("reach", True)
    assert later["first_asked"] > first["first_asked"]
    assert "after results" in study.page()
    asked = study.results.questions_asked.read_bytes()
    done = study.snakemake("--forcerun", "record_questions")
    assert done.returncode == 0, done.stderr
    assert study.results.questions_asked.read_bytes() == asked
    assert not study.planned()


def test_the_study_says_how_many_subjects_would_answer(
    study: StudyRun, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(study.folder)
    asked = [str(study.file), "--question", "PIP", "--difference", "40"]
    assert main([*asked, "--subjects", "5", "20", "--figure", "power.svg"]) == 0
    few, many = (int(line.split()[-1]) for line in capsys.readouterr().out.splitlines()[2:4])
    assert few <= many
    assert many > 90
    assert "<svg" in (study.folder / "power.svg").read_text("utf-8")
    assert main([str(study.file), "--question", "nobody"]) == 2
    assert "'nobody'; it has PIP" in capsys.readouterr().err
