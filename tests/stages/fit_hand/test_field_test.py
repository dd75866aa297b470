"""The field of a source beside the hand."""

import numpy as np

from stages.fit_hand.field_test import DISTANCES_MM, Field, fields


def test_a_field_falls_with_the_third_power() -> None:
    """It is largest where a receiver came nearest, and no larger beyond."""
    error = np.array([3.0, 0.0, 0.0, 0.0, 0.1, 0.0])
    field = Field(np.array([100.0, 0.0, 0.0]), np.zeros(3), error)
    at = field.at(np.array([[0.0, 0.0, 0.0], [-100.0, 0.0, 0.0], [90.0, 0.0, 0.0]]))
    np.testing.assert_allclose(at, [error, error / 8, error])


def test_sources_are_tried_all_round() -> None:
    """Each beside the place that reaches farthest towards it."""
    places = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, -30.0, 0.0]])
    tried = fields(places)
    assert len(tried) == 26 * len(DISTANCES_MM)
    sources = np.array([field.source for field in tried])
    assert (sources.max(0) > 0.0).all()
    assert (sources.min(0) < 0.0).all()
    for field in tried:
        towards = places @ (field.source - field.nearest)
        np.testing.assert_array_equal(field.nearest, places[np.argmax(towards)])
