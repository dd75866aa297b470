"""As the guide says: an hour of a hand fits in 1 GB, of exports in 2; of those a quarter of an hour here."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from export_samples.known_hands import FITTED, KnownHand
from export_samples.long_hand import long_hand
from long_poses import long_poses

from shukotsu.stages.export.registry import FORMATS

REPOSITORY = Path(__file__).resolve().parents[2]
HOUR = 3600 * 240
MOST_BYTES = 10**9
MOST_BYTES_OF_EXPORTS = 2 * 1024**3
FIXED_BYTES = 300 * 10**6
"""Of a job: the program, and the pieces that tables are read by."""

PEAK = (
    "from stages.{}.__main__ import main; import re, sys; assert main(sys.argv[1:]) == 0; "
    "print(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])"
)


def peak_bytes(stage: str, *argv: object) -> int:
    """Run a stage under paper-fig4 in a process of its own; the most memory that it held."""
    return _peak_bytes(PEAK.format(stage), *argv, "--layout", "liberty16", "--model", "paper-fig4")


def _peak_bytes(program: str, *argv: object) -> int:
    finished = subprocess.run(
        [sys.executable, "-c", program, *map(str, argv)],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    return int(finished.stdout.split()[-1]) * 1024


@pytest.mark.slow
def test_metacarpals_and_tips_of_an_hour(tmp_path: Path) -> None:
    """16 receivers at 240 Hz, calibrated on and evaluated."""
    hour, short = long_poses(tmp_path / "hour.parquet", HOUR), long_poses(tmp_path / "short.parquet", 2400)
    solved, placed, joints, bones, metacarpals, tips, errors = (
        tmp_path / f"{name}.parquet"
        for name in ("solved", "placed", "joints", "bones", "turns", "tips", "errors")
    )
    peak_bytes("solve_joints", "--poses", short, "--out", solved)
    peak_bytes("project_planes", "--joints", solved, "--out", placed)
    recordings = ["--calibration", hour, "--poses", hour]
    built = ["--out-joints", joints, "--out-bones", bones, "--out", metacarpals]
    assert peak_bytes("estimate_metacarpals", "--joints", placed, *recordings, *built) < MOST_BYTES
    read = ["--joints", joints, "--bones", bones, "--metacarpals", metacarpals]
    written = ["--out", tips, "--out-errors", errors]
    assert peak_bytes("evaluate_tips", *read, *recordings, *written) < MOST_BYTES


@pytest.fixture(scope="module")
def quarter(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A fitted hand over a quarter of an hour."""
    return long_hand(tmp_path_factory.mktemp("quarter"), HOUR // 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FORMATS if name != "c3d"])  # which refuses as many frames
def test_an_export_of_a_quarter_of_an_hour(quarter: KnownHand, tmp_path: Path, name: str) -> None:
    """With a quarter of the arrays that are else kept in memory, so that an hour takes four times as much."""
    less = "from shukotsu.files import long_arrays; long_arrays.KEPT_BYTES //= 4; "
    argv = ["--plan", quarter.plan_path, "--model", FITTED, "--formats", name, "--out", tmp_path]
    peak = _peak_bytes(less + PEAK.format("export"), *argv)
    assert peak < FIXED_BYTES + 1.1 * (MOST_BYTES_OF_EXPORTS - FIXED_BYTES) / 4  # pages of files count too
