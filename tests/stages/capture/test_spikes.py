"""Spikes: frames that jump away and come back are found, whatever else a receiver does is not."""

import numpy as np
import pytest

from shukotsu.stages.capture.spikes import spikes


def swinging(n_frames: int = 240, rate_hz: float = 240.0) -> np.ndarray:
    """Poses (N, 7) of a receiver that moves at 1 m/s and turns at 1 rad/s."""
    time_s = np.arange(n_frames) / rate_hz
    half, none = time_s / 2, np.zeros(n_frames)
    return np.stack([1000 * time_s, none + 300, none, np.cos(half), np.sin(half), none, none], -1)


@pytest.mark.parametrize(("rate_hz", "length"), [(240.0, 1), (240.0, 3), (240.0, 5), (30.0, 1), (30.0, 3)])
@pytest.mark.parametrize("kind", ["place", "turn"])
def test_a_spike_is_its_frames_alone(length: int, kind: str, rate_hz: float) -> None:
    poses = swinging(rate_hz=rate_hz)
    if kind == "place":
        poses[10 : 10 + length, 0] += 10_000.0
    else:
        poses[10 : 10 + length, 3:] = [0.0, 0.0, 1.0, 0.0]
    assert np.flatnonzero(spikes(poses)).tolist() == [*range(10, 10 + length)]


@pytest.mark.parametrize(("end", "moved_mm"), [(240, 1e4), (16, 1e4), (11, 50.0), (10, 0.0)])
def test_a_jump_that_stays_and_a_small_one_are_none(end: int, moved_mm: float) -> None:
    poses = swinging()
    poses[10:end, 0] += moved_mm
    assert not spikes(poses).any()
