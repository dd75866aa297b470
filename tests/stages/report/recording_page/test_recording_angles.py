"""Joint angles of a recording: their ranges, and what a page packs of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.stages.report.recording_results import angle_ranges


@given(st.lists(st.floats(-180, 180), min_size=1, max_size=60), st.integers(0, 20))
def test_a_range_is_of_the_known_frames_alone(known: list[float], n_gaps: int) -> None:
    values = np.full((len(known) + n_gaps, 3), np.nan)
    values[: len(known), 1] = known
    (own,) = angle_ranges("j", values)
    assert (own.joint, own.angle, own.n_frames) == ("j", "abduction", len(known))
    assert (own.at_deg[0], own.at_deg[-1]) == (min(known), max(known))
    np.testing.assert_allclose(own.at_deg[2], np.median(known), atol=1e-9)
    np.testing.assert_allclose(own.at_deg[1::2], np.quantile(known, [0.025, 0.975]), atol=1e-9)
