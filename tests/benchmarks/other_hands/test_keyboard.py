"""Somebody who presses keys comes down on one level, at the time that is said, and stops there."""

from __future__ import annotations

import numpy as np

from benchmarks.other_hands import draw_person
from benchmarks.other_hands.carriage import carry, placed
from benchmarks.other_hands.keyboard import press_keys


def test_fingers_stop_on_one_level_when_they_are_said_to() -> None:
    person, time_s = draw_person(3), np.arange(6000) / 1000
    angles, presses = press_keys(person, np.random.default_rng(1), time_s, 0.4, 0.0)
    bones, _ = carry(person, angles)
    levels = []
    for press in presses:
        digit = f"{press.digit}_distal"
        height = placed(bones[digit], person.bones[digit].end)[:, 2]
        at = round(1000 * press.bottom_s)
        levels.append(height[at])
        assert height[at - 1] - height[at] > 0.15, "it comes fast"
        assert np.ptp(height[at + 4 : at + 50]) < 1e-6, "and rests"
    assert np.ptp(levels) < 0.5, "a frame is 0.3 mm"
