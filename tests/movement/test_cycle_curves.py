"""Averaging angles over cycles: known curves, gaps and missing cycles."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from shukotsu.hand.recorded_movement import AngleSeries
from shukotsu.hand.rotations import Array
from shukotsu.movement.cycles import MOST_EVENTS, PERCENT, Cycle, averaged_cycles, curve_rows, cut_cycles
from shukotsu.movement.sampling import grid_of

STEP_S = 1 / 240
TIME_S = 5.0 + STEP_S * np.arange(960)


def course(share: Array) -> Array:
    """Return the angle in deg at a share of the cycle."""
    return np.asarray(30.0 + 20.0 * np.sin(2 * np.pi * share))


def rows_of_cycles(time_s: Array, angle_deg: Array, cycles: list[Cycle]) -> list[dict[str, Any]]:
    grid = grid_of(time_s)
    assert grid is not None
    series = AngleSeries("index_pip", "flexion", angle_deg, None, "ok", "")
    return list(curve_rows(series, time_s, averaged_cycles([cycles]), grid))


def column(rows: list[dict[str, Any]], name: str) -> list[float]:
    return [row[name] for row in rows]


def test_a_sine_over_its_cycles_has_its_curve_and_no_spread() -> None:
    cycles = cut_cycles("tap", TIME_S[::96].tolist(), [np.nan] * 10)
    rows = rows_of_cycles(TIME_S, course((TIME_S - 5.0) / (96 * STEP_S)), cycles)
    assert column(rows, "cycle_percent") == PERCENT.tolist() == list(range(101))
    assert {row["n_cycles"] for row in rows} == {len(cycles)} == {9}
    np.testing.assert_allclose(column(rows, "mean_deg"), course(PERCENT / 100), atol=0.01)
    np.testing.assert_allclose(column(rows, "sd_deg"), 0.0, atol=1e-9)


def test_cycles_of_different_lengths_are_normalised_and_averaged() -> None:
    """The result equals NumPy's interpolation, mean and standard deviation over the cycles not refused."""
    onset_s = np.array([5.013, 5.4, 5.951, 6.3, 6.8001, 6.85])
    cycles = cut_cycles("tap", onset_s.tolist(), [np.nan] * 6)
    assert [bool(cycle.refusal) for cycle in cycles] == [False] * 4 + [True]
    angle = course(np.interp(TIME_S, onset_s, np.arange(6.0))) + 3.0 * (TIME_S - 5.0)
    courses = [np.interp(np.linspace(begin, end, 101), TIME_S, angle) for begin, end in pairwise(onset_s[:5])]
    rows = rows_of_cycles(TIME_S, angle, cycles)
    np.testing.assert_allclose(column(rows, "mean_deg"), np.mean(courses, axis=0))
    np.testing.assert_allclose(column(rows, "sd_deg"), np.std(courses, axis=0, ddof=1))
    assert min(column(rows, "sd_deg")) > 1.0


@pytest.mark.parametrize("lost", [False, True])
def test_a_cycle_is_averaged_only_where_it_was_measured(lost: bool) -> None:
    """The gap has no frames (lost) or frames without an angle."""
    cycles = cut_cycles("tap", TIME_S[::96].tolist(), [np.nan] * 10)
    angle, gap = course((TIME_S - 5.0) / (96 * STEP_S)), np.arange(960) // 12 == 11  # 37.5 to 50 % of the 2nd
    time_s = TIME_S[~gap] if lost else TIME_S
    rows = rows_of_cycles(time_s, angle[~gap] if lost else np.where(gap, np.nan, angle), cycles)
    without = [row["cycle_percent"] for row in rows if row["n_cycles"] == 8]
    assert without == list(range(37, 50)), "a point between a frame with an angle and a gap has none"
    assert {row["n_cycles"] for row in rows} == {8, 9}
    np.testing.assert_allclose(column(rows, "mean_deg"), course(PERCENT / 100), atol=0.01)
    alone = rows_of_cycles(time_s, angle[~gap] if lost else np.where(gap, np.nan, angle), cycles[1:2])
    assert [row["cycle_percent"] for row in alone if row["mean_deg"] is None] == without
    assert {row["sd_deg"] for row in alone} == {None}, "one cycle has no spread"


def test_an_unmeasured_joint_and_an_event_without_cycles_have_no_rows() -> None:
    cycles = cut_cycles("tap", [5.0, 6.0, 7.0], [np.nan] * 3)
    assert not rows_of_cycles(TIME_S, np.full(960, np.nan), cycles)
    refused = cut_cycles("tap", [5.0, 6.0], [np.nan] * 2, [np.inf] * 2)
    assert not averaged_cycles([refused])
    many = [cut_cycles(f"note {n}", [5.0 + s for s in range(n)], [1.0] * n) for n in range(1, 8)]
    assert [of_event[0].event for of_event in averaged_cycles(many)] == [
        f"note {n}" for n in range(7, 7 - MOST_EVENTS, -1)
    ]
