"""Speeds of known motion, and what noise does to them."""

import numpy as np
import pytest

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.sampling import (
    CUTOFF_HZ,
    half_width,
    speed,
    velocity,
    velocity_noise_sd,
)

STEP_S = 1 / 240


def sine(frequency_hz: float, step_s: float, seconds: float = 4.0) -> tuple[Array, Array]:
    """A sine of amplitude 20 and its rate of change, (T, 1)."""
    phase = 2 * np.pi * frequency_hz * np.arange(0, seconds, step_s)[:, None]
    return 20 * np.sin(phase), 20 * 2 * np.pi * frequency_hz * np.cos(phase)


def test_a_parabola_has_its_own_slope() -> None:
    time_s = np.arange(100)[:, None] * STEP_S
    found = velocity(3 + 5 * time_s - 7 * time_s**2, STEP_S)
    inside = slice(half_width(STEP_S), -half_width(STEP_S))
    np.testing.assert_allclose(found[inside], (5 - 14 * time_s)[inside])
    assert np.isnan(found[: half_width(STEP_S)]).all()


@pytest.mark.parametrize("rate_hz", [60, 120, 240, 960])
def test_a_finger_has_the_same_speed_at_any_rate(rate_hz: int) -> None:
    angle, true = sine(1.5, 1 / rate_hz)
    found = velocity(angle, 1 / rate_hz)
    known = np.isfinite(found)
    assert np.abs(found - true)[known].max() < 0.03 * np.abs(true).max()


@pytest.mark.parametrize("rate_hz", [240, 960])
def test_the_window_passes_half_the_power_at_the_cut_off(rate_hz: int) -> None:
    """The local parabola's value at a sine of the cut-off, by least squares."""
    width = half_width(1 / rate_hz)
    kept = []
    for half in (width, width + 1):
        k = np.arange(-half, half + 1)
        fitted = np.polynomial.Polynomial.fit(k, np.cos(2 * np.pi * CUTOFF_HZ / rate_hz * k), 2)
        kept.append(float(fitted(0.0)) ** 2)
    assert kept[0] >= 0.5 > kept[1]


@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_the_noise_of_a_speed_is_told_from_the_recording(moving: float) -> None:
    noise = np.random.default_rng(1).normal(0, 0.1, (20000, 2))
    angle = moving * sine(3.0, STEP_S, 20000 * STEP_S)[0][:20000] + noise
    left = velocity(noise, STEP_S)
    np.testing.assert_allclose(velocity_noise_sd(angle, STEP_S), np.nanstd(left, axis=0), rtol=0.1)


def test_noise_at_rest_is_hardly_a_speed_and_leaves_a_movement_its_own() -> None:
    noise = np.random.default_rng(2).normal(0, 0.1, (5000, 1))
    at_rest = velocity(noise, STEP_S)
    assert np.nanmedian(speed([noise], STEP_S)) < 0.3 * np.nanmedian(np.abs(at_rest))
    angle, true = sine(1.0, STEP_S, 5000 * STEP_S)
    found = speed([angle[:5000] + noise], STEP_S)
    assert np.nanpercentile(found, 95) == pytest.approx(np.percentile(np.abs(true), 95), rel=0.02)
