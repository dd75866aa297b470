"""A fingertip's corner from analytic paths: when, how fast, with errors that hold."""

from __future__ import annotations

import numpy as np
import pytest

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.turning_points import one_sided, turning_point, velocity_before

WAY = np.array([0.6, -0.3, -0.74]) / np.linalg.norm([0.6, -0.3, -0.74])


def fallen(time_s: Array, contact_s: float, fall_s: float, depth_mm: float) -> Array:
    """How far (n,) a tip has come down that falls as a quarter of a cosine and stops at once."""
    share = np.clip((time_s - contact_s + fall_s) / fall_s, 0, 1)
    return np.asarray(depth_mm * (1 - np.cos(np.pi / 2 * share)))


@pytest.mark.parametrize("rate_hz", [240.0, 480.0, 1000.0])
@pytest.mark.parametrize("fall_s", [0.06, 0.1, 0.2])
def test_contact_is_not_smeared(rate_hz: float, fall_s: float) -> None:
    """The time to half a ms and the speed to 5 % of the truth, wherever the contact lies between frames."""
    time_s = np.arange(round(0.8 * rate_hz)) / rate_hz
    for contact_s in 0.4 + np.linspace(0, 1, 7) / rate_hz:
        path = fallen(time_s, contact_s, fall_s, 22.0)[:, None] * WAY + 100.0
        before_s = max(0.025, 0.36 * fall_s)
        found = turning_point(time_s, path, contact_s + 0.003, before_s)
        assert found is not None
        assert found.time_s == pytest.approx(contact_s, abs=5e-4)
        speed = 22.0 * np.pi / 2 / fall_s
        assert np.linalg.norm(found.before_mm_s) == pytest.approx(speed, rel=0.06)
        assert np.allclose(
            velocity_before(time_s, path, found.time_s, before_s), found.before_mm_s, rtol=1e-6
        )


def test_errors_hold_under_noise() -> None:
    rng, time_s = np.random.default_rng(5), np.arange(192) / 240
    off_s, off_mm_s, sd_s, sd_mm_s = [], [], [], []
    for _ in range(400):
        contact_s = 0.4 + rng.uniform(0, 1 / 240)
        path = fallen(time_s, contact_s, 0.2, 30.0)[:, None] * WAY + rng.normal(0, 0.1, (192, 3))
        found = turning_point(time_s, path, contact_s)
        assert found is not None
        off_s.append(found.time_s - contact_s)
        off_mm_s.append(np.linalg.norm(found.before_mm_s) - 30.0 * np.pi / 2 / 0.2)
        sd_s.append(found.sd_s)
        sd_mm_s.append(found.speed_sd_mm_s)
    for off, sd in ((off_s, sd_s), (off_mm_s, sd_mm_s)):
        assert 0.88 < np.mean(np.abs(off) < 1.96 * np.array(sd)) < 0.99


def test_there_is_no_corner_where_frames_are_missing() -> None:
    time_s = np.arange(192) / 240
    path = fallen(time_s, 0.4, 0.1, 22.0)[:, None] * WAY
    path[80:95] = np.nan
    assert turning_point(time_s, path, 0.4) is None


def test_straight_lines_on_either_side_and_gaps_that_are_elsewhere() -> None:
    time_s = np.arange(192) / 240
    path = np.where(time_s < 0.4, 50 * (time_s - 0.4), 20 * (time_s - 0.4))[:, None] * WAY
    path = np.stack([path, path], 1)
    path[30:60] = np.nan
    path[94, 1] = np.nan
    before, after, place = one_sided(time_s, path, np.array([0.4]))
    assert np.allclose(before[0, 0], 50 * WAY)
    assert np.allclose(after[0], 20 * WAY)
    assert np.allclose(place[0, 0], 0, atol=1e-9)
    assert np.isnan(before[0, 1]).all()
