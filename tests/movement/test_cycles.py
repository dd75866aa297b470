"""Cycles cut by events."""

import numpy as np

from shukotsu.movement.events import cut_cycles, within_recording

NAN = float("nan")


def test_a_cycle_lasts_to_the_next_event_or_as_long_as_the_event() -> None:
    cycles = cut_cycles("tap", [3.0, 1.0, 2.0], [NAN, NAN, NAN])
    assert [(cycle.number, cycle.onset_s, cycle.duration_s) for cycle in cycles] == [
        (0, 1.0, 1.0),
        (1, 2.0, 1.0),
    ]
    notes = cut_cycles("note", [1.0, 2.0], [0.4, 0.5])
    assert [(cycle.onset_s, cycle.duration_s) for cycle in notes] == [(1.0, 0.4), (2.0, 0.5)]
    assert cut_cycles("once", [1.0], [NAN]) == []


def test_cycles_of_another_length_are_refused() -> None:
    cycles = cut_cycles("tap", [0, 1, 2, 3, 3.2, 4.2, 7.2], [NAN] * 7)
    assert [cycle.refusal.partition(":")[0] for cycle in cycles] == ["", "", "", "too short", "", "too long"]


def test_cycles_whose_ends_are_not_known_are_refused() -> None:
    """By its own onset, by the next one that ends it, and by a weak clock; what nothing says is no error."""
    cycles = cut_cycles("tap", [0, 1, 2, 3, 4, 5], [NAN] * 6, [NAN, 0.04, 0.06, 0.0, 0.0, np.inf])
    reasons = ["", "known to 60 ms", "known to 60 ms", "", "clock of its events is weak"]
    for cycle, reason in zip(cycles, reasons, strict=True):
        assert reason in cycle.refusal
        assert bool(reason) == bool(cycle.refusal)
    cycles = within_recording(cut_cycles("tap", [0.0, 1.0, 2.0], [0.9] * 3), np.array([0.5, 2.5]))
    assert [bool(cycle.refusal) for cycle in cycles] == [True, False, True]
