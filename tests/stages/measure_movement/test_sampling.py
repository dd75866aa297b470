"""The grid of time, and which gaps are bridged."""

import numpy as np
import pytest

from shukotsu.stages.measure_movement.sampling import MOST_GAP_S, bridged, grid_of

STEP_S = 1 / 240


def test_lost_frames_leave_empty_places() -> None:
    time_s = 3.0 + STEP_S * np.array([0, 1, 2, 5, 6])
    grid = grid_of(time_s)
    assert grid is not None
    assert grid.place.tolist() == [0, 1, 2, 5, 6]
    assert grid.step_s == pytest.approx(STEP_S)
    spread = grid.spread(np.arange(5.0)[:, None])
    assert np.isnan(spread[:, 0]).tolist() == [False, False, False, True, True, False, False]
    assert spread[grid.place, 0].tolist() == [0, 1, 2, 3, 4]


def _stamped(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Frames of twenty seconds that are there, and the times that they are stamped with."""
    g, frame = np.random.default_rng(4), np.arange(4800)
    if kind == "most lost":
        frame = frame[g.random(4800) > 0.6]
    elif kind == "some lost":
        frame = frame[g.random(4800) > 0.2]
    time_s = 7.0 + frame * STEP_S
    stamped = {
        "milliseconds": np.round(time_s, 3),
        "some lost": np.round(time_s, 3),
        "a host's ticks": np.floor(time_s / 0.015625) * 0.015625,
        "jitter": time_s + g.normal(0.0, 0.3 * STEP_S, len(frame)),
    }
    return frame, stamped.get(kind, time_s)


@pytest.mark.parametrize("kind", ["milliseconds", "some lost", "most lost", "a host's ticks", "jitter"])
def test_the_rate_is_that_of_the_frames_whatever_their_stamps(kind: str) -> None:
    frame, time_s = _stamped(kind)
    grid = grid_of(time_s)
    assert grid is not None
    assert grid.step_s == pytest.approx(STEP_S, rel=1e-3)
    assert grid.place.tolist() == (frame - frame[0]).tolist()


def test_short_gaps_are_straight_lines_and_long_ones_stay() -> None:
    longest = int(MOST_GAP_S / STEP_S)
    values = np.column_stack([np.arange(100.0), 2 * np.arange(100.0)])
    gapped = values.copy()
    gapped[10 : 10 + longest, 0] = np.nan
    gapped[50 : 51 + longest, 0] = np.nan
    gapped[:3, 1] = gapped[-2:, 1] = np.nan
    filled = bridged(gapped, STEP_S)
    np.testing.assert_allclose(filled[:50, 0], values[:50, 0])
    assert np.isnan(filled[50 : 51 + longest, 0]).all()
    assert np.isnan(filled[:3, 1]).all()
    assert np.isnan(filled[-2:, 1]).all()
    assert np.isnan(gapped[10, 0])  # what was given is as it was
