"""Ranges of known motions, and the coverage of their stated errors."""

from typing import Any

import numpy as np
import pytest

from shukotsu.arrays import Array
from shukotsu.movement import movement_rows
from shukotsu.movement.movement_rows import RANGE_PERCENT, AngleErrors
from shukotsu.movement.sampling import percentiles


def swing(amplitude_deg: float, n_frames: int = 2000) -> Array:
    """Return a sinusoid (T,) in deg that never repeats a value exactly."""
    return 30 + amplitude_deg * np.sin(0.1 * np.sqrt(2) * np.arange(n_frames))


def errors(sd_deg: float | Array = 0.0, change_deg: float | Array = 0.0, anew: float = 0.0) -> AngleErrors:
    """Return the errors of 2000 frames; anew : share of both that differs between sessions."""
    sd, change = (np.broadcast_to(np.asarray(values_deg, float), 2000) for values_deg in (sd_deg, change_deg))
    return AngleErrors(sd, change, anew * sd, anew * change)


def angle_range(angle_deg: Array, stated: AngleErrors) -> Any:
    return movement_rows.angle_range(angle_deg, stated, percentiles(angle_deg[None], RANGE_PERCENT)[:, 0])


def test_the_range_of_a_sinusoid_is_exact() -> None:
    measured = angle_range(swing(20.0), errors(3.0))
    assert measured["full_range_deg"] == pytest.approx(40.0, abs=0.01)
    assert measured["range_deg"] == pytest.approx(40 * np.sin(0.475 * np.pi), abs=0.05)
    assert (measured["low_deg"] + measured["high_deg"]) / 2 == pytest.approx(30.0, abs=0.01)
    assert measured["median_deg"] == pytest.approx(30.0, abs=0.05)
    assert measured["median_sd_deg"] == 3.0
    names = ("range_sd_deg", "range_session_sd_deg", "median_session_sd_deg")
    assert [measured[name] for name in names] == [0.0] * 3


def test_one_spike_changes_only_the_full_range() -> None:
    angle = swing(20.0)
    angle[77] = 170.0
    measured = angle_range(angle, errors())
    assert measured["full_range_deg"] == pytest.approx(160.0, abs=0.1)
    assert measured["range_deg"] == pytest.approx(40.0, abs=0.3)


@pytest.mark.parametrize(
    ("amplitude_deg", "share", "frame_deg"), [(25.0, 0.04, 0.0), (25.0, 0.03, 0.5), (0.5, 0.04, 0.5)]
)
def test_the_stated_error_covers_the_truth(amplitude_deg: float, share: float, frame_deg: float) -> None:
    """Simulated errors are common to all frames, proportional to the deviation from the mean, and per
    frame.
    """
    rng, true = np.random.default_rng(5), swing(amplitude_deg)
    apart = true - true.mean()
    truth = angle_range(true, errors())["range_deg"]
    change_sd = np.hypot(share * apart, frame_deg)
    within, stated = [], []
    for _ in range(300):
        off = rng.normal(0, 5) + share * rng.normal() * apart + frame_deg * rng.normal(size=2000)
        measured = angle_range(true + off, errors(5.0, change_sd))
        within.append(abs(measured["range_deg"] - truth) < 1.96 * measured["range_sd_deg"])
        stated.append(measured["range_sd_deg"])
    assert np.mean(within) > 0.92
    assert np.mean(stated) < 0.12 * amplitude_deg + 4 * frame_deg


def test_the_session_error_covers_differences_between_sessions() -> None:
    """The sessions share most of the error; the error per frame varies slowly, constant within each visit."""
    rng, true = np.random.default_rng(6), swing(25.0)
    apart, n_visits = true - true.mean(), round(2000 * 0.1 * np.sqrt(2) / (2 * np.pi))
    change_sd = np.hypot(0.04 * apart, 0.5)
    stated = errors(5.0, change_sd)
    stated = AngleErrors(stated.sd_deg, change_sd, np.full(2000, 1.5), 0.01 * abs(apart))
    seen, within = [], []
    for _ in range(300):
        shared = rng.normal(0, 4) + 0.04 * rng.normal() * apart
        pair = []
        for _ in range(2):
            visit = np.repeat(rng.normal(0, 0.5, 2 * n_visits), 2000 // (2 * n_visits) + 1)[:2000]
            off = shared + rng.normal(0, 1.5) + 0.01 * rng.normal() * apart + visit
            pair.append(angle_range(true + off, stated))
        first, other = pair
        for name in ("range", "median"):
            apart_deg = first[f"{name}_deg"] - other[f"{name}_deg"]
            sd_deg = np.hypot(*(session[f"{name}_session_sd_deg"] for session in pair))
            seen.append(apart_deg)
            within.append(abs(apart_deg) < 1.96 * sd_deg)
    assert 0.92 < np.mean(within) < 0.99
    assert first["range_session_sd_deg"] < first["range_sd_deg"] / 3
    assert first["median_session_sd_deg"] < first["median_sd_deg"] / 3
