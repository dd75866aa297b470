"""Simulated calibrations for the coach: as poses, and as the archive that a LIBERTY would have given."""

from __future__ import annotations

from pathlib import Path

from simulated_poses import recorded, write_poses

from shukotsu.__main__ import main as capture
from shukotsu.tables.poses import Poses

SEED, RATE_HZ = 7001, 240


def calibration(seconds: float, hand: str = "right") -> Poses:
    """Poses of a hand that goes through the range of its joints."""
    return recorded(hand, seed=SEED, n_frames=round(seconds * RATE_HZ))[1]


def played(folder: Path, poses: Poses, hand: str = "right") -> Path:
    """Write poses as a recording that the emulator plays."""
    return write_poses(folder / "played.parquet", poses, hand, "rom")


def archive(folder: Path, poses: Poses, hand: str = "right") -> Path:
    out = folder / "recording.arrows"
    assert capture(["emulate", f"--archive={out}", f"--recording={played(folder, poses, hand)}"]) == 0
    return out
