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
from shukotsu.tables.poses import NUMBERS, Poses, RecordingName
from shukotsu.tables.typed_table import Provenance, write_table_in_parts


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
    """Return one hand's recording with its truth, and its poses alone.

    All disturbances are on except for the settings in `realism`.
    """
    disturbed = replace(Realism(), **realism)  # type: ignore[arg-type]
    simulated = simulate(RecordingName("01", side, task), seed, disturbed, n_frames, forearm=forearm)
    return simulated, simulated.take(slice(None))


@cache
def fitted(side: str = "right") -> HandFit:
    """Return a quick fit of the hand of seed 4 to 1600 frames."""
    poses = recorded(side, seed=4, n_frames=1600)[1]
    return fit_hand([poses], read_layout("liberty16"), side, settings=FitSettings(n_frames=60, rounds=1))


@cache
def hand_of(seed: int, hand: str = "right", task: str = "rom", n_frames: int = 900) -> Planted:
    """Return a faultless hand in the form used by the checks."""
    return Planted(recorded(hand, task, seed=seed, n_frames=n_frames)[1], hand)


def write_poses(path: Path, poses: Poses, hand: str, task: str, subject: str = "01", **more: str) -> Path:
    """Write a recording as the poses table that an import would produce."""
    numbers = np.concatenate([poses.position_mm, poses.quaternion], -1)
    n_frames = len(poses.frame)
    groups = [
        {
            "segment": [segment] * n_frames,
            "frame": poses.frame,
            "time_s": poses.time_s,
            **dict(zip(NUMBERS, numbers[:, index].T, strict=True)),
            "valid": poses.valid[:, index],
            "flags": [""] * n_frames,
        }
        for index, segment in enumerate(poses.segments)
    ]
    names = {"subject": subject, "hand": hand, "task": task, "trial": "", "layout": "liberty16", **more}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table_in_parts(path, POSES, groups, Provenance((), names))
    return path
