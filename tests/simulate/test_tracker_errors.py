"""Faults of the simulated tracker: how often, how large, and what they leave alone."""

from __future__ import annotations

import numpy as np

from shukotsu.hand.rotations import matrix
from shukotsu.simulate.tracker_errors import (
    FIELD_CENTRE_MM,
    distorted,
)


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
