"""Angles of a recording as they run on beyond half a turn."""

import numpy as np
import pytest

from shukotsu.hand.recorded_movement import running_on

TIME_S = np.arange(2400) / 240


def wrapped(angle_deg: np.ndarray) -> np.ndarray:
    """Angles as a table has them, within (-180, 180]."""
    return 180.0 - np.mod(180.0 - angle_deg, 360.0)


@pytest.mark.parametrize("middle_deg", [170.0, -175.0, 180.0, 60.0])
def test_an_angle_that_passes_half_a_turn_runs_on(middle_deg: float) -> None:
    true_deg = middle_deg + 40.0 * np.sin(2 * np.pi * TIME_S) + 0.3
    found = running_on(np.column_stack([wrapped(true_deg), 30.0 * np.cos(TIME_S)]))
    turns = (found[:, 0] - true_deg) / 360.0
    assert turns == pytest.approx(np.full(len(TIME_S), np.round(turns[0])), abs=1e-9)
    assert abs(np.median(found[:, 0])) <= 181.0
    assert found[:, 1] == pytest.approx(30.0 * np.cos(TIME_S))


def test_gaps_stay_and_say_nothing_of_turns() -> None:
    true_deg = 175.0 + 30.0 * np.sin(2 * np.pi * TIME_S)
    gapped = wrapped(true_deg)
    gapped[100:900] = np.nan
    found = running_on(np.column_stack([gapped, np.full(len(TIME_S), np.nan)]))
    assert np.isnan(found[100:900, 0]).all()
    assert np.isnan(found[:, 1]).all()
    assert np.nanmax(found[:, 0]) - np.nanmin(found[:, 0]) == pytest.approx(60.0, abs=0.1)


def test_a_wide_range_that_does_not_pass_half_a_turn_is_as_it_was() -> None:
    angle_deg = np.linspace(-110.0, 120.0, 500)[:, None]
    assert running_on(angle_deg) is angle_deg
    assert running_on(np.empty((0, 3))).shape == (0, 3)
