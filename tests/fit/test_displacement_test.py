"""Courses of displacements, and what a normal one can explain."""

import numpy as np

from shukotsu.fit.displacement_test import courses, most_within


def test_courses() -> None:
    """Steps sit long enough in both places, slides take a fifth of the recording, what returns ends at 0."""
    ways = courses(40)
    steps = (ways.start == ways.end) & ~ways.returns
    slides = (ways.start < ways.end) & ~ways.returns
    assert [*ways.start[steps]] == [*range(2, 39)]
    assert set(np.unique(ways.share[steps])) == {0.0, 1.0}
    assert (ways.end - ways.start)[slides].min() == 8
    assert (np.diff(ways.share[slides], axis=1) >= 0.0).all()
    assert (ways.share[ways.returns][:, [0, -1]] == 0.0).all()
    assert not len(courses(2).start)


def test_most_that_a_normal_displacement_gains() -> None:
    """All of the gain where the likeliest is normal; at the ellipsoid's edge where it is far outside."""
    curvature, radii = np.diag([4.0, 1.0, 1.0, 1.0, 1.0, 1.0])[None], np.full((1, 6), 1.0)
    for step, gain in ((0.5, 0.5), (3.0, 12.0 - 2.0)):
        slope = -4.0 * np.array([[step, 0.0, 0.0, 0.0, 0.0, 0.0]])
        np.testing.assert_allclose(most_within(radii, slope, curvature), gain, rtol=1e-6)
