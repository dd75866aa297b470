"""Tip error over time: what is thinned away and what must stay."""

from __future__ import annotations

import numpy as np
import pytest

from shukotsu.stages.report.print_figures.traces import Trace, thin, trace_band, trace_line


def _trace(error: np.ndarray, columns: int = 240) -> Trace:
    n = len(error)
    trace = thin(np.arange(n, dtype=float), np.full(n, np.nan), error, columns)
    assert trace is not None
    return trace


def test_thinning_keeps_every_columns_extremes() -> None:
    """The largest and smallest errors survive; there are at most as many columns as asked for."""
    error = np.random.default_rng(1).gamma(2.0, 1.0, 5000)
    trace = _trace(error, 100)
    assert len(trace.x) == 100
    expected = error.reshape(100, 50)
    np.testing.assert_array_equal(trace.low_mm, expected.min(axis=1))
    np.testing.assert_array_equal(trace.high_mm, expected.max(axis=1))
    np.testing.assert_array_equal(trace.rises, expected[:, 0] <= expected[:, -1])


@pytest.mark.parametrize(("n", "gap", "breaks"), [(50, slice(20, 21), 1), (5000, slice(100, 101), 0)])
def test_gaps_that_can_be_seen_stay(n: int, gap: slice, breaks: int) -> None:
    """One missing frame breaks a line of few frames; of thousands it is narrower than a pixel."""
    error = np.ones(n)
    error[gap] = np.nan
    assert _trace(error).broken.sum() == breaks


def test_a_peak_and_a_gap_survive_thinning() -> None:
    time_s = np.arange(100_000) / 240
    error = np.ones(100_000)
    error[54_321] = 77.0
    error[60_000:70_000] = np.nan
    trace = thin(np.arange(100_000.0), time_s, error, 200)
    assert trace is not None
    x, y = trace_line(trace)
    assert np.nanmax(y) == 77.0
    assert abs(x[np.nanargmax(y)] - time_s[54_321]) <= time_s[-1] / 200
    inside = (x > time_s[60_500]) & (x < time_s[69_500])
    assert not np.isfinite(y[inside]).any()
    assert np.isnan(y).sum() == 1
    x, low, high = trace_band(trace)
    assert (np.nanmin(low), np.nanmax(high)) == (1.0, 77.0)
    assert np.isnan(high).sum() == np.isnan(low).sum() == 1
    assert (np.diff(x) >= 0).all()
