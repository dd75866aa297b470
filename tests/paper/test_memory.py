"""Memory of the stage: hours take no more than minutes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from long_poses import long_poses

MINUTE = 60 * 240
_MEASURED = """
import sys
from shukotsu.workflow import job
assert job.run(["shukotsu.paper", *sys.argv[1:]]) == 0
(peak,) = [line for line in open("/proc/self/status") if line.startswith("VmHWM:")]
print(peak.split()[1])
"""


def peak_mb(poses: Path, model: str) -> float:
    """Peak memory of the stage in a process of its own; its rusage would count what forked it, too."""
    words = ["--poses", str(poses), "--layout", "liberty16", "--model", model]
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, *words, "--out", str(poses.with_suffix(".joints"))],
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return int(done.stdout.split()[-1]) / 1e3


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """From where batches are as many as they get and a row group is full: nine minutes."""
    short, long = (
        peak_mb(long_poses(tmp_path / f"{minutes}.parquet", minutes * MINUTE), "paper-fig4")
        for minutes in (10, 40)
    )
    assert long - short < 50
    assert long < 450
