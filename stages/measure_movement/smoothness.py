"""Smoothness of movements: the spectral arc length of a movement's speed (SPARC).

Balasubramanian, Melendez-Calderon, Roby-Brami & Burdet 2015, J NeuroEng Rehabil 12:112, with the parameters
that they recommend. It does not depend on how large or how fast a movement is, but on how many there are: of
several in a row it measures their rhythm. So each movement is cut out, and the median over them is given.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shukotsu.skeleton.rotations import Array

VALLEY = 0.2
"""Two movements lie apart where the speed between falls below this share of the smaller of both peaks."""

LEAST_PEAK = 0.1
"""Of the 95th percentile of the speed: what never gets faster is rest."""

FOOT = 0.05
"""Of its peak, what a movement's speed exceeds from its first frame to its last."""

FEWEST_FRAMES = 8
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
    """Median SPARC of the movements in speeds (T,), NaN in gaps; NaN where there is no movement."""
    found = [spectral_arc_length(speeds[first:end], step_s) for first, end in movements(speeds)]
    known = [value for value in found if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")


def movements(speeds: Array) -> list[tuple[int, int]]:
    """First frame and the one after the last of each movement in speeds (T,), NaN in gaps.

    A movement lies between two valleys of the speed, see VALLEY. One that a gap, the beginning or the end of
    the recording cuts off is none.
    """
    known = speeds[~np.isnan(speeds)]
    least = LEAST_PEAK * float(np.percentile(known, 95.0)) if len(known) else 0.0
    found = []
    for first, last in runs(~np.isnan(speeds)):
        own = speeds[first:last]
        bounds = [0, *_valleys(own, least), len(own)]
        for start, end in pairwise(bounds):
            above = np.flatnonzero(own[start:end] > FOOT * own[start:end].max())
            if not len(above) or own[start:end].max() < max(least, 1e-12):
                continue
            begin, stop = start + int(above[0]), start + int(above[-1]) + 1
            whole = max(own[begin], own[stop - 1]) < VALLEY * own[start:end].max()
            if whole and stop - begin >= FEWEST_FRAMES:
                found.append((first + begin, first + stop))
    return found


def _valleys(speeds: Array, least: float) -> list[int]:
    """Frames between which there is one movement each, of speeds (T,) without gaps."""
    turns = np.append(np.flatnonzero(np.diff(np.sign(np.diff(speeds)))) + 1, len(speeds) - 1)
    found: list[int] = []
    peak = low = float(speeds[0])
    at = 0
    for frame, value in zip(turns.tolist(), speeds[turns].tolist(), strict=True):
        if value < low:
            low, at = value, frame
        elif value >= least and low < VALLEY * min(peak, value):
            found.append(at)
            peak, low, at = value, value, frame
        elif value > peak:
            peak, low, at = value, value, frame
    return found


def runs(holds: Array) -> list[tuple[int, int]]:
    """First index and the one after the last of every run in which a condition (T,) holds."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(holds, np.int8), [0]])))
    return [(int(first), int(last)) for first, last in change.reshape(-1, 2)]
