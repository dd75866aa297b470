"""Angles and direction cosines as trackers send them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.skeleton.rotations import matrix
from shukotsu.trackers.protocols.pose_numbers import quaternion_of_angles, quaternion_of_cosines

ANGLE = st.floats(-360, 360)


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


@given(azimuth=ANGLE, elevation=ANGLE, roll=ANGLE)
def test_angles_turn_as_the_manual_says(azimuth: float, elevation: float, roll: float) -> None:
    found = quaternion_of_angles(np.array([[azimuth, elevation, roll]]))
    np.testing.assert_allclose(np.linalg.norm(found), 1, atol=1e-12)
    np.testing.assert_allclose(matrix(found)[0], manual_matrix(azimuth, elevation, roll), atol=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        np.diag([1.0, 1.0, -1.0]),
        np.diag([1.0, 1.0, 1.02]),
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.full((3, 3), 1e300),
    ],
)
def test_a_matrix_that_is_no_rotation_is_none(bad: np.ndarray) -> None:
    found = quaternion_of_cosines(np.stack([bad, np.eye(3), np.round(manual_matrix(10, 20, 30), 4)]))
    assert np.isnan(found[0]).all()
    assert found[1].tolist() == [1, 0, 0, 0]
    assert np.isfinite(found[2]).all()
