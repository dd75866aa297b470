"""As the guide says: an hour of a hand fits in 1 GB."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from long_poses import long_poses

from shukotsu.commands.run_stage import STAGES

REPOSITORY = Path(__file__).resolve().parents[2]
HOUR = 3600 * 240
MOST_BYTES = 10**9

PEAK = (
    "import re, sys; from shukotsu.command_line import run_script; "
    "assert run_script(sys.argv[1], sys.argv[2:]) == 0; "
    "print(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])"
)


def peak_bytes(stage: str, *argv: object) -> int:
    """Run a stage under paper-fig4 in a process of its own; the most memory that it held."""
    words = [*map(str, argv), "--layout", "liberty16", "--model", "paper-fig4"]
    finished = subprocess.run(
        [sys.executable, "-c", PEAK, STAGES / f"{stage}.py", *words],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    return int(finished.stdout.split()[-1]) * 1024


@pytest.mark.slow
def test_joints_metacarpals_and_tips_of_an_hour(tmp_path: Path) -> None:
    """16 receivers at 240 Hz, calibrated on and evaluated."""
    hour = long_poses(tmp_path / "hour.parquet", HOUR)
    solved, placed, joints, bones, metacarpals, tips, errors = (
        tmp_path / f"{name}.parquet"
        for name in ("solved", "placed", "joints", "bones", "turns", "tips", "errors")
    )
    assert peak_bytes("solve_joints", "--poses", hour, "--out", solved) < MOST_BYTES
    peak_bytes("project_planes", "--joint-solutions", solved, "--out", placed)
    recordings = ["--calibration", hour, "--poses", hour]
    built = ["--out-joints", joints, "--out-bones", bones, "--out", metacarpals]
    assert peak_bytes("estimate_metacarpals", "--projected-joints", placed, *recordings, *built) < MOST_BYTES
    read = ["--joint-centres", joints, "--bone-lengths", bones, "--metacarpals", metacarpals]
    written = ["--out", tips, "--out-errors", errors]
    assert peak_bytes("evaluate_tips", *read, *recordings, *written) < MOST_BYTES


@pytest.mark.slow
def test_what_joints_take_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """From where batches are as many as they get and a row group is full: nine minutes."""
    peaks = []
    for minutes in (10, 40):
        poses = long_poses(tmp_path / f"{minutes}.parquet", minutes * HOUR // 60)
        peaks.append(peak_bytes("solve_joints", "--poses", poses, "--out", tmp_path / "solved.parquet"))
    assert peaks[1] - peaks[0] < 50e6
