"""A recording's frames on an even grid of time, what was not recorded left empty, and speeds on it.

At each frame a parabola is fitted to the frames around it by least squares (Savitzky & Golay 1964); its slope
is the velocity. The window is the widest that passes CUTOFF_HZ with at least half the power, so that the same
motion has the same speed at any sampling rate that can show it. Where the window reaches into a gap there is
no velocity.
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
"""Gaps up to this length are bridged by a straight line, but for ranges and distances; longer ones stay."""

_LONGEST_PAUSE_S = 1.0
"""A longer pause takes no more room than this: no filter reaches across it."""

_PARTS = (1, 2, 3)
"""Parts of the median interval that a step may be: where most frames are missing, one is several steps."""

_UNSURE, _MOST_UNSURE = 0.35, 0.01
"""How far an interval may be from a whole number of steps, in steps, and what share may be farther."""


@dataclass(frozen=True)
class Grid:
    """Place T frames on an even grid of `count` places, `step_s` apart; index : (T,) their indices."""

    index: npt.NDArray[np.int64]
    count: int
    step_s: float

    def spread(self, values: Array) -> Array:
        """Values (T, ...) at their places (count, ...), NaN where there is no frame."""
        if self.count == len(values):
            return values
        out = np.full((self.count, *values.shape[1:]), np.nan)
        out[self.index] = values
        return out


def grid_of(time_s: Array) -> Grid | None:
    """The grid of the frames' device times (T,), NaN where unknown; None where they tell no rate.

    Stamps that are rounded, as to milliseconds, tell the rate by their mean. Where stamps scatter too much to
    say which frames are missing, as those that a host gives, none is taken for missing but in pauses.
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
    """Series (T, C) with gaps of at most most_s filled by straight lines; longer ones stay NaN.

    A gap before a series' first value or after its last stays, too.
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
    """Frames on either side of the window's middle; 1 at rates too low for the cut-off."""
    width, left = 1, 1.0
    while left >= np.sqrt(0.5) and width < _MOST_HALF_WIDTH:
        width += 1  # what is left of a sine of CUTOFF_HZ where a parabola's value replaces it
        sine = np.cos(2 * np.pi * CUTOFF_HZ * step_s * np.arange(-width, width + 1))
        left = float(savgol_coeffs(2 * width + 1, 2) @ sine)
    return max(1, width - 1)


def velocity(values: Float[Array, "T C"], step_s: float) -> Float[Array, "T C"]:
    """Rate of change (T, C) per second of series (T, C) on an even grid; NaN beside gaps and at the ends."""
    width = half_width(step_s)
    if len(values) <= 2 * width:
        return np.full(values.shape, np.nan)
    k = np.arange(-width, width + 1)
    slope: Array = correlate1d(values, k / ((k**2).sum() * step_s), axis=0, mode="constant", cval=np.nan)
    return slope


def velocity_noise_sd(values: Float[Array, "T C"], step_s: float) -> Float[Array, " C"]:
    """1-sigma error (C,) that white noise of the series (T, C) leaves in `velocity`; NaN of an empty one.

    The noise is told from third differences, which motion below the cut-off hardly has: their median size,
    which bursts of it do not reach.
    """
    width = half_width(step_s)
    gain = 1.0 / (np.sqrt((np.arange(-width, width + 1) ** 2).sum()) * step_s)
    third = np.abs(np.diff(values, 3, axis=0))
    middle = percentiles(third.T, [50.0])[0]
    return np.asarray(gain * _MAD_TO_SD * middle / np.sqrt(20.0))


def speed(values: Float[Array, "T C D"], step_s: float) -> Float[Array, "T C"]:
    """Speeds (T, C) of C series in D dimensions each, without what noise adds to their square.

    A speed that noise explains is zero.
    """
    columns = values.reshape(len(values), -1)
    squared = (velocity(columns, step_s) ** 2).reshape(values.shape).sum(2)
    noise = (velocity_noise_sd(columns, step_s) ** 2).reshape(values.shape[1:]).sum(1)
    return np.asarray(np.sqrt(np.maximum(squared - noise, 0.0)))


def percentiles(series: Float[Array, "C T"], percent: Sequence[float]) -> Float[Array, "P C"]:
    """Percentiles of the numbers of each series, NaN of one that has none."""
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
