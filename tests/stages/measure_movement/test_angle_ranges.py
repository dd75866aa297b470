"""Ranges of known motion, and whether the error that is stated holds what is off."""

import numpy as np
import pytest

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.angle_ranges import angle_range


def swing(amplitude_deg: float, n_frames: int = 2000) -> Array:
    """Never twice the same angle."""
    return 30 + amplitude_deg * np.sin(0.1 * np.sqrt(2) * np.arange(n_frames))


def measured(angle_deg: Array, sd_deg: float = 0.0, change_deg: float | Array = 0.0) -> dict[str, float]:
    """The range, of errors that are the same in all frames or given of each."""
    return angle_range(
        angle_deg, *(np.broadcast_to(np.asarray(own, float), 2000) for own in (sd_deg, change_deg))
    )


def test_a_sinusoids_range() -> None:
    found = measured(swing(20.0), 3.0)
    assert found["full_range_deg"] == pytest.approx(40.0, abs=0.01)
    assert found["range_deg"] == pytest.approx(40 * np.sin(0.475 * np.pi), abs=0.05)
    assert (found["low_deg"] + found["high_deg"]) / 2 == pytest.approx(30.0, abs=0.01)
    assert found["median_deg"] == pytest.approx(30.0, abs=0.05)
    assert found["median_sd_deg"] == 3.0
    assert found["range_sd_deg"] == 0.0


def test_one_spike_makes_the_full_range_alone() -> None:
    angle = swing(20.0)
    angle[77] = 170.0
    found = measured(angle)
    assert found["full_range_deg"] == pytest.approx(160.0, abs=0.1)
    assert found["range_deg"] == pytest.approx(40.0, abs=0.3)


@pytest.mark.parametrize(
    ("amplitude_deg", "share", "frame_deg"), [(25.0, 0.04, 0.0), (25.0, 0.03, 0.5), (0.5, 0.04, 0.5)]
)
def test_the_error_stated_holds_the_truth(amplitude_deg: float, share: float, frame_deg: float) -> None:
    """Errors common to all frames, in proportion to the distance from the mean, and of the frame alone."""
    rng, true = np.random.default_rng(5), swing(amplitude_deg)
    apart = true - true.mean()
    truth = measured(true)["range_deg"]
    change_sd = np.hypot(share * apart, frame_deg)
    within, stated = [], []
    for _ in range(300):
        off = rng.normal(0, 5) + share * rng.normal() * apart + frame_deg * rng.normal(size=2000)
        found = measured(true + off, 5.0, change_sd)
        within.append(abs(found["range_deg"] - truth) < 1.96 * found["range_sd_deg"])
        stated.append(found["range_sd_deg"])
    assert np.mean(within) > 0.92
    assert np.mean(stated) < 0.12 * amplitude_deg + 4 * frame_deg
