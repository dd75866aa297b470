"""SPARC against its definition written out anew, and what it is of known movements."""

from itertools import pairwise

import numpy as np
import pytest

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.smoothness import (
    STRETCH_S,
    median_smoothness,
    spectral_arc_length,
)

STEP_S = 1 / 240


def by_its_definition(speeds: Array, rate_hz: float) -> float:
    """Eq. 1 to 3 of Balasubramanian et al. 2015: the arc of the amplitude spectrum, step by step."""
    padded = int(2 ** (np.ceil(np.log2(len(speeds))) + 4))
    spectrum = np.zeros(padded)
    spectrum[: len(speeds)] = speeds
    amplitude = np.abs(np.fft.fft(spectrum))
    amplitude = amplitude / max(amplitude)
    frequency = [rate_hz * index / padded for index in range(padded)]
    chosen = [index for index in range(padded) if frequency[index] <= 10.0]
    high = [index for index in chosen if amplitude[index] >= 0.05]
    chosen = chosen[high[0] : high[-1] + 1]
    width = frequency[chosen[-1]] - frequency[chosen[0]]
    arc = 0.0
    for before, after in pairwise(chosen):
        along = (frequency[after] - frequency[before]) / width
        arc += np.sqrt(along**2 + (amplitude[after] - amplitude[before]) ** 2)
    return -arc


def minimum_jerk(n_frames: int) -> Array:
    """Speed of one reach (Flash & Hogan 1985)."""
    share = np.linspace(0, 1, n_frames)
    return 30 * share**2 * (1 - share) ** 2


@pytest.mark.parametrize("n_frames", [121, 480, 1000])
def test_it_is_the_arc_of_the_spectrum(n_frames: int) -> None:
    rng = np.random.default_rng(n_frames)
    for speeds in (minimum_jerk(n_frames), np.abs(rng.standard_normal(n_frames)).cumsum() % 7):
        assert spectral_arc_length(speeds, STEP_S) == pytest.approx(
            by_its_definition(speeds, 240.0), rel=1e-9
        )


def test_size_and_duration_do_not_count_and_stops_do() -> None:
    reach = spectral_arc_length(minimum_jerk(240), STEP_S)
    assert -1.6 < reach < -1.3
    assert spectral_arc_length(9 * minimum_jerk(240), STEP_S) == pytest.approx(reach, rel=1e-9)
    assert spectral_arc_length(minimum_jerk(480), STEP_S) == pytest.approx(reach, rel=0.02)
    twice = np.concatenate([minimum_jerk(120), np.zeros(60), minimum_jerk(120)])
    assert spectral_arc_length(twice, STEP_S) < reach - 0.5


def test_stretches_are_cut_between_gaps() -> None:
    length = round(STRETCH_S / STEP_S)
    speeds = 1 + np.sin(np.arange(3 * length) * STEP_S * 7)
    speeds[length // 2] = np.nan
    expected = spectral_arc_length(speeds[length // 2 + 1 : length // 2 + 1 + length], STEP_S)
    assert median_smoothness(speeds[: 2 * length], STEP_S) == pytest.approx(expected)
    assert np.isnan(median_smoothness(speeds[:length], STEP_S))
