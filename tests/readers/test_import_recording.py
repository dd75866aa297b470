"""The command `shukotsu import`."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from shukotsu.__main__ import main
from shukotsu.errors import InputError
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import read_poses, recording_name
from shukotsu.tables.typed_table import read_metadata, read_table

REPOSITORY = Path(__file__).resolve().parents[2]
HEADER = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROWS = "0,0.0,hand,1,2,3,1,0,0,0\n0,0.0,thumb_distal,1,2,3,1,0,0,0\n1,0.1,hand,,,,,,,\n"
WHO = ["--subject", 'A & <b>"x"', "--hand", "left", "--task", "rom"]


def run(recording: Path, out: Path, *more: str, layout: str = "liberty16") -> int:
    return main(["import", "--in", str(recording), "--layout", layout, *WHO, "--out", str(out), *more])


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "rom.csv"
    path.write_text(HEADER + ROWS)
    return path


def test_metadata_name_the_hand_and_absent_segments(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording.write_text(HEADER + ROWS + "0,0.0,index_distal,,,,,,,\n")
    out = recording.with_name("poses.parquet")
    assert run(recording, out, "--trial", "2") == 0
    metadata = read_metadata(out)
    parameters = metadata["parameters"]
    assert str(recording_name(out)) == 'subject A & <b>"x", left hand, rom, 2'
    assert parameters["layout"] == "liberty16"
    assert len(parameters["absent"]) == 14
    assert not {"hand", "thumb_distal", "forearm"} & set(parameters["absent"])
    assert [entry["file"] for entry in metadata["inputs"]] == ["rom.csv", "liberty16.yaml"]
    rows = read_table(out, POSES).to_pylist()
    assert [row["flags"] for row in rows if row["segment"] == "index_distal"] == ["missing", "no-row"]
    printed, captured = capsys.readouterr()
    assert printed == f"{out}: 6 rows, 2 receivers, 0.1 s, 2 poses of them missing\n"
    assert captured.count("no pose of") == 1
    assert "index_distal, middle_proximal" in captured
    assert "(14 of 17 segments)" in captured


def test_the_table_does_not_depend_on_the_folder(recording: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere" / "rom.csv"
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(recording.read_bytes())
    run(recording, tmp_path / "one.parquet")
    run(elsewhere, tmp_path / "another" / "two.parquet")
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "another" / "two.parquet").read_bytes()
    assert str(tmp_path).encode() not in (tmp_path / "one.parquet").read_bytes()


@pytest.mark.parametrize(
    ("name", "layout", "message"),
    [
        ("rom.csv", "liberty16", r"^rom\.csv: has a header but no rows"),
        ("rom.csv", "libery16", "did you mean 'liberty16'"),
        ("no.csv", "liberty16", r"^no\.csv: no such file"),
    ],
)
def test_a_failure_can_be_recorded_instead(recording: Path, name: str, layout: str, message: str) -> None:
    """The table has its parameters, no rows, and the reason without the folder's path."""
    recording.write_text(HEADER)
    out = recording.with_name("poses.parquet")
    assert run(recording.with_name(name), out, "--record-failure", layout=layout) == 0
    assert recording_name(out).task == "rom"
    assert read_metadata(out)["parameters"]["layout"] == layout
    assert pq.read_metadata(out).num_rows == 0
    with pytest.raises(InputError, match=message) as caught:
        read_poses(out, ["hand"])
    assert str(recording.parent) not in str(caught.value)


def test_the_guides_example_recording_can_be_imported(tmp_path: Path) -> None:
    """The example of docs/recordings.md is imported unchanged and has the gap that the page describes."""
    guide = (REPOSITORY / "docs" / "recordings.md").read_text("utf-8")
    example = tmp_path / "rom.csv"
    example.write_text(guide.split("```csv\n")[1].split("```")[0])
    assert run(example, tmp_path / "poses.parquet") == 0
    rows = read_table(tmp_path / "poses.parquet", POSES).to_pylist()
    assert [(row["segment"], row["frame"], row["flags"]) for row in rows] == [
        ("hand", 1017, ""),
        ("hand", 1018, ""),
        ("index_proximal", 1017, ""),
        ("index_proximal", 1018, "missing"),
    ]
