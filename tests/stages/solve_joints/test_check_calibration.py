"""Which joints need more motion: said in words, with what it would gain, printed and written."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from simulated_poses import hand_of, recorded, write_poses

from benchmarks.mistakes import MISTAKES
from shukotsu.schemas.catalogue import CALIBRATION_ADVICE
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.parts import Part, read_part
from shukotsu.schemas.plan import plan_of_poses
from shukotsu.stages.solve_joints.check_calibration import main


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Poses of a simulated left hand by task; in opposition its DIP joints are stiff."""
    folder = tmp_path_factory.mktemp("poses")
    made = {"rom": 4800, "opposition": 2400}
    return {
        task: write_poses(
            folder / f"{task}.parquet", recorded("left", task, seed=50, n_frames=n)[0], "left", task
        )
        for task, n in made.items()
    }


def checked(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["--layout", "liberty16", *words]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_stiff_fingertips_are_advised(
    poses: dict[str, Path], ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"advice{ending}"
    printed = checked(capsys, "--poses", str(poses["opposition"]), "--out", str(out))
    assert "move the little finger's fingertip joint alone through 40 deg" in printed
    table = pyarrow.csv.read_csv(out) if ending == ".csv" else pq.read_table(out)
    rows = {row["joint"]: row for row in table.to_pylist()}
    assert len(rows) == 15
    little = rows["little_dip"]
    assert little["range_deg"] < 10
    assert (little["kind"], json.loads(little["values"])) == ("move-more", {"wanted_deg": 40.0})
    assert little["sd_moved_mm"] < little["sd_now_mm"] - 0.15
    assert all(row["sd_moved_mm"] <= row["sd_now_mm"] for row in rows.values())


def test_bad_input_is_a_sentence(
    poses: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rom = str(poses["rom"])
    for words, said in (
        (["--poses", str(tmp_path / "none.parquet")], "no such file"),
        (["--poses", rom, "--out", "table.txt"], "expected .csv or .parquet"),
        (["--poses", rom, "--hand-length-mm", "18"], "--hand-length-mm: is 18; expected millimetres"),
    ):
        assert main(["--layout", "liberty16", *words]) == 2
        assert said in capsys.readouterr().err


def test_a_plan_of_both_hands_has_a_part_for_each(
    poses: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Each hand's advice stands under its name; the hand without a usable recording has none."""
    layout = read_layout("liberty16")
    left = plan_of_poses([poses["rom"]], [], layout, [])
    both = replace(left, layouts={"left": layout, "right": layout})
    monkeypatch.setattr(type(both), "hands", ("left", "right"))
    monkeypatch.setattr("shukotsu.stages.subject_stage.plan_of", lambda _: both)
    out = tmp_path / "advice.parquet"
    assert main(["--out", str(out), "--record-failure"]) == 0
    assert capsys.readouterr().out.startswith("left hand\njoint ")
    assert read_part(out, CALIBRATION_ADVICE, Part("left", subject="01")).num_rows == 15
    assert read_part(out, CALIBRATION_ADVICE, Part("right", subject="01")).num_rows == 0


def test_nothing_is_enough_while_a_finding_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = MISTAKES["x, y, z, w read as w, x, y, z"][1](hand_of(7), np.random.default_rng(0))
    write_poses(tmp_path / "poses.parquet", wrong.poses, "right", "rom")
    printed = checked(capsys, "--poses", str(tmp_path / "poses.parquet"))
    assert "enough" not in printed
    assert printed.startswith("suspect: quaternion-order: The quaternions are read as w")
    assert printed.count("nothing can be said before this is settled: The quaternions are read as w") == 15
    assert printed.count("put right") == 1
