"""`shukotsu new`: a folder whose study reads once its rows are filled in; file names; drafted mappings."""

from __future__ import annotations

from pathlib import Path

import pytest

from shukotsu.commands.check_file import main as check
from shukotsu.commands.drafted_mappings import Drafts, draft_mappings
from shukotsu.commands.new_study import main as new
from shukotsu.commands.recording_names import parts_of_names
from shukotsu.report.figures import style
from shukotsu.study.layout import read_layout

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


EMPTY = {"subject": "", "session": "", "hand": "", "task": "", "trial": "", "role": ""}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        ("sub-03_right_rom.c3d", "subject=03 hand=right task=rom role=calibration"),
        ("03-left-grip-2.csv", "subject=03 hand=left task=grip trial=2 role=both"),
        (
            "sub-01_ses-b_hand-right_task-rom.parquet",
            "subject=01 session=b hand=right task=rom role=calibration",
        ),
        ("P01/left/calib_01.csv", "subject=P01 hand=left task=calib trial=01 role=calibration"),
        ("P01L_scales.csv", "subject=P01 hand=left task=scales role=both"),
        ("2024-05-03_P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        (
            "20240503_142233_VP12_li_Kalibrierung.csv",
            "subject=VP12 hand=left task=Kalibrierung role=calibration",
        ),
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
def test_what_a_name_says(name: str, said: str) -> None:
    (parts,) = parts_of_names([Path(name)])
    assert vars(parts) == EMPTY | dict(word.split("=") for word in said.split())


def test_a_task_is_evaluated_by_the_calibration_of_the_same_hand_and_session() -> None:
    names = ["P1_L_rom.csv", "P1_L_grip.csv", "P1_R_grip.csv", "P1_ses-2_L_grip.csv"]
    roles = [parts.role for parts in parts_of_names(map(Path, names))]
    assert roles == ["calibration", "evaluation", "both", "both"]


TITLES = "t [s],x,y,z,az,el,roll\n"


def table(path: Path, step_deg: float, titles: str = TITLES) -> Path:
    """Write a table of one receiver whose angles grow by so much a row."""
    angles = [(n * step_deg, n * step_deg / 2, n * step_deg / 3) for n in range(9)]
    rows = [f"{n / 100},{n},{n * 2},{n * 3},{','.join(map(str, angles[n]))}\n" for n in range(9)]
    path.write_text(titles + "".join(rows))
    return path


def test_what_one_file_leaves_open_another_settles(tmp_path: Path) -> None:
    """Angles of small turns may be radians; the same columns' large ones are degrees."""
    small, large = table(tmp_path / "a.csv", 0.1), table(tmp_path / "b.csv", 9.0)
    other = table(tmp_path / "c.csv", 9.0, TITLES.replace(" [s]", " [ms]"))
    empty = tmp_path / "d.csv"
    empty.touch()
    seen: list[int] = []
    drafts = draft_mappings([small, large, other, empty], read_layout("liberty16"), seen.append)
    assert drafts.of == {small: "mapping.yaml", large: "mapping.yaml", other: "mapping-2.yaml"}
    assert "Drafted from b.csv" in drafts.texts["mapping.yaml"]
    assert drafts.refused == {empty: f"{empty}: is empty; expected a recording"}
    assert seen == [1, 2, 3, 4]


def test_this_project_s_own_tables_need_none(tmp_path: Path) -> None:
    own = tmp_path / "own.csv"
    own.write_text("frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,hand,1,2,3,1,0,0,0\n")
    drafts = draft_mappings([own], read_layout("liberty16"))
    assert drafts == Drafts({}, {}, {})
