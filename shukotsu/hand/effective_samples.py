"""How many independent samples a correlated series is worth."""

from __future__ import annotations

import numpy as np

from shukotsu.hand.rotations import Array

_ODD_FACTORS = (1, 3, 5, 9, 15, 25, 45, 75, 225)


def effective_samples(series: Array, variance: float, n_frames: int) -> float:
    """Number of independent samples among n_frames, from the autocorrelation of a series.

    series : (B, C) means over short batches in the order of time; variance : of single frames, summed
    over the C components. The variance of the mean is the sum of the autocovariances over B. The sum
    stops where they first cross zero: what follows is noise or, in a task done over and over, the same
    error again with the other sign, which would count as many samples what is one.
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
