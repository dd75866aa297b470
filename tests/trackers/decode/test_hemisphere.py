"""Hemisphere flips: found where a tracker makes them, with its filter's smear, and nowhere else."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trackers.decode.hemisphere import FlipFinder, flip_states

H = (1.0, 0.0, 0.0)


def reported(true: np.ndarray, smear: float, hemisphere=H) -> np.ndarray:
    """What a tracker reports: the position or its mirror image, through a one-pole filter."""
    side = np.where(true @ np.array(hemisphere) < 0, -1.0, 1.0)[:, None]
    out = true * side
    for n in range(1, len(out)):
        out[n] = smear * out[n - 1] + (1 - smear) * out[n]
    return out


def swing(frames: int, speed: float = 1.0) -> np.ndarray:
    """A receiver that goes to and fro through the plane x = 0, 32 cm to the side."""
    t = np.arange(frames) / 240
    return np.stack([4 * np.cos(speed * 2 * np.pi * t), np.full(frames, -32.0), -2.8 + t], -1)


def find(position: np.ndarray, quaternion=None, hemisphere=H, cuts=()):
    frame = np.arange(len(position))
    if quaternion is None:
        quaternion = np.tile([1.0, 0, 0, 0], (len(position), 1))
    finder = FlipFinder(3, hemisphere)
    edges = [0, *sorted(cuts), len(position)]
    for a, b in pairwise(edges):
        finder.feed(frame[a:b], position[a:b], quaternion[a:b])
    finder.feed(frame[:0], position[:0], quaternion[:0], final=True)
    return finder.flips


@pytest.mark.parametrize("smear", [0.0, 0.3, 0.5])
def test_each_crossing_is_one_flip_and_is_put_back(smear: float) -> None:
    true = swing(960)
    seen = reported(true, smear)
    flips = find(seen)
    crossings = np.flatnonzero(np.diff(np.sign(true[:, 0])))
    assert len(flips) == len(crossings) == 8
    for flip, crossing in zip(flips, crossings, strict=True):
        assert flip.before <= crossing < flip.after <= crossing + 12
    transit, flipped = flip_states(flips, np.arange(len(true)))
    repaired = np.where(flipped[:, None], -seen, seen)
    assert np.linalg.norm(repaired - true, axis=1)[~transit].max() < (0.03 + 0.05 * (smear > 0)) * 32
    assert transit.sum() <= 8 * 9


def test_a_recorded_flip() -> None:
    """Positions (inches) as a LIBERTY gave them when a receiver crossed x = 0."""
    seen = [(0.02, -31.96, -2.80)] * 20
    seen += [(0.03, -0.24, -0.07), (0.04, 0.62, 0.0), (0.04, 0.56, -0.01), (0.06, 18.3, 1.61)]
    seen += [(0.05, 28.98, 2.64)] + [(0.08, 31.12, 2.84)] * 20
    (flip,) = find(np.array(seen))
    assert (flip.before, flip.after) == (19, 25)
    transit, flipped = flip_states([flip], np.arange(len(seen)))
    assert np.flatnonzero(transit).tolist() == [20, 21, 22, 23, 24]
    assert np.flatnonzero(flipped).tolist() == list(range(25, len(seen)))
    assert np.linalg.norm(-np.array(seen[25]) - np.array(seen[19])) < 1.0


def test_a_receiver_carried_round_the_transmitter_is_none() -> None:
    angle = np.linspace(0, 20 * np.pi, 4800)
    round_it = np.stack([30 * np.cos(angle), 30 * np.sin(angle), np.full(4800, 5.0)], -1)
    assert find(round_it, hemisphere=None) == []


def test_one_that_turns_over_meanwhile_is_none() -> None:
    """Two places and two orientations: the recording was interrupted and the receiver carried over."""
    position = np.repeat([[1.0, 30, 5], [-1.0, -30, -5]], 50, 0)
    quaternion = np.repeat([[1.0, 0, 0, 0], [0.0, 0, 1, 0]], 50, 0)
    assert find(position, quaternion) == []
    assert len(find(position)) == 1


def test_far_above_the_plane_is_none() -> None:
    position = np.repeat([[30.0, 3, 5], [-30.0, -3, -5]], 50, 0)
    assert len(find(position, hemisphere=None)) == 1
    assert find(np.abs(position) * [[1, 1, 1]] * np.repeat([[1, 1, 1], [1, -1, -1]], 50, 0)) == []


@settings(max_examples=40)
@given(st.lists(st.integers(0, 960), max_size=8), st.sampled_from([0.0, 0.4]))
def test_where_pieces_end_does_not_matter(cuts: list[int], smear: float) -> None:
    seen = reported(swing(960), smear)
    assert find(seen, cuts=cuts) == find(seen)


def test_gaps_do_not_hide_a_flip() -> None:
    true = swing(480)
    seen = reported(true, 0.0)
    frame = np.arange(480)
    kept = frame % 5 != 0
    finder = FlipFinder(1, H)
    finder.feed(frame[kept], seen[kept], np.tile([1.0, 0, 0, 0], (int(kept.sum()), 1)))
    finder.feed(frame[:0], seen[:0], np.empty((0, 4)), final=True)
    assert len(finder.flips) == 4
