"""Which joints need more motion: said in words, with what it would gain, printed and written."""

from pathlib import Path

import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from schemas.catalogue import CALIBRATION_ADVICE
from schemas.errors import InputError
from schemas.tables import read_table
from stages.capture.__main__ import main as capture
from stages.check_calibration.__main__ import main
from stages.simulate.__main__ import main as simulate


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Poses of a simulated left hand by task; in opposition its DIP joints are stiff."""
    folder = tmp_path_factory.mktemp("poses")
    made = {}
    for task, n_frames in (("rom", "4800"), ("opposition", "2400")):
        recording, made[task] = folder / f"{task}.parquet", folder / f"{task}-poses.parquet"
        words = ["--subject", "01", "--hand", "left", "--task", task]
        assert simulate([*words, "--seed", "50", "--frames", n_frames, "--out", str(recording)]) == 0
        named = ["import", "--layout", "liberty16", "--in", str(recording), "--out", str(made[task])]
        assert capture([*named, *words]) == 0
    return made


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
    assert little["advice"].startswith(f"little DIP moved {little['range_deg']:.0f} deg; ")
    assert little["sd_moved_mm"] < little["sd_now_mm"] - 0.15
    assert all(row["sd_moved_mm"] <= row["sd_now_mm"] for row in rows.values())


def test_a_full_range_of_motion_is_enough(poses: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Range of motion alone, and added to the task: no finger joint is asked for more."""
    for words in (["rom"], ["opposition", "rom"]):
        printed = checked(capsys, "--poses", *(str(poses[task]) for task in words))
        advice = {line.split()[0]: line for line in printed.splitlines()[1:]}
        assert "forearm" not in printed
        for finger in ("index", "middle", "ring", "little"):
            for joint in ("mcp", "pip", "dip"):
                assert "enough" in advice[f"{finger}_{joint}"]


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
    for ending in (".csv", ".parquet"):
        words = ["--poses", str(tmp_path / "none.parquet"), f"--out={tmp_path / 'advice'}{ending}"]
        assert main(["--layout", "liberty16", *words, "--record-failure"]) == 0
    assert "no such file" in (tmp_path / "advice.csv").read_text()
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "advice.parquet", CALIBRATION_ADVICE)
