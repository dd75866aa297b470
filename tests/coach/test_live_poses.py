"""Poses of a growing archive against those that importing the whole gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from coached_hands import calibration

from shukotsu.__main__ import main as capture
from shukotsu.coach.live_poses import MOST_FRAMES, EvenFrames, LivePoses
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import read_poses
from shukotsu.stages.fit_hand.receiver_frames import concatenated
from shukotsu.trackers.archive import open_archive


def test_they_are_the_poses_of_an_import(recorded: Path, tmp_path: Path) -> None:
    live = LivePoses(read_layout("liberty16"), recorded)
    parts = [poses for piece in open_archive(recorded).pieces() if (poses := live.add(piece)) is not None]
    poses, table = concatenated(parts), tmp_path / "poses.parquet"
    who = ["--layout=liberty16", "--subject=03", "--hand=right", "--task=rom"]
    assert capture(["import", f"--in={recorded}", f"--out={table}", *who]) == 0
    expected = read_poses(table, read_layout("liberty16").measured)
    assert live.ended
    np.testing.assert_array_equal(poses.frame, expected.frame)
    np.testing.assert_array_equal(poses.valid, expected.valid)
    np.testing.assert_allclose(
        poses.position_mm[poses.valid], expected.position_mm[expected.valid], atol=1e-9
    )
    np.testing.assert_allclose(poses.quaternion[poses.valid], expected.quaternion[expected.valid], atol=1e-9)
    assert np.ptp(poses.time_s - expected.time_s) < 1e-4


def test_memory_of_a_long_recording_is_bounded() -> None:
    frames, poses = EvenFrames(), calibration(7.0)
    for _ in range(40):
        frames.add(poses)
    kept = frames.poses()
    assert len(kept.frame) <= MOST_FRAMES
    assert len({*kept.frame.tolist()}) > 100
