"""`shukotsu check` of a recording: findings first; what would gain only where nothing contradicts."""

from __future__ import annotations

from pathlib import Path

import pytest

from shukotsu.commands.check_file import main as check
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.stages.simulate.simulation import simulate


@pytest.fixture(scope="module")
def rom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rom") / "rom.csv"
    write_recording(path, simulate("P1", "right", "rom", 3, Realism.full(), 900))
    return path


def test_a_good_recording_has_three_lines_on_what_would_gain(
    rom: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check([str(rom), "--hand", "right"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "no finding"
    assert len(lines) == 4
    assert all(line.startswith(("Measuring ", "Touching ")) for line in lines[1:])
    assert list(rom.parent.iterdir()) == [rom]  # nothing is left beside it


def test_of_the_other_hand_only_that_is_said(rom: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check([str(rom), "--hand", "left"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("suspect: wrong-hand: This seems to be a right hand")
    assert "Measuring" not in out


def test_without_a_study_in_the_folder_it_says_how_to_make_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert check([]) == 2
    assert "or make one: `shukotsu new FOLDER`" in capsys.readouterr().err
