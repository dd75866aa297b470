"""Simulated recordings as poses, every receiver valid in every frame."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from schemas.catalogue import POSES
from schemas.poses import Poses
from schemas.tables import Provenance, write_table
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate


@cache
def recorded(
    side: str = "right",
    task: str = "rom",
    *,
    seed: int,
    n_frames: int = 2400,
    forearm: bool = False,
    **realism: float | bool,
) -> tuple[Simulated, Poses]:
    """One hand's recording, with everything that disturbs one but for what `realism` names."""
    disturbed = replace(Realism.full(), **realism)  # type: ignore[arg-type]
    made = simulate("01", side, task, seed, disturbed, n_frames, forearm=forearm)
    return made, made.poses()


def write_poses(path: Path, made: Simulated, hand: str, task: str) -> Path:
    """Write a recording of subject 01 as the poses table that importing it would give."""
    n_segments, n_frames = len(made.segments), len(made.frame)
    stacked = {
        **{f"{axis}_mm": made.position_mm[..., i].T.ravel() for i, axis in enumerate("xyz")},
        **{f"q{part}": made.quaternion[..., i].T.ravel() for i, part in enumerate("wxyz")},
    }
    columns = {
        "segment": np.repeat(np.array(made.segments, object), n_frames),
        "frame": np.tile(made.frame, n_segments),
        "time_s": np.tile(made.time_s, n_segments),
        **stacked,
        "valid": np.ones(n_segments * n_frames, bool),
        "flags": [""] * (n_segments * n_frames),
    }
    names = {"subject": "01", "hand": hand, "task": task, "trial": ""}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table(path, POSES, columns, Provenance((), names), row_group_rows=n_frames)
    return path
