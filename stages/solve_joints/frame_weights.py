"""Weights of frames: every angle counts alike, and readings that fit nothing count for nothing."""

from __future__ import annotations

import numpy as np

from skeleton.rotations import Array

_BINS = 12
_FEWEST = 0.25
"""Share of the mean occupancy below which a bin is not raised further: single frames must not rule."""

_CUT = 6.0
"""Tukey's limit in robust standard deviations: skin has heavy tails, wrong readings are far beyond."""

_MEDIAN_LENGTH = 1.538
"""Median length of a three-dimensional standard normal vector."""


def flattening(angle_rad: Array) -> Array:
    """Weights (N,), of mean 1, that make the histogram of the angles (N,) flat between its outermost 1 %.

    Frames beyond belong to the outermost bins and are kept: the extremes say most about the centre.
    """
    low, high = np.percentile(angle_rad, [1, 99])
    place = (angle_rad - low) / max(high - low, 1e-12) * _BINS
    bins = np.clip(place.astype(np.int64), 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    weights = 1.0 / np.maximum(count[bins], _FEWEST * len(angle_rad) / _BINS)
    return np.asarray(weights / weights.mean())


def robust_scale(residual: Array) -> float:
    """Standard deviation per component of residuals (N, 3), from the median of their lengths."""
    return float(np.median(np.linalg.norm(residual, axis=-1))) / _MEDIAN_LENGTH


def tukey(residual: Array, scale: float) -> Array:
    """Tukey's weights (N,) of residuals (N, 3) whose standard deviation per component is `scale`."""
    ratio = np.linalg.norm(residual, axis=-1) / max(_CUT * scale, 1e-12)
    return np.asarray(np.clip(1.0 - ratio**2, 0.0, None) ** 2)
