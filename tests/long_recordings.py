"""Recordings made from short ones, with gaps or of any length, and the memory that stages take for them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pipeline import HandResults, import_recording, run_hand

from schemas.catalogue import POSES
from schemas.poses import recording_name
from schemas.tables import ROW_GROUP_ROWS, Provenance, read_table, write_table, write_table_in_parts
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

REPOSITORY = Path(__file__).resolve().parent.parent
NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def gappy(poses: Path, out: Path, seed: int, share: float = 0.1) -> Path:
    """The recording without some stretches of every receiver, from the first frame on, and some times."""
    rng = np.random.default_rng(seed)
    table = read_table(poses, POSES)
    columns: dict[str, Any] = {name: table.column(name).combine_chunks() for name in table.column_names}
    count = table.num_rows
    gap = np.repeat(rng.random(count // 7 + 1) < share, 7)[:count]
    frame = columns["frame"].to_numpy()
    gap |= (frame < frame.min() + 9) & (columns["segment"].to_numpy(zero_copy_only=False) == "hand")
    for name in NUMBERS:
        columns[name] = np.where(gap, np.nan, columns[name].to_numpy(zero_copy_only=False))
    columns["valid"] = columns["valid"].to_numpy(zero_copy_only=False) & ~gap
    times = columns["time_s"].to_numpy(zero_copy_only=False)
    columns["time_s"] = np.where(rng.random(count) < 0.7, np.nan, times)
    groups = np.unique(table.column("segment").to_numpy(), return_counts=True)[1]
    write_table(out, POSES, columns, _provenance(poses), row_group_rows=groups.tolist())
    return out


def lengthened(poses: Path, out: Path, minutes: float, rate_hz: float = 240.0) -> Path:
    """The recording over and over again until it is so long."""
    table, wanted = read_table(poses, POSES), round(60 * minutes * rate_hz)

    def parts() -> Iterator[dict[str, Any]]:
        for segment in dict.fromkeys(table.column("segment").to_pylist()):
            own = table.filter(pc.equal(table.column("segment"), segment))
            for start in range(0, wanted, ROW_GROUP_ROWS):
                frame = np.arange(start, min(start + ROW_GROUP_ROWS, wanted))
                rows = own.take(pa.array(frame % own.num_rows))
                columns = {name: rows.column(name) for name in rows.column_names}
                yield columns | {"frame": frame, "time_s": frame / rate_hz}

    write_table_in_parts(out, POSES, parts(), _provenance(poses))
    return out


def peak_mb(stage: str, *words: object) -> float:
    """Run a stage in a process of its own; the most memory that it held, in MB."""
    program = (
        f"from stages.{stage}.__main__ import main; import re, sys; assert main(sys.argv[1:]) == 0; "
        "print(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])"
    )
    found = subprocess.run(
        [sys.executable, "-c", program, *map(str, words)],
        cwd=REPOSITORY,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    return int(found.stdout.split()[-1]) / 1024


def _provenance(poses: Path) -> Provenance:
    name = recording_name(poses)
    return Provenance(
        (), {"subject": name.subject, "hand": name.hand, "task": name.task, "trial": name.trial}
    )


def hand_of_length(folder: Path, minutes: float) -> HandResults:
    """A simulated hand under paper-fig4, and beside its tables `poses` of that length, and short ones."""
    folder.mkdir()
    write_recording(folder / "r.parquet", simulate("01", "right", "rom", 5, Realism.full(), 1200))
    short = import_recording(folder / "r.parquet", folder / "short_poses.parquet", task="rom")
    done = run_hand(short, short, "paper-fig4", folder)
    lengthened(short, done.path("poses"), minutes)
    return done


def estimate_words(hand: HandResults) -> list[object]:
    """Words of estimate_metacarpals, calibrated on and posing the long recording."""
    poses = hand.path("poses")
    made = ["--out-joints", hand.path("joint_centres"), "--out-bones", hand.path("bone_lengths")]
    read = ["--joints", hand.path("projected_joints"), "--calibration", poses, "--poses", poses]
    return [*read, *_NAMES, *made, "--out", hand.path("metacarpals")]


def tips_words(hand: HandResults) -> list[object]:
    """Words of evaluate_tips on the long recording."""
    poses = hand.path("poses")
    read = ["--poses", poses, "--calibration", poses, "--metacarpals", hand.path("metacarpals")]
    read += ["--joints", hand.path("joint_centres"), "--bones", hand.path("bone_lengths")]
    return [*read, *_NAMES, "--out", hand.path("tips"), "--out-errors", hand.path("tip_errors")]


_NAMES = ("--layout", "liberty16", "--model", "paper-fig4")


def hand_with_gaps(folder: Path) -> HandResults:
    """A hand of 240 frames with gaps in every receiver, the hand's from the first frame on."""
    write_recording(folder / "r.parquet", simulate("01", "right", "rom", 5, Realism.full(), 240))
    poses = import_recording(folder / "r.parquet", folder / "whole.parquet")
    return run_hand(poses, gappy(poses, folder / "poses.parquet", 3), "paper-fig4", folder)
