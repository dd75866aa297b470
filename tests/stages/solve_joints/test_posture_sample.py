"""The sample of frames: the same however the recording is cut, of fixed size, without regard to dwelling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.solve_joints.moments import RelativePoses, relative_poses
from shukotsu.stages.solve_joints.posture_sample import (
    FRAMES_PER_CELL,
    MAX_CELLS,
    SpreadFrames,
    SpreadSample,
    rotation_vector,
)


def poses_of(turn: Rotation, valid: Array | None = None) -> RelativePoses:
    """A joint whose parent lies at the origin."""
    n_frames = len(turn)
    quaternion = np.stack([np.tile([1.0, 0.0, 0.0, 0.0], (n_frames, 1)), np.roll(turn.as_quat(), 1, -1)], 1)
    position_mm = np.zeros((n_frames, 2, 3))
    position_mm[:, 1] = np.arange(3.0 * n_frames).reshape(-1, 3)
    usable = np.ones((n_frames, 2), bool)
    if valid is not None:
        usable[:, 1] = valid.astype(bool)
    return relative_poses(quaternion, position_mm, usable, np.array([0]), np.array([1]))


def sampled(poses: RelativePoses, cuts: list[int]) -> SpreadFrames:
    sample = SpreadSample(0)
    for start, stop in zip([0, *cuts], [*cuts, len(poses.valid)], strict=True):
        sample.add(poses.take(slice(start, stop)), 0, ())
    return sample.frames()


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 3000), max_size=5).map(sorted))
@settings(max_examples=20)
def test_blocks_of_any_size_give_the_same_sample(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    poses = poses_of(
        Rotation.from_rotvec(np.cumsum(rng.normal(size=(3000, 3)), 0) * 0.02), rng.random(3000) < 0.9
    )
    whole, parts = sampled(poses, []), sampled(poses, cuts)
    np.testing.assert_array_equal(parts.quaternion, whole.quaternion)
    np.testing.assert_array_equal(parts.position_mm, whole.position_mm)
    np.testing.assert_array_equal(parts.lone, whole.lone)


def test_memory_does_not_grow() -> None:
    """However many frames come, and wherever they turn, a bounded number is kept."""
    rng = np.random.default_rng(1)
    sample = SpreadSample(0)
    for _ in range(20):
        sample.add(poses_of(Rotation.random(2000, random_state=rng)), 0, ())
        assert len(sample.frames().quaternion) <= MAX_CELLS * FRAMES_PER_CELL
        assert len(sample._cells) <= MAX_CELLS


def test_dwelling_gains_nothing_and_the_extremes_stay() -> None:
    """Nine tenths of a recording in one posture: a few frames of the sample; the farthest postures are in."""
    moving = 0.8 * np.sin(np.linspace(0, 20 * np.pi, 4000))
    angle = np.concatenate([np.full(36000, 0.3), moving])
    kept = sampled(poses_of(Rotation.from_rotvec(angle[:, None] * [0, 1, 0])), [])
    found = rotation_vector(kept.quaternion)[:, 1]
    assert np.mean(np.abs(found - 0.3) < 0.02) < 0.1
    assert found.min() == pytest.approx(moving.min(), abs=0.01)
    assert found.max() == pytest.approx(moving.max(), abs=0.01)
