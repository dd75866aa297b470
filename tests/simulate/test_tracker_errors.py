"""Faults of the simulated tracker: how often, how large, and what they leave alone."""

from __future__ import annotations

import numpy as np

from shukotsu.hand.rotations import angle, conjugate, matrix, multiply
from shukotsu.simulate.tracker_errors import (
    FIELD_CENTRE_MM,
    FLIPPED_SHARE,
    LOST_SHARE,
    SPIKE_MM,
    SPIKE_SHARE,
    distorted,
    faulty,
)

SHAPE = (48_000, 8)
TIMES = 4.0


def test_each_component_of_a_field_is_off_as_published() -> None:
    """50 mm from where it is calibrated: 0.3 deg of rotation and 0.1 mm of place in each component, in any
    direction, over many rooms; the frame of the transmitter turns, whichever way the receiver faces.
    """
    place = FIELD_CENTRE_MM + 50.0 * np.array([[1.0, 0.0, 0.0], [0.6, 0.0, -0.8]])
    facing = np.array([[0.5, 0.5, -0.5, 0.5], [0.8, 0.0, 0.6, 0.0]])
    turns, shifts = [], []
    for room in range(800):
        seen_mm, seen = distorted(place, facing, room, 1.0)
        turn = matrix(seen) @ np.swapaxes(matrix(facing), -1, -2)
        turns.append(np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], -1))  # small: sines are angles
        shifts.append(seen_mm - place)
    np.testing.assert_allclose(np.degrees(np.std(turns, 0)), 0.3, rtol=0.12)
    np.testing.assert_allclose(np.std(shifts, 0), 0.1, rtol=0.12)


def test_faults_are_losses_flips_and_spikes_of_their_shares() -> None:
    position = np.full((*SHAPE, 3), 200.0)
    quaternion = np.tile([0.8, 0.0, 0.6, 0.0], (*SHAPE, 1))
    seen, turned = faulty(position, quaternion, TIMES, np.random.default_rng(1))
    lost = np.isnan(seen).any(-1)
    np.testing.assert_array_equal(lost, np.isnan(turned).any(-1))
    assert 0.8 < lost.mean() / (TIMES * LOST_SHARE) < 1.2
    flipped = (seen < 0).all(-1)
    assert 0.75 < flipped.mean() / (TIMES * FLIPPED_SHARE) < 1.25
    jumped = (np.abs(np.abs(seen) - 200.0) > 1e-9).any(-1) & ~lost
    assert 0.8 < jumped.mean() / (TIMES * SPIKE_SHARE) < 1.2
    assert 0.9 < (np.abs(seen[jumped]) - 200.0).std() / SPIKE_MM < 1.1
    sound = ~(lost | jumped)
    np.testing.assert_allclose(np.linalg.norm(turned[sound], axis=-1), 1.0)
    assert angle(multiply(conjugate(quaternion[sound]), turned[sound])).max() < 1e-6
    assert 0.3 < (turned[sound][:, 0] < 0).mean() < 0.5  # the same rotation, the other sign
