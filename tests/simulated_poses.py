"""Simulated recordings as poses with all receivers valid in all frames."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.faultless_hands import Planted
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import Provenance, write_table


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
    """Return one hand's recording with all disturbances except for the settings in `realism`."""
    disturbed = replace(Realism(), **realism)  # type: ignore[arg-type]
    simulated = simulate("01", side, task, seed, disturbed, n_frames, forearm=forearm)
    return simulated, simulated.poses()


@cache
def fitted(side: str = "right") -> HandFit:
    """Return a quick fit of the hand of seed 4 to 1600 frames."""
    poses = recorded(side, seed=4, n_frames=1600)[1]
    return fit_hand([poses], read_layout("liberty16"), side, settings=FitSettings(n_frames=60, rounds=1))


@cache
def hand_of(seed: int, hand: str = "right", task: str = "rom", n_frames: int = 900) -> Planted:
    """Return a faultless hand in the form used by the checks."""
    return Planted(recorded(hand, task, seed=seed, n_frames=n_frames)[1], hand)


def write_poses(
    path: Path, recording: Simulated | Poses, hand: str, task: str, subject: str = "01", **more: str
) -> Path:
    """Write a recording as the poses table that an import would produce."""
    poses = recording.poses() if isinstance(recording, Simulated) else recording
    n_frames, n_segments = poses.valid.shape
    columns = {
        "segment": np.repeat(np.array(poses.segments, object), n_frames),
        "frame": np.tile(poses.frame, n_segments),
        "time_s": np.tile(poses.time_s, n_segments),
        **{f"{axis}_mm": poses.position_mm[..., i].T.ravel() for i, axis in enumerate("xyz")},
        **{f"q{part}": poses.quaternion[..., i].T.ravel() for i, part in enumerate("wxyz")},
        "valid": poses.valid.T.ravel(),
        "flags": [""] * (n_segments * n_frames),
    }
    names = {"subject": subject, "hand": hand, "task": task, "trial": "", "layout": "liberty16", **more}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table(path, POSES, columns, Provenance((), names), row_group_rows=n_frames)
    return path
