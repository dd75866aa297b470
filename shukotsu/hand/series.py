"""Range of an angle, as used in all pages and tables, and number of independent samples of a series.

The range of an angle is from its 2.5th to its 97.5th percentile, so that single bad frames do not change it.
For a recording all frames have the same weight. For the data from which a joint is solved, all angles have
the same weight, as joints are calibrated in turn and are at rest most of the time.
"""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Array, Float

LOW_PERCENT, HIGH_PERCENT = 2.5, 97.5

_BINS = 12
_FEWEST = 0.25
"""Least occupancy of a bin that its weights assume, as a share of the mean: single frames must not
dominate."""


def angle_range(angle: Float[Array, " T"], weights: Float[Array, " T"] | None = None) -> float:
    """Compute the range of an angle, from its 2.5th to its 97.5th percentile.

    Parameters
    ----------
    angle : array, shape (T,)
        Angles in any unit, without gaps; at least one frame.
    weights : array, shape (T,), optional
        Positive weights of the frames; equal if omitted.

    Returns
    -------
    float
        Range in the unit of the angle.

    """
    if weights is None:
        low, high = np.percentile(angle, [LOW_PERCENT, HIGH_PERCENT])
        return float(high - low)
    order = np.argsort(angle)
    below = np.cumsum(weights[order]) - weights[order] / 2
    low, high = np.interp([LOW_PERCENT, HIGH_PERCENT], 100 * below / weights.sum(), angle[order])
    return float(high - low)


def flattening(angle_rad: Float[Array, " n"]) -> Float[Array, " n"]:
    """Compute weights of mean 1 that flatten the histogram of angles between its 1st and 99th percentile.

    Frames beyond belong to the outermost bins and are kept, as extreme angles contribute most to the centre.

    Parameters
    ----------
    angle_rad : array, shape (N,)
        Angles, rad.

    Returns
    -------
    array, shape (N,)
        Weight of each frame.

    """
    low, high = np.percentile(angle_rad, [1, 99])
    position = (angle_rad - low) / max(high - low, 1e-12) * _BINS
    bins = np.clip(position.astype(np.int64), 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    weights = 1.0 / np.maximum(count[bins], _FEWEST * len(angle_rad) / _BINS)
    return np.asarray(weights / weights.mean())


_ODD_FACTORS = (1, 3, 5, 9, 15, 25, 45, 75, 225)


def effective_samples(series: Float[Array, "B C"], variance: float, n_frames: int) -> float:
    """Estimate the number of independent samples among n_frames from the autocorrelation of a series.

    The variance of the mean is the sum of the autocovariances divided by B. The sum ends at their first zero
    crossing: what follows is noise or, in a repeated task, the same error with the opposite sign, because of
    which one sample would be counted several times.

    Parameters
    ----------
    series : array, shape (B, C)
        Means over short batches, in order of time.
    variance : float
        Variance of single frames, summed over the C components.
    n_frames : int
        Number of frames.

    Returns
    -------
    float
        Number of independent samples, between 1 and n_frames.

    """
    blocks = len(series)
    if blocks < 4 or variance <= 0.0:
        return float(max(blocks, 1))
    centred = (series - series.mean(0)).T
    for reach in (blocks // 8, blocks - 1):  # all lags only if the crossing is not among the first ones
        least = blocks + reach  # no lag wraps around; rounded up to 2^a 3^b 5^c, for a fast transform
        length = min(odd << max(1, int(-(-least // odd) - 1).bit_length()) for odd in _ODD_FACTORS)
        spectrum = np.fft.rfft(centred, length)
        power = np.sum(spectrum.real**2 + spectrum.imag**2, 0)
        autocovariance = np.fft.irfft(power, length)[: reach + 1] / blocks
        crossing = int(np.argmax(autocovariance <= 0))
        if crossing:
            break
    else:
        crossing = blocks
    variance_of_mean = (2 * autocovariance[:crossing].sum() - autocovariance[0]) / blocks
    return float(np.clip(variance / max(variance_of_mean, 1e-300), 1.0, n_frames))
