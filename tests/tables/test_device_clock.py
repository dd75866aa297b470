"""The duration of a recording and faults of the device's clock."""

import numpy as np
import pytest

from shukotsu.arrays import Array
from shukotsu.movement.sampling import grid_of
from shukotsu.tables.device_clock import DAY_S, device_clock

T = np.arange(3600) / 240
FRAME = np.arange(3600)
LATE = FRAME >= 1800
WRAP_S = 2**32 / 1000
STOOD = (FRAME >= 1800) & (FRAME < 2400)


@pytest.mark.parametrize(
    ("time_s", "kind", "by_s"),
    [
        (T + 3600 * LATE, "ahead", 3600.0),
        (T + 1.77e9 * LATE, "ahead", 1.77e9),
        (T - T[1800] * LATE, "back", T[1799]),
        (T + 9e4 - DAY_S * LATE, "midnight", DAY_S),
        (T - WRAP_S * LATE, "wrap", WRAP_S),
        (np.where(STOOD, T[1800], T), "still", 0.0),
        (np.where(LATE, T[1800], T), "still", 0.0),
    ],
)
def test_a_clock_fault_is_located_and_the_duration_right(time_s: Array, kind: str, by_s: float) -> None:
    duration_s, (step,) = device_clock(time_s, FRAME)
    assert duration_s == pytest.approx(T[-1], abs=1e-4)
    assert (step.kind, step.row, step.by_s) == (kind, 1800, pytest.approx(by_s, rel=1e-6))
    grid = grid_of(time_s)
    assert grid is not None
    assert grid.step_s == pytest.approx(1 / 240, rel=1e-6), "speeds are not affected"


@pytest.mark.parametrize("time_s", [T, np.floor(T), np.floor(T * 30) / 30, np.round(T, 3)])
def test_coarse_or_bursty_time_stamps_are_not_faults(time_s: Array) -> None:
    assert device_clock(time_s, FRAME) == (pytest.approx(T[-1], abs=1e-3), [])


def test_a_clock_that_stands_still_gives_no_duration() -> None:
    duration_s, (step,) = device_clock(np.full(3600, 7.0))
    assert (duration_s, step.kind, step.rows) == (None, "still", 3600)
    assert device_clock(np.full(9, np.nan)) == (None, [])
    assert device_clock(T + 5 * LATE, FRAME + 1200 * LATE)[1] == [], "as many frames are missing"
