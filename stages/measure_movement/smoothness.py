"""Smoothness of a movement: the spectral arc length of its speed (SPARC).

Balasubramanian, Melendez-Calderon, Roby-Brami & Burdet 2015, J NeuroEng Rehabil 12:112, with the parameters
that they recommend. It does not depend on how large or how fast a movement is; but a longer recording of the
same movement has more of them. So it is taken over stretches of one length, and their median is given.
"""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.rotations import Array

STRETCH_S = 5.0
PAD_LEVEL = 4
MOST_HZ = 10.0
LEAST_AMPLITUDE = 0.05


def spectral_arc_length(speeds: Array, step_s: float) -> float:
    """SPARC of speeds (T,) without gaps: negative, nearer to 0 the smoother; NaN where nothing moves."""
    count = 2 ** int(np.ceil(np.log2(len(speeds))) + PAD_LEVEL)
    amplitude = np.abs(np.fft.rfft(speeds, count))
    if not amplitude.max() > 0:
        return float("nan")
    frequency = np.fft.rfftfreq(count, step_s)
    amplitude = (amplitude / amplitude.max())[frequency <= MOST_HZ]
    above = np.flatnonzero(amplitude >= LEAST_AMPLITUDE)
    amplitude = amplitude[above[0] : above[-1] + 1]
    if len(amplitude) < 2:
        return float("nan")
    return float(-np.hypot(1.0 / (len(amplitude) - 1), np.diff(amplitude)).sum())


def median_smoothness(speeds: Array, step_s: float) -> float:
    """Median SPARC of the stretches of STRETCH_S without a gap in speeds (T,); NaN where there is none."""
    length = round(STRETCH_S / step_s)
    found = [
        spectral_arc_length(speeds[start : start + length], step_s)
        for first, last in runs(~np.isnan(speeds))
        for start in range(first, last - length + 1, max(1, length))
    ]
    known = [value for value in found if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")


def runs(holds: Array) -> list[tuple[int, int]]:
    """First index and the one after the last of every run in which a condition (T,) holds."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(holds, np.int8), [0]])))
    return [(int(first), int(last)) for first, last in change.reshape(-1, 2)]
