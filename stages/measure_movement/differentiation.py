"""Speeds by a local polynomial, and what noise adds to them.

At each frame a parabola is fitted to the frames around it by least squares (Savitzky & Golay 1964); its slope
is the velocity. The window is the widest that passes CUTOFF_HZ with at least half the power, so that the same
motion has the same speed at any sampling rate that can show it. Where the window reaches into a gap there is
no velocity.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shukotsu.skeleton.rotations import Array

CUTOFF_HZ = 10.0
"""Where the local parabola halves the power (-3 dB). Finger movement is below: fast tapping is 5 to 7 Hz."""

_MOST_HALF_WIDTH = 1000
_MAD_TO_SD = 1.4826


def half_width(step_s: float) -> int:
    """Frames on either side of the window's middle; 1 at rates too low for the cut-off."""
    from scipy.signal import savgol_coeffs

    width, left = 1, 1.0
    while left >= np.sqrt(0.5) and width < _MOST_HALF_WIDTH:
        width += 1  # what is left of a sine of CUTOFF_HZ where a parabola's value replaces it
        sine = np.cos(2 * np.pi * CUTOFF_HZ * step_s * np.arange(-width, width + 1))
        left = float(savgol_coeffs(2 * width + 1, 2) @ sine)
    return max(1, width - 1)


def velocity(values: Array, step_s: float) -> Array:
    """Rate of change (T, C) per second of series (T, C) on an even grid; NaN beside gaps and at the ends."""
    from scipy.ndimage import correlate1d

    width = half_width(step_s)
    if len(values) <= 2 * width:
        return np.full(values.shape, np.nan)
    k = np.arange(-width, width + 1)
    slope: Array = correlate1d(values, k / ((k**2).sum() * step_s), axis=0, mode="constant", cval=np.nan)
    return slope


def velocity_noise_sd(values: Array, step_s: float) -> Array:
    """1-sigma error (C,) that white noise of the series (T, C) leaves in `velocity`; NaN of an empty one.

    The noise is told from third differences, which motion below the cut-off hardly has: their median size,
    which bursts of it do not reach.
    """
    width = half_width(step_s)
    gain = 1.0 / (np.sqrt((np.arange(-width, width + 1) ** 2).sum()) * step_s)
    third = np.abs(np.diff(values, 3, axis=0))
    known = [column[~np.isnan(column)] for column in third.T]
    middle = np.array([np.median(column) if len(column) else np.nan for column in known])
    return np.asarray(gain * _MAD_TO_SD * middle / np.sqrt(20.0))


def speed(series: Iterable[Array], step_s: float) -> Array:
    """Speeds (T,) of series (T, 1), one a dimension, without what noise adds to their square.

    A speed that noise explains is zero.
    """
    squared, noise = np.zeros(1), 0.0
    for values in series:
        squared = squared + velocity(values, step_s)[:, 0] ** 2
        noise += float(velocity_noise_sd(values, step_s)[0]) ** 2
    return np.asarray(np.sqrt(np.maximum(squared - noise, 0.0)))
