"""The field of a source beside the hand."""

import numpy as np

from shukotsu.stages.fit_hand.field_test import Field


def test_a_field_falls_with_the_third_power() -> None:
    """It is largest where a receiver came nearest, and no larger beyond."""
    error = np.array([3.0, 0.0, 0.0, 0.0, 0.1, 0.0])
    field = Field(np.array([100.0, 0.0, 0.0]), np.zeros(3), error)
    at = field.at(np.array([[0.0, 0.0, 0.0], [-100.0, 0.0, 0.0], [90.0, 0.0, 0.0]]))
    np.testing.assert_allclose(at, [error, error / 8, error])
