"""A subject's results: the same rows as the study's, read from the subject's own tables; its pages."""

from __future__ import annotations

from pathlib import Path

import pytest
from report_samples.hand_tables import part_of, write_subject_tables
from report_samples.made_study import HOSTILE, make_study
from report_samples.pages import read_page
from stage_runs import subject_pages

from shukotsu.errors import InputError
from shukotsu.report.study_results import StudyResults, read_subject
from shukotsu.study.plan import read_plan
from shukotsu.study.results import Results
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.parts import parts_writer
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, columns_from_rows


@pytest.fixture
def made_tables(tmp_path: Path) -> tuple[Path, Results]:
    """The file and results of a made-up study whose subjects have plans and tables of their own."""
    study, folder = make_study(tmp_path, n_frames=4, models=("paper-fig4", "whole-hand"))
    write_subject_tables(read_study(study), Results(folder))
    return study, Results(folder)


def _subject(results: Results, subject: str = "S01") -> StudyResults:
    return read_subject(read_plan(results.plan(subject)))


def test_a_failed_part_is_told_and_the_rest_is_shown(made_tables: tuple[Path, Results]) -> None:
    _, results = made_tables
    right, left = Hand("S01", "right"), Hand("S01", "left")
    row = _subject(results).joints_of[right, "paper-fig4"][0]
    path = results.subject("S01") / "joint_centres.parquet"
    with parts_writer(path, JOINT_CENTRES, Provenance()) as writer:
        writer.columns(part_of(right, "paper-fig4"), columns_from_rows(JOINT_CENTRES, [row]))
        writer.failure(part_of(left, "paper-fig4"), "no frame was valid")
    own = _subject(results)
    (problem,) = [p for p in own.problems if p["message"] == "no frame was valid"]
    assert (problem["hand"], problem["model"], problem["stage"]) == (
        "left",
        "paper-fig4",
        "estimate_metacarpals",
    )
    assert own.joints_of == {(right, "paper-fig4"): [row]}
    path.unlink()
    with pytest.raises(InputError, match="joint_centres"):
        _subject(results)


@pytest.mark.parametrize("subject", ["S01", HOSTILE])
def test_command_line_writes_the_pages(
    made_tables: tuple[Path, Results], tmp_path: Path, subject: str
) -> None:
    """The subject's page and one of each evaluated recording, the same bytes; or one recording's."""
    written = []
    for name in ("first", "second"):
        out = tmp_path / name
        argv = ["--plan", str(made_tables[1].plan(subject)), "--out", str(out)]
        assert subject_pages(argv) == 0
        written.append({p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()})
    assert written[0] == written[1]
    assert set(written[0]) == {"subject.html", "right/opposition.html", "left/opposition.html"}
    text = read_page(written[0]["subject.html"].decode("utf-8")).text
    assert f"Subject {subject}" in text
    argv = [*argv[:2], "--out", str(tmp_path / "one"), "--recording", "right", "opposition"]
    assert subject_pages(argv) == 0
    (page,) = (tmp_path / "one").rglob("*.html")
    assert page.read_bytes() == written[0]["right/opposition.html"]


@pytest.mark.parametrize(
    ("plan", "more", "message"),
    [
        ("nothing.json", [], "nothing.json: no such file"),
        ("", ["--recording", "right", "rom"], "rom: is not evaluated; expected one of: right opposition"),
    ],
)
def test_a_failure_is_a_sentence_or_a_page(
    made_tables: tuple[Path, Results],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    plan: str,
    more: list[str],
    message: str,
) -> None:
    """Without --record-failure one sentence and exit code 2, with it a page."""
    file = tmp_path / plan if plan else made_tables[1].plan("S01")
    argv = ["--plan", str(file), "--out", str(tmp_path / "out"), *more]
    assert subject_pages(argv) == 2
    assert message in capsys.readouterr().err
    argv.append("--record-failure")
    assert subject_pages(argv) == 0
    assert message in (tmp_path / "out" / "subject.html").read_text("utf-8")
