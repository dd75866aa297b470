"""SPARC against its definition written out anew, and what it is of known movements."""

from itertools import pairwise

import numpy as np
import pytest

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.smoothness import (
    median_smoothness,
    movements,
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


@pytest.mark.parametrize("rest_s", [0.0, 0.05, 0.237, 1.0])
def test_identical_strokes_are_as_smooth_however_many_and_at_any_tempo(rest_s: float) -> None:
    """There and back, with rests; noise that is no movement changes little."""
    there = minimum_jerk(40)
    rest = np.zeros(round(rest_s / STEP_S))
    alone = spectral_arc_length(there[there > 0.05 * there.max()], STEP_S)
    for count in (1, 2, 8):
        speeds = np.concatenate([[0.0], *[np.concatenate([there, rest, there, rest])] * count, [0.0]])
        assert len(movements(speeds)) == 2 * count
        assert median_smoothness(speeds, STEP_S) == pytest.approx(alone, rel=1e-9)
        noisy = speeds + np.abs(np.random.default_rng(count).normal(0, 0.005, len(speeds)))
        assert median_smoothness(noisy, STEP_S) == pytest.approx(alone, rel=0.03)


def test_a_stroke_in_jerks_is_less_smooth() -> None:
    share = np.linspace(0, 1, 60)
    jerky = minimum_jerk(60) * (1 + 0.5 * np.sin(2 * np.pi * 3 * share))
    one, other = (np.concatenate([[0.0], *[own] * 5, [0.0]]) for own in (minimum_jerk(60), jerky))
    assert median_smoothness(other, STEP_S) < median_smoothness(one, STEP_S) - 0.05


def test_movements_that_are_cut_off_are_none() -> None:
    speeds = np.concatenate(
        [minimum_jerk(40)[20:], minimum_jerk(40), minimum_jerk(40), minimum_jerk(40)[:20]]
    )
    speeds[80] = np.nan
    assert [(first > 20, end < 65) for first, end in movements(speeds)] == [(True, True)]
    for nothing in (np.zeros(100), np.full(100, np.nan), np.zeros(0), np.ones(100)):
        assert np.isnan(median_smoothness(nothing, STEP_S))
