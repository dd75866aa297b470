"""Angles and direction cosines as trackers send them."""

import numpy as np
import pytest

from shukotsu.skeleton.rotations import matrix
from shukotsu.trackers.protocols.records import quaternion_of_angles, quaternion_of_cosines


def manual_matrix(azimuth: float, elevation: float, roll: float) -> np.ndarray:
    """The attitude matrix as the LIBERTY manual prints it, element by element."""
    ca, ce, cr = np.cos(np.radians([azimuth, elevation, roll]))
    sa, se, sr = np.sin(np.radians([azimuth, elevation, roll]))
    return np.array(
        [
            [ca * ce, ca * se * sr - sa * cr, ca * se * cr + sa * sr],
            [sa * ce, ca * cr + sa * se * sr, sa * se * cr - ca * sr],
            [-se, ce * sr, ce * cr],
        ]
    )


def test_angles_turn_as_the_manual_says() -> None:
    angles = np.random.default_rng(2).uniform(-360, 360, (300, 3))
    turned = quaternion_of_angles(angles)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(matrix(turned), [manual_matrix(*row) for row in angles], atol=1e-12)


@pytest.mark.parametrize(
    "bad",
    [np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 1.02]), *(np.full((3, 3), x) for x in (0, np.nan, 1e300))],
)
def test_a_matrix_that_is_no_rotation_is_none(bad: np.ndarray) -> None:
    turned = quaternion_of_cosines(np.stack([bad, np.eye(3), np.round(manual_matrix(10, 20, 30), 4)]))
    assert np.isnan(turned[0]).all()
    assert turned[1].tolist() == [1, 0, 0, 0]
    assert np.isfinite(turned[2]).all()
