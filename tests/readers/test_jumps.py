"""Jumps of single receivers to the opposite hemisphere: when."""

import numpy as np
import pytest

from shukotsu.readers.jumps import OwnSides, own_sides


def swinging(rate_hz: float, seconds: float = 10.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    frame = np.arange(int(seconds * rate_hz))
    phase = 2 * np.pi * 0.8 * frame / rate_hz
    position_mm = np.stack([300 + 50 * np.sin(phase), 80 * np.cos(phase), 30 * np.sin(2 * phase)], -1)
    return frame, frame / rate_hz, position_mm


def signs(detected: OwnSides, frame: np.ndarray) -> np.ndarray:
    sign = detected.sign[detected.piece_at(frame)]
    return np.asarray(sign * sign[0])


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("rate_hz", [40, 60, 240, 500])
def test_hemisphere_jumps_are_located_to_the_frame(rate_hz: int, timed: bool) -> None:
    frame, time_s, position_mm = swinging(rate_hz)
    true = np.where((time_s > 2) & (time_s < 5.5), -1, 1)
    detected = own_sides(frame, time_s if timed else np.full(len(frame), np.nan), position_mm * true[:, None])
    assert detected.changes
    assert len(np.unique(detected.run)) == 1
    assert (signs(detected, frame) == true).all()


@pytest.mark.parametrize("smear", [0.3, 0.6, 0.8])
def test_filtered_samples_during_a_jump_are_on_neither_side(smear: float) -> None:
    frame, time_s, position_mm = swinging(240)
    true = np.where((time_s > 2) & (time_s < 5.5), -1, 1)
    seen, lagging = position_mm * true[:, None], position_mm.copy()
    for row in range(1, len(frame)):
        seen[row] = smear * seen[row - 1] + (1 - smear) * seen[row]
        lagging[row] = smear * lagging[row - 1] + (1 - smear) * lagging[row]
    sign = signs(own_sides(frame, time_s, seen), frame)
    sided = sign != 0
    assert np.abs(seen - lagging * sign[:, None])[sided].max() < 30.0
    assert 0 < (~sided).sum() <= 60


def test_moving_past_the_transmitter_is_not_a_jump() -> None:
    frame = np.arange(240)
    position_mm = np.stack([np.linspace(-400, 400, 240), np.full(240, 60.0), np.zeros(240)], -1)
    detected = own_sides(frame, frame / 240, position_mm)
    assert not detected.changes
    assert len(detected.first) == 1
