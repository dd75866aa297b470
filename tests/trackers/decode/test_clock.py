"""Device time: the frame counter is the clock; the host's clock is fitted from below."""

import numpy as np
import pytest

from shukotsu.trackers.decode.survey import fit_clock


def arrivals(seconds: float, drift: float, seed: int = 0, rate_hz: float = 240.0):
    """Frames of a device whose crystal is off by `drift`; delays are 1 ms and more, now and then 200 ms."""
    random = np.random.default_rng(seed)
    frame = np.arange(1000, 1000 + int(seconds * rate_hz), 2)
    sent_s = (frame - 1000) / rate_hz * (1 + drift)
    delay_s = 0.001 + random.exponential(0.003, len(frame))
    delay_s[random.random(len(frame)) < 0.01] += 0.2
    return frame, np.round((5.0 + np.maximum.accumulate(sent_s + delay_s)) * 1e9).astype(np.int64)


@pytest.mark.parametrize("drift", [-4e-4, -5e-5, 0.0, 1e-4])
def test_a_drifting_crystal_is_followed(drift: float) -> None:
    frame, host_ns = arrivals(120.0, drift)
    clock = fit_clock(frame, host_ns, 240.0, 1000)
    assert clock.fitted
    assert clock.period_s * 240 == pytest.approx(1 + drift, abs=2e-5)
    assert clock.host_ns * 1e-9 == pytest.approx(5.001, abs=1e-3)


def test_a_late_burst_does_not_pull() -> None:
    frame, host_ns = arrivals(60.0, 0.0)
    host_ns[3000:4000] = np.maximum(host_ns[3000:4000], host_ns[4000])
    late = fit_clock(frame, host_ns, 240.0, 1000)
    assert late.period_s * 240 == pytest.approx(1.0, abs=3e-5)


def test_another_rate_is_told_and_not_used() -> None:
    frame, host_ns = arrivals(60.0, 1.0)
    clock = fit_clock(frame, host_ns, 240.0, 1000)
    assert not clock.fitted
    assert clock.measured_rate_hz == pytest.approx(120.0, rel=1e-4)
    assert clock.period_s == 1 / 240
