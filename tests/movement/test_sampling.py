"""Time grids, bridged gaps, and speeds of known motions with and without noise."""

import numpy as np
import pytest

from shukotsu.arrays import Array
from shukotsu.movement import sampling

STEP_S = 1 / 240


def test_lost_frames_are_empty_on_the_grid() -> None:
    time_s = 3.0 + STEP_S * np.array([0, 1, 2, 5, 6])
    grid = sampling.grid_of(time_s)
    assert grid is not None
    assert grid.index.tolist() == [0, 1, 2, 5, 6]
    assert grid.step_s == pytest.approx(STEP_S)
    spread = grid.spread(np.arange(5.0)[:, None])
    assert np.isnan(spread[:, 0]).tolist() == [False, False, False, True, True, False, False]
    assert spread[grid.index, 0].tolist() == [0, 1, 2, 3, 4]


def _stamped(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the frame numbers present in 20 s at 240 Hz and their time stamps in s."""
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
def test_the_rate_is_found_from_imprecise_time_stamps(kind: str) -> None:
    frame, time_s = _stamped(kind)
    grid = sampling.grid_of(time_s)
    assert grid is not None
    assert grid.step_s == pytest.approx(STEP_S, rel=1e-3)
    assert grid.index.tolist() == (frame - frame[0]).tolist()


def test_short_gaps_are_interpolated_linearly_and_long_ones_stay() -> None:
    longest = int(sampling.MOST_GAP_S / STEP_S)
    values = np.column_stack([np.arange(100.0), 2 * np.arange(100.0)])
    gapped = values.copy()
    gapped[10 : 10 + longest, 0] = np.nan
    gapped[50 : 51 + longest, 0] = np.nan
    gapped[:3, 1] = gapped[-2:, 1] = np.nan
    filled = sampling.bridge_gaps(gapped, STEP_S)
    np.testing.assert_allclose(filled[:50, 0], values[:50, 0])
    assert np.isnan(filled[50 : 51 + longest, 0]).all()
    assert np.isnan(filled[:3, 1]).all()
    assert np.isnan(filled[-2:, 1]).all()
    assert np.isnan(gapped[10, 0])  # the input is unchanged


def sine(frequency_hz: float, step_s: float, seconds: float = 4.0) -> tuple[Array, Array]:
    """Return a sine of amplitude 20 and its derivative, both (T, 1)."""
    phase = 2 * np.pi * frequency_hz * np.arange(0, seconds, step_s)[:, None]
    return 20 * np.sin(phase), 20 * 2 * np.pi * frequency_hz * np.cos(phase)


def test_the_velocity_of_a_parabola_is_exact() -> None:
    time_s = np.arange(100)[:, None] * STEP_S
    slope = sampling.velocity(3 + 5 * time_s - 7 * time_s**2, STEP_S)
    inside = slice(sampling.half_width(STEP_S), -sampling.half_width(STEP_S))
    np.testing.assert_allclose(slope[inside], (5 - 14 * time_s)[inside])
    assert np.isnan(slope[: sampling.half_width(STEP_S)]).all()


@pytest.mark.parametrize("rate_hz", [60, 120, 240, 960])
def test_the_velocity_of_a_sine_is_right_at_any_rate(rate_hz: int) -> None:
    angle, true = sine(1.5, 1 / rate_hz)
    measured = sampling.velocity(angle, 1 / rate_hz)
    finite = np.isfinite(measured)
    assert np.abs(measured - true)[finite].max() < 0.03 * np.abs(true).max()


@pytest.mark.parametrize("rate_hz", [240, 960])
def test_the_window_passes_half_the_power_at_the_cutoff(rate_hz: int) -> None:
    """The local parabola is fitted to a sine of the cutoff frequency by least squares."""
    width = sampling.half_width(1 / rate_hz)
    kept = []
    for half in (width, width + 1):
        k = np.arange(-half, half + 1)
        fitted = np.polynomial.Polynomial.fit(k, np.cos(2 * np.pi * sampling.CUTOFF_HZ / rate_hz * k), 2)
        kept.append(float(fitted(0.0)) ** 2)
    assert kept[0] >= 0.5 > kept[1]


@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_the_noise_of_velocities_is_estimated_from_the_recording(moving: float) -> None:
    noise = np.random.default_rng(1).normal(0, 0.1, (20000, 2))
    angle = moving * sine(3.0, STEP_S, 20000 * STEP_S)[0][:20000] + noise
    left = sampling.velocity(noise, STEP_S)
    np.testing.assert_allclose(sampling.velocity_noise_sd(angle, STEP_S), np.nanstd(left, axis=0), rtol=0.1)


def test_noise_adds_little_speed_at_rest_and_none_in_movement() -> None:
    noise = np.random.default_rng(2).normal(0, 0.1, (5000, 1))
    at_rest = sampling.velocity(noise, STEP_S)
    assert np.nanmedian(sampling.speed(noise[..., None], STEP_S)) < 0.3 * np.nanmedian(np.abs(at_rest))
    angle, true = sine(1.0, STEP_S, 5000 * STEP_S)
    measured = sampling.speed((angle[:5000] + noise)[..., None], STEP_S)
    assert np.nanpercentile(measured, 95) == pytest.approx(np.percentile(np.abs(true), 95), rel=0.02)


def test_percentiles_ignore_the_gaps_of_each_series() -> None:
    series = np.random.default_rng(3).normal(size=(4, 50))
    series[1, ::3] = series[2] = np.nan
    series[3, ::3] = np.nan
    expected = [
        np.nanpercentile(row, [10.0, 50.0]) if np.isfinite(row).any() else [np.nan] * 2 for row in series
    ]
    np.testing.assert_array_equal(sampling.percentiles(series, [10.0, 50.0]), np.transpose(expected))
