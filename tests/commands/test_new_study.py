"""`shukotsu new`: the new study folder, rows drafted from file names, and drafted mappings."""

import shlex
from pathlib import Path

import pytest

from shukotsu.commands.check_file import main as check
from shukotsu.commands.new_study import main as new
from shukotsu.commands.new_study import parts_of_names
from shukotsu.report.figures import style

ROW = "P1\tright\trom\tboth\trom.csv\n"


@pytest.mark.parametrize("language", ["en", "ja"])
def test_a_new_study_is_valid_once_it_has_a_row(
    tmp_path: Path, language: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(style, "font_of", lambda _: Path("installed.ttf"))
    monkeypatch.chdir(tmp_path)
    assert new(["piano", "--language", language]) == 0
    assert "next: write a row for each recording into piano/recordings.tsv" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path / "piano")
    assert check([]) == 2
    assert "add a row for each" in capsys.readouterr().err
    with Path("recordings.tsv").open("a") as file:
        file.write(ROW)
    assert check([]) == 2
    first, last = capsys.readouterr().out.splitlines()
    assert last == "P1 right rom: cannot be read: rom.csv: no such file; expected a recording"
    assert first == "study.yaml: study piano, 1 subject, 1 recording, 3 models"


@pytest.mark.parametrize(("name", "study"), [("ピアノ 研究", "study"), ("grip's 2", "grip-s-2")])
def test_the_studys_name_is_derived_from_any_folder_name(
    tmp_path: Path, name: str, study: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert new([name]) == 0
    out = capsys.readouterr().out
    assert f"note: the study is called {study}, and results go to results/{study}\n" in out
    assert f"then: cd {shlex.quote(name)}; shukotsu check" in out
    assert f"\nstudy: {study} " in Path(name, "study.yaml").read_text("utf-8")


def sheet(folder: Path) -> list[list[str]]:
    return [row.split("\t") for row in (folder / "recordings.tsv").read_text().splitlines()]


def test_a_row_is_drafted_from_every_recordings_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Cells that the name does not determine are empty; an unreadable file keeps its row and is reported."""
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


EMPTY = {"subject": "", "session": "", "hand": "", "task": "", "trial": "", "role": ""}


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        ("sub-03_right_rom.c3d", "subject=03 hand=right task=rom role=calibration"),
        ("03-left-grip-2.csv", "subject=03 hand=left task=grip trial=2 role=both"),
        ("sub-01_ses-b_hand-right_task-rom.csv", "subject=01 session=b hand=right task=rom role=calibration"),
        ("P01/left/calib_01.csv", "subject=P01 hand=left task=calib trial=01 role=calibration"),
        ("P01L_scales.csv", "subject=P01 hand=left task=scales role=both"),
        ("2024-05-03_P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        ("20240503_142233_V2_li_Kalibrierung.c3d", "subject=V2 hand=left task=Kalibrierung role=calibration"),
        ("VP 4 LH tapping fast 3.csv", "subject=VP4 hand=left task=tapping-fast trial=3 role=both"),
        ("Subject 3 re rom2.csv", "subject=3 hand=right task=rom2 role=calibration"),
        ("Anna_grip2_re.csv", "subject=Anna hand=right task=grip2 role=both"),
        ("calib_P07_R.csv", "subject=P07 hand=right task=calib role=calibration"),
        ("day 1/rom.csv", "session=1 task=rom role=calibration"),
        ("romantic.csv", "task=romantic role=both"),
        ("hand-left.csv", "hand=left"),
        ("2024-05-03.csv", ""),
    ],
)
def test_subject_hand_task_and_trial_are_read_from_file_names(name: str, parts: str) -> None:
    (read,) = parts_of_names([Path(name)])
    assert vars(read) == EMPTY | dict(word.split("=") for word in parts.split())


def test_a_task_is_for_evaluation_if_its_hand_and_session_has_a_calibration() -> None:
    names = ["P1_L_rom.csv", "P1_L_grip.csv", "P1_R_grip.csv", "P1_ses-2_L_grip.csv"]
    roles = [parts.role for parts in parts_of_names(map(Path, names))]
    assert roles == ["calibration", "evaluation", "both", "both"]


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    """A folder of four files: small angles, large angles with the same titles, another time unit, and
    empty.
    """
    (tmp_path / "piano" / "old").mkdir(parents=True)
    for name, step_deg, unit in (("P1_L_rom", 0.1, "s"), ("P1_R_rom", 9.0, "s"), ("P2_R_rom", 9.0, "ms")):
        rows = [(n / 100, n, n * 2, n * 3, *(n * step_deg / part for part in (1, 2, 3))) for n in range(9)]
        lines = [f"t [{unit}],x,y,z,az,el,roll", *(",".join(map(str, row)) for row in rows)]
        (tmp_path / "piano" / "old" / f"{name}.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "piano" / "old" / "P3_R_rom.csv").touch()
    return tmp_path / "piano" / "old"


def test_files_with_equal_columns_share_a_mapping(tables: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Small angles alone could be in radians; larger ones in the same columns of another file show
    degrees.
    """
    assert new([str(tables.parent), "--recordings", str(tables), "--layout", "arm"]) == 0
    rows = sheet(tables.parent)
    assert [row[-1] for row in rows] == ["mapping", "mapping.yaml", "mapping.yaml", "mapping-2.yaml", ""]
    assert rows[1][4] == "old/P1_L_rom.csv", "relative to the study"
    mapping = (tables.parent / "mapping.yaml").read_text()
    assert "Drafted from P1_R_rom.csv" in mapping
    assert "by segment of layout arm" in mapping
    assert "layout: arm " in (tables.parent / "study.yaml").read_text()
    printed = capsys.readouterr().out
    assert f"where mapping.yaml, mapping-2.yaml in {tables.parent} say CHECK, then" in printed
    assert "P3_R_rom.csv: is empty; expected a recording" in printed
