"""An hour of a hand is processed in 1 GB of memory, as the guide states."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from program_files import REPOSITORY, printed_by
from simulated_poses import recorded

from shukotsu.commands.run_stage import STAGES
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.typed_table import ROW_GROUP_ROWS, Provenance, write_table_in_parts

HOUR = 3600 * 240
MOST_BYTES = 10**9

PEAK = (
    "import re, sys; from shukotsu.command_line import run_script; "
    "assert run_script(sys.argv[1], sys.argv[2:]) == 0; "
    "print(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])"
)


def peak_bytes(stage: str, *argv: object) -> int:
    """Run a stage under paper-fig4 in a separate process and return its peak memory in bytes."""
    words = [*argv, "--layout", "liberty16", "--model", "paper-fig4"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    printed = printed_by(sys.executable, "-c", PEAK, STAGES / f"{stage}.py", *words, env=environment)
    return int(printed.split()[-1]) * 1024


def long_poses(path: Path, n_frames: int) -> Path:
    """Write ten seconds of a hand repeatedly, with new noise, in longer row groups than an import writes."""
    hand = recorded(seed=1, n_frames=2400)[0]
    noise = np.random.default_rng(0)

    def repeated(word: str, count: int) -> pa.Array:
        return pa.DictionaryArray.from_arrays(pa.array(np.zeros(count, np.int32)), pa.array([word]))

    def parts() -> Iterator[dict[str, Any]]:
        for column, segment in enumerate(hand.segments):
            for start in range(0, n_frames, ROW_GROUP_ROWS):
                frame = np.arange(start, min(start + ROW_GROUP_ROWS, n_frames))
                count, rows = len(frame), frame % 2400
                position_mm = hand.position_mm[rows, column] + noise.normal(0, 0.1, (count, 3))
                numbers = [*position_mm.T, *hand.quaternion[rows, column].T]
                named = zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), numbers, strict=True)
                words = {"segment": repeated(segment, count), "flags": repeated("", count)}
                times = {"frame": frame, "time_s": frame / 240.0, "valid": np.ones(count, bool)}
                yield words | times | dict(named)

    names = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}
    write_table_in_parts(path, POSES, parts(), Provenance(parameters=names))
    return path


@pytest.mark.slow
def test_stages_of_an_hours_recording_stay_within_a_gigabyte(tmp_path: Path) -> None:
    """The recording has 16 receivers at 240 Hz and is used for calibration and evaluation."""
    hour = long_poses(tmp_path / "hour.parquet", HOUR)
    solved, projected, joints, bones, metacarpals, tips, errors = (
        tmp_path / f"{name}.parquet"
        for name in ("solved", "projected", "joints", "bones", "turns", "tips", "errors")
    )
    assert peak_bytes("solve_joints", "--poses", hour, "--out", solved) < MOST_BYTES
    peak_bytes("project_planes", "--joint-solutions", solved, "--out", projected)
    recordings = ["--calibration", hour, "--poses", hour]
    built = ["--out-joints", joints, "--out-bones", bones, "--out", metacarpals]
    assert (
        peak_bytes("estimate_metacarpals", "--projected-joints", projected, *recordings, *built) < MOST_BYTES
    )
    read = ["--joint-centres", joints, "--bone-lengths", bones, "--metacarpals", metacarpals]
    written = ["--out", tips, "--out-errors", errors]
    assert peak_bytes("evaluate_tips", *read, *recordings, *written) < MOST_BYTES


@pytest.mark.slow
def test_memory_for_joints_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Both recordings exceed nine minutes, beyond which there are no more batches and row groups are full."""
    peaks = []
    for minutes in (10, 40):
        poses = long_poses(tmp_path / f"{minutes}.parquet", minutes * HOUR // 60)
        peaks.append(peak_bytes("solve_joints", "--poses", poses, "--out", tmp_path / "solved.parquet"))
    assert peaks[1] - peaks[0] < 50e6
