"""Thin numbers over time to what a picture can show: the smallest and largest of each pixel column."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.stages.report.plots.rows import Scale

Array = npt.NDArray[np.float64]

# A step between valid samples longer than this many usual steps is a gap: one missing frame makes it 2.
_GAP_STEPS = 1.9
# An error this many times another digit's median would flatten that digit on a linear scale.
_LOG_RATIO = 8.0
# Below this a tip error is noise; drawn on a logarithmic scale its ups and downs would fill the picture.
_LOG_FLOOR_MM = 0.3


@dataclass(frozen=True)
class Trace:
    """One digit's tip error in columns, C of them occupied.

    x : (C,) time in s or frame number at the column's first sample; low_mm, high_mm : (C,); rises : (C,)
    whether the low comes first; broken : (C,) whether a gap lies before the column. span : first and last
    x of the recording, gaps included. median_mm is of all valid frames.
    """

    x: Array
    low_mm: Array
    high_mm: Array
    rises: npt.NDArray[np.bool_]
    broken: npt.NDArray[np.bool_]
    span: tuple[float, float]
    in_seconds: bool
    median_mm: float


def error_scale(traces: Iterable[Trace]) -> Scale:
    """Return the vertical scale that all strips of one picture share, mm: from zero, or logarithmic
    where a gross failure dwarfs the others.
    """
    traces = list(traces)
    highest = max((float(trace.high_mm.max()) for trace in traces), default=1.0)
    medians = [max(trace.median_mm, _LOG_FLOOR_MM) for trace in traces] or [1.0]
    if highest / min(medians) > _LOG_RATIO:
        low = max(min(float(np.quantile(trace.low_mm, 0.02)) for trace in traces), _LOG_FLOOR_MM)
        return Scale(low, highest * 1.1, "log")
    return Scale(0.0, max(highest, 0.1) * 1.02)


def thin(frame: Array, time_s: Array, error_mm: Array, columns: int) -> Trace | None:
    """Thin one series (each of shape (n,), NaN where there is nothing); None where no error is valid."""
    in_seconds = bool(np.isfinite(time_s).all())
    x = time_s if in_seconds else frame
    valid = np.isfinite(error_mm)
    if not valid.any():
        return None
    span = float(x.min()), float(x.max())
    width = (span[1] - span[0]) / columns or 1.0
    usual_step = float(np.median(np.diff(x))) if len(x) > 1 else 0.0
    kept_x, kept = x[valid], error_mm[valid]
    column = np.minimum(((kept_x - span[0]) / width).astype(int), columns - 1)
    first = np.flatnonzero(np.diff(column, prepend=-1))
    last = np.append(first[1:], len(kept)) - 1
    step = np.diff(kept_x, prepend=kept_x[0])[first]
    return Trace(
        x=kept_x[first],
        low_mm=np.minimum.reduceat(kept, first),
        high_mm=np.maximum.reduceat(kept, first),
        rises=kept[first] <= kept[last],
        broken=step > max(_GAP_STEPS * usual_step, 1.5 * width if len(kept) > columns else 0.0),
        span=span,
        in_seconds=in_seconds,
        median_mm=float(np.median(kept)),
    )


def trace_line(trace: Trace) -> tuple[Array, Array]:
    """The line through every column's two extremes: x, y (3 C,), NaN where a gap breaks it.

    The second extreme stands half a column after the first, so that a slope stays one.
    """
    ends = np.column_stack([trace.low_mm, trace.high_mm])
    ends = np.where(trace.rises[:, None], ends, ends[:, ::-1])
    half = half_column(trace)
    x = np.column_stack([trace.x, trace.x, trace.x + half])
    y = np.column_stack([np.where(trace.broken, np.nan, ends[:, 0]), ends])
    return x.ravel(), y.ravel()


def half_column(trace: Trace) -> Array:
    """Half of every column's width (C,), in the unit of x."""
    if len(trace.x) < 2:
        return np.zeros(len(trace.x))
    return np.full(len(trace.x), float(np.diff(trace.x).min()) / 2)


def trace_band(trace: Trace) -> tuple[Array, Array, Array]:
    """Every column's middle, smallest and largest value, NaN where a gap breaks them: x, low, high."""
    broken = np.flatnonzero(trace.broken)
    x = trace.x + half_column(trace)
    return tuple(
        np.insert(part, broken, fill)
        for part, fill in ((x, x[broken]), (trace.low_mm, np.nan), (trace.high_mm, np.nan))
    )  # type: ignore[return-value]
