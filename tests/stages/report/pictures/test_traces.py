"""Tip error over time: what is thinned away and what must stay."""

from __future__ import annotations

import numpy as np
import pytest

from stages.report.palette import model_looks
from stages.report.pictures.tip_error_strips import hidden_lines, thinned_traces, tip_error_picture
from stages.report.pictures.traces import Trace, error_scale, thin, trace_band, trace_line


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


def test_series_without_an_error_has_no_trace() -> None:
    """Nothing valid, nothing drawn; one frame is enough for a point."""
    nothing = np.array([np.nan])
    assert thin(np.zeros(1), nothing, nothing) is None
    assert len(_trace(np.ones(1)).x) == 1


def test_gross_failure_makes_the_scale_logarithmic() -> None:
    """Digits that differ little share a scale from zero."""
    small, large = _trace(np.full(10, 2.0)), _trace(np.full(10, 80.0))
    assert error_scale([small, large]).kind == "log"
    assert error_scale([small, _trace(np.full(10, 3.0))]).kind == "linear"
    assert error_scale([]).high > 0


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


def test_the_picture_has_a_strip_a_digit_and_a_line_a_model() -> None:
    """Gaps break lines; a digit without errors says so; models that hide each other are named."""
    error = np.abs(np.sin(np.arange(300) / 20)) + 0.5
    broken = np.where((np.arange(300) > 100) & (np.arange(300) < 160), np.nan, error)
    errors = {"thumb": {"a": error, "b": error, "c": broken + 1}, "ring <4>": {"a": np.full(300, np.nan)}}
    traces = thinned_traces(np.arange(300), np.arange(300) / 240, errors)
    picture = tip_error_picture("t", traces, model_looks(["a", "b", "c", "unused"]))
    for text in ("thumb", "ring &lt;4&gt;", "not known", "device time [s]", "a", "b", "c"):
        assert f">{text}<" in picture
    assert ">unused<" not in picture
    lines = [path for path in picture.split("<path") if "stroke:var(--moss)" in path and path.count("L") > 50]
    assert [path.count("M") for path in lines] == [2]
    assert hidden_lines(traces, ["a", "b", "c"]) == "Equal, so that the last hides the others: a and b."
    one = thinned_traces(np.arange(1), np.zeros(1), {"thumb": {"a": np.ones(1)}})
    assert "nan" not in tip_error_picture("t", one, model_looks(["a"]))
    frames = thinned_traces(np.arange(3), np.full(3, np.nan), {"thumb": {"a": np.ones(3)}})
    assert ">frame<" in tip_error_picture("t", frames, model_looks(["a"]))
