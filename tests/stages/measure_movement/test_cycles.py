"""Cycles cut by events, and their mean course."""

import numpy as np
import pytest

from shukotsu.stages.measure_movement.cycles import (
    Cycle,
    cut_cycles,
    mean_curves,
    normalised,
    within_recording,
)

STEP_S = 1 / 240
NAN = float("nan")


def test_a_cycle_lasts_to_the_next_event_or_as_long_as_the_event() -> None:
    cycles = cut_cycles("tap", [3.0, 1.0, 2.0], [NAN, NAN, NAN])
    assert [(one.number, one.onset_s, one.duration_s) for one in cycles] == [(0, 1.0, 1.0), (1, 2.0, 1.0)]
    own = cut_cycles("note", [1.0, 2.0], [0.4, 0.5])
    assert [(one.onset_s, one.duration_s) for one in own] == [(1.0, 0.4), (2.0, 0.5)]
    assert cut_cycles("once", [1.0], [NAN]) == []


def test_cycles_of_another_length_are_refused() -> None:
    cycles = cut_cycles("tap", [0, 1, 2, 3, 3.2, 4.2, 7.2], [NAN] * 7)
    assert [one.refusal.partition(":")[0] for one in cycles] == ["", "", "", "too short", "", "too long"]


def test_cycles_whose_ends_are_not_known_are_refused() -> None:
    """By its own onset, by the next one that ends it, and by a weak clock; what nothing says is no error."""
    cycles = cut_cycles("tap", [0, 1, 2, 3, 4, 5], [NAN] * 6, [NAN, 0.04, 0.06, 0.0, 0.0, np.inf])
    reasons = ["", "known to 60 ms", "known to 60 ms", "", "clock of its events is weak"]
    for own, reason in zip(cycles, reasons, strict=True):
        assert reason in own.refusal
        assert bool(reason) == bool(own.refusal)


def test_cycles_beyond_the_recording_are_refused() -> None:
    cycles = within_recording(cut_cycles("tap", [0.0, 1.0, 2.0], [0.9] * 3), np.array([0.5, 2.5]))
    assert [bool(one.refusal) for one in cycles] == [True, False, True]


@pytest.mark.parametrize("duration_s", [0.5, 0.731])
def test_a_cycle_is_read_at_its_own_percents(duration_s: float) -> None:
    """Onset and end lie between frames."""
    time_s = 10 + np.arange(1000) * STEP_S
    cycle = Cycle("tap", 0, 11.0013, duration_s)
    found = normalised(np.column_stack([time_s, 2 * time_s]), time_s, cycle)
    expected = cycle.onset_s + np.linspace(0, duration_s, 101)
    np.testing.assert_allclose(found, np.column_stack([expected, 2 * expected]))


def test_a_gap_leaves_out_the_column_and_the_cycle_that_it_is_in() -> None:
    time_s = np.arange(720) * STEP_S
    values = np.column_stack([np.sin(2 * np.pi * time_s), np.cos(2 * np.pi * time_s)])
    values[300, 1] = np.nan
    cycles = cut_cycles("tap", [0.0, 1.0, 2.0], [0.99, 0.99, 0.99])
    curves = np.stack([normalised(values, time_s, one) for one in cycles])
    mean, sd, count = mean_curves(curves)
    assert count.tolist() == [3, 2]
    np.testing.assert_allclose(mean[:, 1], curves[[0, 2], :, 1].mean(0))
    np.testing.assert_allclose(sd[:, 0], curves[:, :, 0].std(0, ddof=1), atol=1e-12)
