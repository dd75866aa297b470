"""A recording's frames on an even time grid, with NaN for lost frames, and speeds computed on the grid.

At each frame a parabola is fitted to the surrounding frames by least squares (Savitzky & Golay 1964); its
slope is the velocity. The window is the widest that passes CUTOFF_HZ with at least half the power, so that a
motion has the same speed at all sufficient sampling rates. If the window reaches into a gap, the velocity is
NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d
from scipy.signal import savgol_coeffs

from shukotsu.arrays import Array, Float
from shukotsu.tables.device_clock import device_clock, without_packets

MOST_GAP_S = 0.05
"""Longest gap that is bridged by linear interpolation to compute speeds."""

_LONGEST_PAUSE_S = 1.0
"""Length to which longer pauses are shortened on the grid; no filter reaches across it."""

_PARTS = (1, 2, 3)
"""Divisors of the median interval that are tried as the step: if most frames are lost, it spans several."""

_UNSURE, _MOST_UNSURE = 0.35, 0.01
"""Largest distance of an interval from a whole number of steps, in steps; and the share of intervals that may
exceed it."""


@dataclass(frozen=True)
class Grid:
    """Even grid of `count` points, `step_s` apart, for T frames; index : (T,), the point of each frame."""

    index: npt.NDArray[np.int64]
    count: int
    step_s: float

    def spread(self, values: Array) -> Array:
        """Return values (T, ...) of frames on the grid (count, ...), NaN at points without a frame."""
        if self.count == len(values):
            return values
        out = np.full((self.count, *values.shape[1:]), np.nan)
        out[self.index] = values
        return out


def grid_of(time_s: Array) -> Grid | None:
    """Return the even grid of a recording's frames, or None if no rate can be determined.

    The step is the mean interval, so times may be rounded, for example to milliseconds. If times scatter too
    much to show which frames are missing, as a host's do, frames are assumed to be missing only in pauses.

    Parameters
    ----------
    time_s : array, shape (T,)
        Device times of the frames, s, NaN if unknown.

    """
    time_s = without_packets(time_s)[0]
    apart = np.diff(time_s)
    growing = apart[apart > 0]
    usual_s = float(np.median(growing)) if len(growing) else np.nan
    pause = ~(np.abs(apart) <= usual_s + MOST_GAP_S)
    for run in device_clock(time_s)[1]:
        if run.kind == "still":
            pause[run.row : run.row + run.rows - 1] = True
    if not apart[~pause].sum() > 0:
        return None
    for part in _PARTS:
        steps = np.where(apart > 0, np.maximum(np.round(apart * part / usual_s), 1.0), 1.0)
        step_s = float(apart[~pause].sum() / steps[~pause].sum())
        off = np.abs(apart / step_s - steps)[~pause]
        if np.mean(off > _UNSURE) <= _MOST_UNSURE:
            break
    else:
        step_s = float(apart[~pause].mean())
        steps = np.where(pause & (apart > 0), np.round(apart / step_s), 1.0)
    steps = np.clip(steps, 1, max(1.0, round(_LONGEST_PAUSE_S / step_s))).astype(np.int64)
    positions = np.concatenate([[0], np.cumsum(steps)])
    return Grid(positions, int(positions[-1]) + 1, step_s)


def bridge_gaps(
    values: Float[Array, "T C"], step_s: float, most_s: float = MOST_GAP_S
) -> Float[Array, "T C"]:
    """Return series (T, C) with gaps of at most `most_s` filled by linear interpolation.

    Longer gaps, and gaps before a series' first value or after its last, stay NaN.
    """
    longest, out = int(most_s / step_s + 1e-9), values
    for column in np.flatnonzero(np.isnan(values).any(0)):
        finite = np.flatnonzero(~np.isnan(values[:, column]))
        short = np.flatnonzero((np.diff(finite) > 1) & (np.diff(finite) <= longest + 1))
        if not len(short):
            continue
        out = values.copy() if out is values else out
        for first, last in zip(finite[short], finite[short + 1], strict=True):
            gap = slice(first, last + 1)
            out[gap, column] = np.linspace(values[first, column], values[last, column], last - first + 1)
    return out


CUTOFF_HZ = 10.0
"""Frequency at which the local parabola halves the power (-3 dB); fast tapping is 5 to 7 Hz."""

_MOST_HALF_WIDTH = 1000
_MAD_TO_SD = 1.4826


@cache
def half_width(step_s: float) -> int:
    """Return the number of frames on each side of the window's middle, at least 1."""
    width, left = 1, 1.0
    while left >= np.sqrt(0.5) and width < _MOST_HALF_WIDTH:
        width += 1  # `left`: amplitude of a sine of CUTOFF_HZ after the parabola fit
        sine = np.cos(2 * np.pi * CUTOFF_HZ * step_s * np.arange(-width, width + 1))
        left = float(savgol_coeffs(2 * width + 1, 2) @ sine)
    return max(1, width - 1)


def velocity(values: Float[Array, "T C"], step_s: float) -> Float[Array, "T C"]:
    """Return the rate of change (T, C), per second, of series (T, C) on an even grid.

    It is NaN where the window reaches into a gap or beyond an end.
    """
    width = half_width(step_s)
    if len(values) <= 2 * width:
        return np.full(values.shape, np.nan)
    k = np.arange(-width, width + 1)
    slope: Array = correlate1d(values, k / ((k**2).sum() * step_s), axis=0, mode="constant", cval=np.nan)
    return slope


def velocity_noise_sd(values: Float[Array, "T C"], step_s: float) -> Float[Array, " C"]:
    """Return the 1-sigma error (C,) that white noise in series (T, C) causes in `velocity`.

    The noise is estimated from the median size of third differences, which contain hardly any motion below
    the cut-off and are robust to short bursts of motion. NaN for a series without values.
    """
    width = half_width(step_s)
    gain = 1.0 / (np.sqrt((np.arange(-width, width + 1) ** 2).sum()) * step_s)
    third = np.abs(np.diff(values, 3, axis=0))
    middle = percentiles(third.T, [50.0])[0]
    return np.asarray(gain * _MAD_TO_SD * middle / np.sqrt(20.0))


def speed(values: Float[Array, "T C D"], step_s: float) -> Float[Array, "T C"]:
    """Return the speeds (T, C) of C series in D dimensions, in units of the series per second.

    The expected contribution of noise is subtracted from the squared speed; a negative difference gives zero.
    """
    columns = values.reshape(len(values), -1)
    squared = (velocity(columns, step_s) ** 2).reshape(values.shape).sum(2)
    noise = (velocity_noise_sd(columns, step_s) ** 2).reshape(values.shape[1:]).sum(1)
    return np.asarray(np.sqrt(np.maximum(squared - noise, 0.0)))


def percentiles(series: Float[Array, "C T"], percent: Sequence[float]) -> Float[Array, "P C"]:
    """Return percentiles (P, C) of the finite values of each of C series; NaN for a series without any."""
    out = np.full((len(percent), len(series)), np.nan)
    finite = ~np.isnan(series)
    by_gaps: dict[bytes, list[int]] = {}
    for index, seen in enumerate(finite):
        by_gaps.setdefault(seen.tobytes(), []).append(index)
    for alike in by_gaps.values():  # series with the same gaps in one pass
        seen = finite[alike[0]]
        if seen.any():
            out[:, alike] = np.percentile(series[alike][:, seen], percent, axis=1)
    return out
