"""`shukotsu new`: a folder whose study reads once its rows are filled in; nothing is written over."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from shukotsu.check_file import main as check
from shukotsu.new_study import main as new
from stages.report.print_figures import style

ROW = "P1\tright\trom\tboth\trom.csv\n"


@pytest.mark.parametrize("language", ["en", "ja"])
def test_a_new_study_reads_when_a_row_is_written(
    tmp_path: Path, language: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(style, "font_of", lambda _: Path("installed.ttf"))
    monkeypatch.chdir(tmp_path)
    assert new(["piano", "--language", language]) == 0
    assert "next: write a row a recording into piano/recordings.tsv" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path / "piano")
    assert check([]) == 2
    assert "add a row a recording" in capsys.readouterr().err
    with Path("recordings.tsv").open("a") as file:
        file.write(ROW)
    assert check([]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first == "study.yaml: study piano, 1 subjects, 1 recordings, 3 models"


def test_a_new_study_in_japanese_is_refused_without_a_font(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(style, "font_of", lambda _: None)
    monkeypatch.chdir(tmp_path)
    new([".", "--language", "ja"])
    with Path("recordings.tsv").open("a") as file:
        file.write(ROW)
    assert check([]) == 2
    assert "language: ja: its figures need a font" in capsys.readouterr().err


def test_both_languages_say_the_same_of_a_study(tmp_path: Path) -> None:
    configs = []
    for language in ("en", "ja"):
        new([str(tmp_path / language / "piano"), "--language", language])
        text = (tmp_path / language / "piano" / "study.yaml").read_text("utf-8")
        configs.append(yaml.safe_load(text))
    assert configs[1].pop("language") == "ja"
    assert configs[0] == configs[1]


def test_a_row_is_begun_for_every_recording(tmp_path: Path) -> None:
    (tmp_path / "old" / "day 1").mkdir(parents=True)
    for name in ("day 1/rom.csv", "b.arrows", "notes.md", "c.C3D"):
        (tmp_path / "old" / name).touch()
    (tmp_path / "old" / "pipe.csv").mkdir()
    assert new([str(tmp_path / "piano"), "--recordings", str(tmp_path / "old")]) == 0
    rows = (tmp_path / "piano" / "recordings.tsv").read_text().splitlines()
    assert rows[0].split("\t") == ["subject", "hand", "task", "role", "file"]
    old = tmp_path / "old"
    assert [row.split("\t") for row in rows[1:]] == [
        ["", "", "", "", str(old / name)] for name in ("b.arrows", "c.C3D", "day 1/rom.csv")
    ]


def test_files_below_the_study_are_named_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / "piano" / "captures").mkdir(parents=True)
    (tmp_path / "piano" / "captures" / "rom.csv").touch()
    assert new([str(tmp_path / "piano"), "--recordings", str(tmp_path / "piano" / "captures")]) == 0
    assert (tmp_path / "piano" / "recordings.tsv").read_text().endswith("\t\t\t\tcaptures/rom.csv\n")


@pytest.mark.parametrize(
    ("argv", "sentence"),
    [
        (["a b"], "a b: no study can have this name; use letters, digits, - and _"),
        (["there"], "there/recordings.tsv: is there already; name another folder, or edit that file"),
        (["a", "--recordings", "absent"], "--recordings: absent: no such folder; give the folder of your"),
        (
            ["a", "--recordings", "there"],
            "--recordings: there: holds no recording; expected files that end in",
        ),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_is_left(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    argv: list[str],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    Path("there/recordings.tsv").mkdir()
    assert new(argv) == 2
    assert f"error: {sentence}" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["recordings.tsv", "there"]


@pytest.mark.parametrize("folder", ["file/piano", "file"])
def test_a_folder_that_cannot_be_is_one_sentence(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert new([folder]) == 2
    assert f"error: {folder}: cannot be made a study's folder (" in capsys.readouterr().err
