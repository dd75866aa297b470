"""Simulated hands, short enough for tests, as the checks take them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.faultless_hands import Planted
from schemas.catalogue import POSES
from schemas.poses import Poses
from schemas.tables import Provenance, write_table
from stages.simulate.realism import Realism
from stages.simulate.simulation import simulate


@cache
def hand_of(seed: int, hand: str = "right", task: str = "rom", n_frames: int = 900) -> Planted:
    """Give a hand without a fault."""
    made = simulate("01", hand, task, seed, Realism.full(), n_frames)
    valid = np.ones(made.position_mm.shape[:2], bool)
    return Planted(
        Poses(made.segments, made.frame, made.time_s, made.position_mm, made.quaternion, valid), hand
    )


def write_poses(path: Path, poses: Poses, hand: str, task: str) -> None:
    """Write poses of subject 01 as the import would."""
    parameters = {"subject": "01", "hand": hand, "task": task, "trial": "", "layout": "liberty16"}
    frames, segments = poses.valid.shape
    columns = {
        "segment": np.repeat(poses.segments, frames).tolist(),
        "frame": np.tile(poses.frame, segments),
        "time_s": np.tile(poses.time_s, segments),
        "valid": poses.valid.T.ravel(),
        "flags": [""] * (frames * segments),
        **{f"{axis}_mm": poses.position_mm[..., i].T.ravel() for i, axis in enumerate("xyz")},
        **{f"q{part}": poses.quaternion[..., i].T.ravel() for i, part in enumerate("wxyz")},
    }
    write_table(path, POSES, columns, Provenance((), parameters), row_group_rows=frames)
