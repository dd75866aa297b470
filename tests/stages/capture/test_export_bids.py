"""Motion-BIDS out: valid for the validator, and read back to the last bit."""

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files
from recording_files import LIBERTY

from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.tables import read_table
from shukotsu.stages.capture.__main__ import main
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.stages.simulate.simulation import simulate

NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
WHO = ["--subject", "A & b_1", "--hand", "right", "--task", "thumb opposition", "--trial", "2"]
STEM = "sub-AQsQx26xQsbQu1_task-thumbQsopposition_tracksys-righthand_run-2"


def import_(recording: Path, out: Path, *who: str, layout: str = "liberty16") -> Path:
    words = ["import", "--in", str(recording), "--layout", layout, *(who or WHO), "--out", str(out)]
    assert main(words) == 0
    return out


def export(poses: Path, dataset: Path, *more: str) -> int:
    return main(["export-bids", "--poses", str(poses), "--out", str(dataset), *more])


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording with gaps of every kind that a tidy file can have."""
    folder = tmp_path_factory.mktemp("recording")
    simulated = simulate("01", "right", "opposition", 1, Realism.full(), 300)
    write_recording(folder / "whole.csv", simulated)
    with (folder / "whole.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    kept = [row for row in rows if not (row[2] == "index_distal" and 40 <= int(row[0]) < 60)]
    for row in kept:
        if row[2] == "thumb_distal" and 70 <= int(row[0]) < 90:
            row[3:] = [""] * 7
        if row[2] == "hand" and int(row[0]) == 100:
            row[1] = ""
        row[0] = str(int(row[0]) * 2 - 100)
    with (folder / "rom.csv").open("w", newline="") as file:
        csv.writer(file).writerows([header, *kept, kept[0]])
    return folder / "rom.csv"


@pytest.fixture(scope="module")
def poses(recording: Path) -> Path:
    return import_(recording, recording.with_name("poses.parquet"))


def motion(dataset: Path) -> Path:
    (found,) = dataset.rglob("*_motion.tsv")
    return found


def test_what_is_written_reads_back_the_same(poses: Path, tmp_path: Path) -> None:
    """Every column of every row to the last bit: gaps, missing times, negative frame numbers and flags."""
    assert export(poses, tmp_path / "set") == 0
    again = read_table(import_(motion(tmp_path / "set"), tmp_path / "again.parquet"), POSES)
    first = read_table(poses, POSES)
    for name in first.column_names:
        assert again.column(name).equals(first.column(name)), name
    present = np.array([flags != "no-row" for flags in first.column("flags").to_pylist()])
    expected = np.stack([first.column(name).to_numpy().astype(float)[present] for name in NUMBERS], -1)
    missing = np.isnan(expected)
    assert missing.sum() == 20 * 7
    numbers = recording_files.read(motion(tmp_path / "set"), LIBERTY).numbers
    np.testing.assert_array_equal(np.isnan(numbers), missing)
    assert numbers[~missing].tobytes() == expected[~missing].tobytes()
    seen = set(first.column("flags").to_pylist())
    assert seen == {"", "no-row", "missing", "time-missing", "duplicate-frame"}
    assert first.column("frame")[0].as_py() == -98


def test_files_labels_and_sidecars(poses: Path, tmp_path: Path) -> None:
    assert export(poses, tmp_path / "set") == 0
    folder = tmp_path / "set" / "sub-AQsQx26xQsbQu1" / "motion"
    endings = ["_channels.json", "_channels.tsv", "_motion.json", "_motion.tsv"]
    assert sorted(path.name for path in folder.iterdir()) == [STEM + ending for ending in endings]
    told = json.loads((folder / f"{STEM}_motion.json").read_text())
    assert told["TaskName"] == "thumb opposition"
    # The fixture has every second frame number only: the tracker's rate is twice that of the rows.
    assert told["SamplingFrequency"] == pytest.approx(480, rel=1e-6)
    assert told["SamplingFrequencyEffective"] == pytest.approx(240, rel=1e-6)
    assert told["TrackedPointsCount"] == 16
    with (folder / f"{STEM}_channels.tsv").open() as file:
        channels = list(csv.DictReader(file, delimiter="\t"))
    assert list(channels[0])[:5] == ["name", "component", "type", "tracked_point", "units"]
    assert told["MotionChannelCount"] == len(channels)
    for key in ("POS", "ORNT", "LATENCY", "MISC"):
        assert told[f"{key}ChannelCount"] == sum(channel["type"] == key for channel in channels)
    assert {c["units"] for c in channels if c["type"] == "POS"} == {"m"}
    own = told["Shukotsu"]
    assert [own[key] for key in ("subject", "hand", "task", "trial")] == [
        "A & b_1", "right", "thumb opposition", "2",
    ]  # fmt: skip
    assert "A & b_1" in (tmp_path / "set" / "participants.tsv").read_text()
    assert not list((tmp_path / "set").rglob("*.tmp"))


def test_the_validator_finds_no_error(poses: Path, recording: Path, tmp_path: Path) -> None:
    """With both hands of one task and two subjects in one dataset."""
    other = import_(recording, tmp_path / "l.parquet", *WHO[:3], "left", *WHO[4:])
    third = import_(recording, tmp_path / "t.parquet", "--subject", "02", "--hand", "left", "--task", "rom")
    command = ["export-bids", "--poses", str(poses), str(other), "--out", str(tmp_path / "set")]
    assert main(command) == 0
    assert export(third, tmp_path / "set") == 0
    found = validate(tmp_path / "set")
    assert not found["errors"]
    assert found["files"] == 4 + 3 * 4
    broken = motion(tmp_path / "set" / "sub-02").with_name("sub-02_motion.tsv")
    broken.write_text("1\n")
    assert validate(tmp_path / "set")["errors"]


def validate(dataset: Path) -> dict[str, Any]:
    """The BIDS validator's errors and how many files it looked at; it needs no network."""
    program = Path(sys.executable).with_name("bids-validator-deno")
    if not program.is_file():
        pytest.skip("bids-validator-deno is not installed beside this Python")
    command = [program, str(dataset), "--format", "json", "--max-rows", "-1"]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, check=False).stdout)
    issues = found["issues"]["issues"]
    errors = [issue for issue in issues if issue["severity"] == "error"]
    return {"errors": errors, "files": found["summary"]["totalFiles"]}


def test_what_is_there_stays(poses: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A dataset's own files and columns are kept, and a recording is replaced only when told."""
    dataset = tmp_path / "set"
    dataset.mkdir()
    (dataset / "dataset_description.json").write_text('{"Name": "Ours", "BIDSVersion": "1.8.0"}')
    (dataset / "README.md").write_text("ours")
    (dataset / "participants.tsv").write_text("participant_id\tage\nsub-07\t31\n")
    assert export(poses, dataset) == 0
    assert json.loads((dataset / "dataset_description.json").read_text())["Name"] == "Ours"
    assert not (dataset / "README").exists()
    expected = "participant_id\tage\nsub-07\t31\nsub-AQsQx26xQsbQu1\tn/a\n"
    assert (dataset / "participants.tsv").read_text() == expected
    before = {path: path.read_bytes() for path in dataset.rglob("*") if path.is_file()}
    motion(dataset).write_text("mine\n")
    assert export(poses, dataset) == 2
    error = capsys.readouterr().err
    assert "is there already; give --overwrite" in error
    assert error.count("\n") == 1
    assert motion(dataset).read_text() == "mine\n"
    assert export(poses, dataset, "--overwrite") == 0
    assert {path: path.read_bytes() for path in dataset.rglob("*") if path.is_file()} == before
