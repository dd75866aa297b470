"""How far an angle goes: from its 2.5th to its 97.5th percentile, on every page and in every table.

One bad frame does not change it. In a recording every frame counts alike; of what a joint is solved from
every posture does, as joints are calibrated in turn and stay at rest most of the time.
"""

from __future__ import annotations

import numpy as np

from shukotsu.hand.rotations import Array

LOW_PERCENT, HIGH_PERCENT = 2.5, 97.5

_BINS = 12
_FEWEST = 0.25
"""Share of the mean occupancy below which a bin is not raised further: single frames must not rule."""


def angle_range(angle: Array, weights: Array | None = None) -> float:
    """The range of an angle (T,) without gaps, one frame at least, in its own unit.

    weights : (T,) positive, how much each frame counts; None for all alike.
    """
    if weights is None:
        low, high = np.percentile(angle, [LOW_PERCENT, HIGH_PERCENT])
        return float(high - low)
    order = np.argsort(angle)
    below = np.cumsum(weights[order]) - weights[order] / 2
    low, high = np.interp([LOW_PERCENT, HIGH_PERCENT], 100 * below / weights.sum(), angle[order])
    return float(high - low)


def flattening(angle_rad: Array) -> Array:
    """Weights (N,), of mean 1, that make the histogram of the angles (N,) flat between its outermost 1 %.

    Frames beyond belong to the outermost bins and are kept: the extremes say most about the centre.
    """
    low, high = np.percentile(angle_rad, [1, 99])
    position = (angle_rad - low) / max(high - low, 1e-12) * _BINS
    bins = np.clip(position.astype(np.int64), 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    weights = 1.0 / np.maximum(count[bins], _FEWEST * len(angle_rad) / _BINS)
    return np.asarray(weights / weights.mean())
