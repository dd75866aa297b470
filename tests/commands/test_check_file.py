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


def test_a_file_that_is_not_there_is_what_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert check(["nowhere.csv"]) == 2
    assert "nowhere.csv: no such file; expected a study or a recording" in capsys.readouterr().err


def test_of_the_other_hand_only_that_is_said(rom: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check([str(rom), "--hand", "left"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("suspect: wrong-hand: This seems to be a right hand")
    assert "Measuring" not in out


def test_a_receiver_on_the_other_side_is_put_back_if_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = simulate("P1", "right", "rom", 3, Realism.full(), 900)
    made.position_mm[300:500, 0] *= -1
    write_recording(tmp_path / "rom.csv", made)
    asked = [str(tmp_path / "rom.csv"), "--hand", "right"]
    assert check(asked) == 0
    assert "hemisphere" in capsys.readouterr().out
    assert check([*asked, "--repair-hemisphere"]) == 0
    assert capsys.readouterr().out.startswith("note: hemisphere: 200 poses (200 of hand) were put back")


def test_of_another_program_s_file_it_says_how_a_mapping_is_had(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = tmp_path / "lab.csv"
    lab.write_text("t,x,y,z,az,el,roll\n" + "".join(f"{n},{n},2,3,{n},5,6\n" for n in range(9)))
    assert check([str(lab), "--hand", "left", "--layout", "arm"]) == 2
    said = capsys.readouterr().err
    assert f"`shukotsu inspect {lab} --write-mapping mapping.yaml --layout arm` drafts one to edit" in said
    assert "then check again with --mapping mapping.yaml" in said
    lab.write_text("hello\n")
    assert check([str(lab), "--hand", "left"]) == 2
    assert "mapping.yaml" not in capsys.readouterr().err


def test_without_a_study_in_the_folder_it_says_how_to_make_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert check([]) == 2
    assert "or make one: `shukotsu new FOLDER`" in capsys.readouterr().err
