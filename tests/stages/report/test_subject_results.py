"""A subject's results: the same rows as the study's, read from its hands' own tables."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from report_samples.hand_tables import write_hand_tables
from report_samples.made_study import HOSTILE, make_study
from report_samples.read_page import read_page
from report_samples.rendered import OF_A_SUBJECT, of_subject

from schemas.catalogue import JOINT_CENTRES
from schemas.errors import InputError
from schemas.results import Results
from schemas.study import Hand, read_study
from schemas.tables import Provenance, write_failure
from stages import command_line
from stages.report.study_results import read_results, read_subject
from stages.report.subject import build_parser, pages, record_failure


@pytest.fixture
def apart(tmp_path: Path) -> tuple[Path, Path]:
    """A made-up study whose hands have tables of their own."""
    study, folder = make_study(tmp_path, n_frames=4, models=("paper-fig4", "whole-hand"))
    write_hand_tables(read_study(study), Results(folder))
    return study, folder


def test_hands_tables_make_the_same_results(apart: tuple[Path, Path]) -> None:
    """Row for row what the study-wide tables have of the subject; the made-up ones are in another order."""
    study, folder = read_study(apart[0]), apart[1]
    whole, own = of_subject(read_results(study, folder), "S01"), read_subject(study, folder, "S01")
    for name in set(OF_A_SUBJECT) - {"problems", "recordings"}:
        assert sorted(map(repr, getattr(own, name))) == sorted(map(repr, getattr(whole, name))), name
    assert own.subjects == ["S01"]


def test_a_failed_table_is_told_and_the_rest_is_shown(apart: tuple[Path, Path]) -> None:
    study, folder = read_study(apart[0]), apart[1]
    path = Results(folder).hand_table("paper-fig4", Hand("S01", "left"), "joint_centres")
    write_failure(path, JOINT_CENTRES, "no frame was valid", Provenance())
    own = read_subject(study, folder, "S01")
    assert [(p["where"], p["message"]) for p in own.problems if "no frame" in p["message"]] == [
        ("subject S01, left hand, model paper-fig4", "no frame was valid")
    ]
    assert own.joints_of[Hand("S01", "right"), "paper-fig4"]
    assert (Hand("S01", "left"), "paper-fig4") not in own.joints_of


def test_no_such_subject(apart: tuple[Path, Path]) -> None:
    with pytest.raises(InputError, match="has no subject 'S02'; expected one of S01"):
        read_subject(read_study(apart[0]), apart[1], "S02")


@pytest.mark.parametrize("subject", ["S01", HOSTILE])
def test_command_line_writes_the_pages(apart: tuple[Path, Path], tmp_path: Path, subject: str) -> None:
    """The subject's page and one of each evaluated recording, the same bytes each time."""
    study, folder = apart
    written = []
    for name in ("first", "second"):
        out = tmp_path / name
        words = ["--study", str(study), "--results", str(folder), "--subject", subject, "--out", str(out)]
        assert command_line.run(build_parser().parse_args(words), pages, record_failure) == 0
        written.append({p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()})
    assert written[0] == written[1]
    assert set(written[0]) == {"subject.html", "right/opposition.html", "left/opposition.html"}
    text = read_page(written[0]["subject.html"].decode("utf-8")).text
    assert f"Subject {subject}" in text


def test_a_failure_is_a_page(apart: tuple[Path, Path], tmp_path: Path) -> None:
    """With --record-failure a page says why there is none; without, one sentence and exit code 2."""
    words = [
        "--study",
        str(apart[0]),
        "--results",
        str(apart[1]),
        "--subject",
        "nobody",
        "--out",
        str(tmp_path),
    ]
    parsed = build_parser().parse_args(words)
    assert command_line.run(parsed, pages, record_failure) == 2
    parsed = build_parser().parse_args([*words, "--record-failure"])
    assert command_line.run(parsed, pages, record_failure) == 0
    assert "has no subject &#39;nobody&#39;" in (tmp_path / "subject.html").read_text("utf-8")


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys, stages.report.subject as m; m.build_parser().format_help();"
        "print({'numpy', 'pyarrow', 'jinja2'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
