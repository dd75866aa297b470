"""95 % region of a position whose stated error is a covariance: which errors are inside, and its radius.

A covariance is rarely isotropic: a centre is several times less certain along a hinge's axis than across it.
An error is therefore compared with the covariance itself, by its Mahalanobis distance.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shukotsu.arrays import Array

CHI_SQUARE_95 = 7.815
"""95th percentile of squared Mahalanobis distances in 3-D (chi-squared with 3 degrees of freedom)."""

NORMAL_95 = 1.645
"""95th percentile of the standard normal distribution."""

_LEAST_SHARE = 1e-9
"""Variances below this share of the largest one are attributed to rounding."""


def halves_mm2(covariance_mm2: Any, sd_mm: float) -> tuple[Array, Array]:
    """Return the covariances of a joint's centre in the frames of its parent's and its child's receiver.

    Parameters
    ----------
    covariance_mm2 : array, shape (36,), or None
        Covariance of both halves together, parent first, mm^2; None if only sd_mm is stated, which is then
        taken as isotropic.
    sd_mm : float
        1-sigma error in 3-D, mm.

    Returns
    -------
    parent, child : arrays, shape (3, 3)
        Covariances, mm^2; NaN for a half whose error is not stated.

    """
    if covariance_mm2 is None:
        ball = sd_mm**2 / 3 * np.eye(3)
        return ball, ball
    whole = np.reshape(np.asarray(covariance_mm2, float), (6, 6))
    halves = whole[:3, :3], whole[3:, 3:]
    parent, child = (half if np.trace(half) else np.full((3, 3), np.nan) for half in halves)
    return parent, child


def is_within_95(off_mm: Array, covariance_mm2: Array) -> bool | None:
    """Return whether an error is in the 95 % region of its covariance: off^T C^-1 off <= CHI_SQUARE_95.

    off_mm : error, shape (3,), mm. covariance_mm2 : shape (3, 3), mm^2; variances that are zero up to
    rounding are raised to a tiny share of the largest one. Returns None if any number is NaN.
    """
    if not (np.isfinite(off_mm).all() and np.isfinite(covariance_mm2).all()):
        return None
    variances, axes = np.linalg.eigh(covariance_mm2)
    parts = (axes.T @ off_mm) ** 2 / np.maximum(variances, _LEAST_SHARE * variances[-1])
    return bool(parts.sum() <= CHI_SQUARE_95)


def radius_95_mm(covariance_mm2: Array) -> float:
    """Return the radius, mm, of the ball that contains 95 % of errors with a covariance (3, 3), mm^2.

    It is the root of the quantile of a sum of squares with variances l_i, by Jensen & Solomon (1972): with
    t_k = sum l_i^k and h = 1 - 2 t_1 t_3 / (3 t_2^2), (sum / t_1)^h is approximately normal with mean
    1 + t_2 h (h - 1) / t_1^2 and variance 2 t_2 h^2 / t_1^2. The result is within 1.3 % of the exact radius,
    which is 1.61 (equal variances) to 1.96 (errors along a line) times the sd.
    """
    first, second, third = ((np.linalg.eigvalsh(covariance_mm2) ** k).sum() for k in (1, 2, 3))
    h = 1 - 2 * first * third / (3 * second**2)
    root = NORMAL_95 * np.sqrt(2 * second) * h / first + 1 + second * h * (h - 1) / first**2
    return float(np.sqrt(first * root ** (1 / h)))
