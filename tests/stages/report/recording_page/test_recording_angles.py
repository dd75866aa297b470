"""Joint angles of a recording: their ranges, and what a page packs of them."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from report_samples.unpacked_motion import unpacked

from stages.report.recording_page.recording_content import ANGLE_STEP_DEG, angle_blocks, angle_ranges
from stages.report.recording_results import JointAngles
from stages.report.viewer.packed_motion import packed


@given(st.lists(st.floats(-180, 180), min_size=1, max_size=60), st.integers(0, 20))
def test_a_range_is_of_the_known_frames_alone(known: list[float], n_gaps: int) -> None:
    values = np.full((len(known) + n_gaps, 1, 3), np.nan)
    values[: len(known), 0, 1] = known
    (own,) = angle_ranges(JointAngles("m", ("j",), values))
    assert (own.joint, own.angle, own.n_frames) == ("j", "abduction", len(known))
    assert (own.at_deg[0], own.at_deg[-1]) == (min(known), max(known))
    np.testing.assert_allclose(own.at_deg[2], np.median(known), atol=1e-9)
    np.testing.assert_allclose(own.at_deg[1::2], np.quantile(known, [0.025, 0.975]), atol=1e-9)


@given(st.lists(st.floats(-180, 180) | st.just(math.nan), min_size=3, max_size=40))
def test_a_packed_angle_prints_as_the_tables_own_to_a_tenth(values: list[float]) -> None:
    angle = np.array(values)[:, None, None] * [1.0, 0.5, -1.0]
    (block,) = angle_blocks([JointAngles("m", ("j",), angle)], 1)
    assert (block.name, block.step) == ("angles0", ANGLE_STEP_DEG)
    read = unpacked(*packed([block]))["angles0"]
    known = np.isfinite(angle).all(-1)
    np.testing.assert_array_equal(np.isfinite(read).all(-1), known)
    for shown, exact in zip(read[known].ravel(), angle[known].ravel(), strict=True):
        if abs(exact * 10 % 1 - 0.5) > 1e-6:  # a tie may go either way
            assert f"{shown + 0.0:.1f}".replace("-0.0", "0.0") == f"{exact:.1f}".replace("-0.0", "0.0")
