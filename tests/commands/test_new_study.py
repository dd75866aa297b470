"""`shukotsu new`: a folder whose study reads once its rows are filled in; nothing is written over."""

from __future__ import annotations

from pathlib import Path

import pytest

from shukotsu.commands.check_file import main as check
from shukotsu.commands.new_study import main as new
from shukotsu.stages.report.plots import style

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
    first, last = capsys.readouterr().out.splitlines()
    assert last == "P1 right rom: cannot be read: rom.csv: no such file; expected a recording"
    assert first == "study.yaml: study piano, 1 subjects, 1 recordings, 3 models"


def sheet(folder: Path) -> list[list[str]]:
    """The drafted sheet of recordings, its header first."""
    return [row.split("\t") for row in (folder / "recordings.tsv").read_text().splitlines()]


def test_a_row_is_drafted_for_every_recording_by_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a name does not say stays empty; a file that cannot be read keeps its row and is named."""
    (tmp_path / "old" / "P2").mkdir(parents=True)
    names = ("P2/grip_left_3.csv", "P1_R_calib.arrows", "notes.md", "P1_R_scales.C3D", "rom_motion.tsv")
    for name in (*names, "rom_channels.tsv", "participants.tsv"):
        (tmp_path / "old" / name).touch()
    (tmp_path / "old" / "pipe.csv").mkdir()
    assert new([str(tmp_path / "piano"), "--recordings", str(tmp_path / "old")]) == 0
    old = tmp_path / "old"
    assert sheet(tmp_path / "piano") == [
        ["subject", "hand", "task", "role", "file", "trial"],
        ["P1", "right", "calib", "calibration", str(old / names[1]), ""],
        ["P1", "right", "scales", "evaluation", str(old / names[3]), ""],
        ["P2", "left", "grip", "both", str(old / names[0]), "3"],
        ["", "", "rom", "calibration", str(old / names[4]), ""],
    ]
    assert (tmp_path / "piano" / "participants.tsv").read_text().splitlines()[1:] == ["P1", "P2"]
    out = capsys.readouterr().out
    assert f"note: {old / names[0]}: is empty; expected a recording; its row stays until you remove it" in out
    assert "drafted from names, and fill in the 1 that their names leave open, then: cd" in out


TABLE = "t [s];a_x [cm];a_y [cm];a_z [cm];a_az [deg];a_el [deg];a_ro [deg]\n"
ROWS = "".join(f"{n / 100};{n};{n * 2};{n * 3};{n * 10};{n * 4};{n * 2}\n" for n in range(9))


def test_files_that_are_alike_share_a_mapping(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "old").mkdir()
    for name in ("P1_L_rom", "P1_R_rom"):
        (tmp_path / "old" / f"{name}.csv").write_text(TABLE + ROWS)
    (tmp_path / "old" / "P2_R_rom.csv").write_text((TABLE + ROWS).replace("a_", "b_"))
    argv = [str(tmp_path / "piano"), "--recordings", str(tmp_path / "old"), "--layout", "arm"]
    assert new(argv) == 0
    rows = sheet(tmp_path / "piano")
    assert [row[-1] for row in rows] == ["mapping", "mapping.yaml", "mapping.yaml", "mapping-2.yaml"]
    drafted = (tmp_path / "piano" / "mapping.yaml").read_text()
    assert "Drafted from P1_L_rom.csv" in drafted
    assert 'position_unit: "cm"' in drafted
    assert "by segment of layout arm" in drafted
    assert "layout: arm " in (tmp_path / "piano" / "study.yaml").read_text()
    assert (
        f"where mapping.yaml, mapping-2.yaml in {tmp_path / 'piano'} say CHECK, then"
        in capsys.readouterr().out
    )


def test_files_below_the_study_are_named_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / "piano" / "captures").mkdir(parents=True)
    (tmp_path / "piano" / "captures" / "rom.csv").touch()
    assert new([str(tmp_path / "piano"), "--recordings", str(tmp_path / "piano" / "captures")]) == 0
    assert sheet(tmp_path / "piano")[1][4] == "captures/rom.csv"


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
        (["a", "--layout", "hand"], "layout 'hand' is neither a layout that ships"),
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
