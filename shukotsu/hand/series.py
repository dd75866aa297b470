"""How far an angle goes, on every page and in every table, and how many samples a series is worth.

An angle goes from its 2.5th to its 97.5th percentile: one bad frame does not change it. In a recording every
frame counts alike; of what a joint is solved from every posture does, as joints are calibrated in turn and
stay at rest most of the time.
"""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Array, Float

LOW_PERCENT, HIGH_PERCENT = 2.5, 97.5

_BINS = 12
_FEWEST = 0.25
"""Share of the mean occupancy below which a bin is not raised further: single frames must not rule."""


def angle_range(angle: Float[Array, " T"], weights: Float[Array, " T"] | None = None) -> float:
    """Range of an angle, from its 2.5th to its 97.5th percentile, in its own unit.

    Parameters
    ----------
    angle : array, shape (T,)
        Without gaps, of one frame at least.
    weights : array, shape (T,), optional
        Positive weights of the frames; all alike if omitted.

    Returns
    -------
    float
        The range.

    """
    if weights is None:
        low, high = np.percentile(angle, [LOW_PERCENT, HIGH_PERCENT])
        return float(high - low)
    order = np.argsort(angle)
    below = np.cumsum(weights[order]) - weights[order] / 2
    low, high = np.interp([LOW_PERCENT, HIGH_PERCENT], 100 * below / weights.sum(), angle[order])
    return float(high - low)


def flattening(angle_rad: Float[Array, " n"]) -> Float[Array, " n"]:
    """Weights of mean 1 that make the histogram of angles flat between its outermost 1 %.

    Frames beyond belong to the outermost bins and are kept: the extremes say most about the centre.

    Parameters
    ----------
    angle_rad : array, shape (N,)
        Angles, rad.

    Returns
    -------
    array, shape (N,)
        A weight for each frame.

    """
    low, high = np.percentile(angle_rad, [1, 99])
    position = (angle_rad - low) / max(high - low, 1e-12) * _BINS
    bins = np.clip(position.astype(np.int64), 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    weights = 1.0 / np.maximum(count[bins], _FEWEST * len(angle_rad) / _BINS)
    return np.asarray(weights / weights.mean())


_ODD_FACTORS = (1, 3, 5, 9, 15, 25, 45, 75, 225)


def effective_samples(series: Float[Array, "B C"], variance: float, n_frames: int) -> float:
    """Number of independent samples among n_frames, from the autocorrelation of a series.

    The variance of the mean is the sum of the autocovariances over B. The sum stops where they first cross
    zero: what follows is noise or, in a repeated task, the same error with the other sign, which would count
    one sample several times.

    Parameters
    ----------
    series : array, shape (B, C)
        Means over short batches, in the order of time.
    variance : float
        Variance of single frames, summed over the C components.
    n_frames : int
        Number of frames.

    Returns
    -------
    float
        Between 1 and n_frames.

    """
    blocks = len(series)
    if blocks < 4 or variance <= 0.0:
        return float(max(blocks, 1))
    centred = (series - series.mean(0)).T
    for reach in (blocks // 8, blocks - 1):  # lags that do not wrap around; the crossing is mostly early
        least = blocks + reach  # up to an even length 2^a 3^b 5^c, of which a Fourier transform is fast
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
