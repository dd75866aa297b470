"""Simulated calibrations for the coach: what somebody does, as it arrives, and as an archive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.coached.people import draw
from shukotsu.coach.live_poses import Arrived
from shukotsu.coach.setup import CoachSetup
from shukotsu.schemas.config_files import config_path, read_config
from shukotsu.schemas.poses import Poses
from shukotsu.stages.capture.__main__ import main as capture
from shukotsu.stages.fit_hand.receiver_frames import concatenated
from shukotsu.stages.simulate.recording import write_recording

SEED, RATE_HZ, CHUNK = 7001, 240, 60
HAND = "left"
PERIOD_NS = round(1e9 / RATE_HZ)
CALIBRATION = (("rest", 1.0), ("free", 9.0), ("rest", 1.0), ("spread", 5.0), ("thumb-circle", 6.0))


def setup(**changes: object) -> CoachSetup:
    """Give the setup of the simulated hand."""
    layout = read_config(config_path("liberty16", "layout", Path()), "layout") | {"wanted_mm": 2.0}
    model = read_config(config_path("whole-hand", "model", Path()), "model")
    return replace(CoachSetup("piano", "03", HAND, "", "rom", layout, 2.0, model), **changes)  # type: ignore[arg-type]


@cache
def performed(movement: str, seconds: float, turn: int = 1) -> Poses:
    """Give poses of a movement."""
    return draw("own", SEED).perform(movement, seconds, 1.0, turn).poses


def one_after_another(movements: Sequence[tuple[str, float]]) -> Poses:
    """Give poses of movements in turn, as one recording."""
    parts = [performed(name, seconds, turn) for turn, (name, seconds) in enumerate(movements, 1)]
    whole = concatenated(list(parts))
    frame = np.arange(len(whole.frame), dtype=np.int64)
    return replace(whole, frame=frame, time_s=frame / RATE_HZ)


def arriving(poses: Poses, chunk: int = CHUNK) -> Iterator[Arrived]:
    """Give poses in chunks, as a recorder writes them."""
    for start in range(0, len(poses.frame), chunk):
        part = poses.take(slice(start, start + chunk))
        yield Arrived(part, part.frame * PERIOD_NS)


def archive(folder: Path, poses: Poses) -> Path:
    """Write poses as the archive that a LIBERTY would have given."""
    recording = folder / "recording.parquet"
    write_recording(recording, poses)
    out = folder / "recording.arrows"
    assert capture(["emulate", f"--archive={out}", f"--recording={recording}"]) == 0
    return out
