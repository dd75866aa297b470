"""Weights of frames: readings that fit nothing count for nothing."""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.rotations import Array

_CUT = 6.0
"""Tukey's limit in robust standard deviations: skin has heavy tails, wrong readings are far beyond."""

_MEDIAN_LENGTH = 1.538
"""Median length of a three-dimensional standard normal vector."""


def robust_scale(residual: Array) -> float:
    """Standard deviation per component of residuals (N, 3), from the median of their lengths."""
    return float(np.median(np.linalg.norm(residual, axis=-1))) / _MEDIAN_LENGTH


def tukey(residual: Array, scale: float) -> Array:
    """Tukey's weights (N,) of residuals (N, 3) whose standard deviation per component is `scale`."""
    ratio = np.linalg.norm(residual, axis=-1) / max(_CUT * scale, 1e-12)
    return np.asarray(np.clip(1.0 - ratio**2, 0.0, None) ** 2)
