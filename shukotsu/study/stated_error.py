"""The 95 % region of a position whose stated error is a covariance: which errors are within, and its radius.

A covariance is rarely a ball: along a hinge's axis a centre is known several times less well than across it.
So an error is held against the covariance itself, by its Mahalanobis distance.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shukotsu.arrays import Array

CHI_SQUARE_95 = 7.815
"""95 % of squared Mahalanobis distances in three dimensions are smaller (chi-squared, 3 degrees)."""

NORMAL_95 = 1.645
"""95 % of normal numbers are smaller than so many sd."""

BALL_95 = 1.614
"""sqrt(CHI_SQUARE_95 / 3): the same of an error in 3-D over its 1-sigma size, as large in every direction."""

_LEAST_SHARE = 1e-9
"""Share of the largest variance below which one is a matter of rounding."""


def halves_mm2(covariance_mm2: Any, sd_mm: float) -> tuple[Array, Array]:
    """Covariances (3, 3) of a centre in its parent's and its child's receiver; NaN of one that is not stated.

    covariance_mm2 : (36,), mm^2, of both halves, parent first; None where only sd_mm, the 1-sigma error in
    3-D, is stated, which is taken as a ball.
    """
    if covariance_mm2 is None:
        ball = sd_mm**2 / 3 * np.eye(3)
        return ball, ball
    whole = np.reshape(np.asarray(covariance_mm2, float), (6, 6))
    parent, child = (
        np.full((3, 3), np.nan) if not np.trace(h) else h for h in (whole[:3, :3], whole[3:, 3:])
    )
    return parent, child


def is_within_95(off_mm: Array, covariance_mm2: Array) -> bool | None:
    """Whether an error (3,), mm, is within the 95 % of its covariance (3, 3), mm^2; None where one is NaN.

    off^T C^-1 off <= CHI_SQUARE_95, with variances that are zero but for rounding taken as next to nothing.
    """
    if not (np.isfinite(off_mm).all() and np.isfinite(covariance_mm2).all()):
        return None
    variances, axes = np.linalg.eigh(covariance_mm2)
    parts = (axes.T @ off_mm) ** 2 / np.maximum(variances, _LEAST_SHARE * variances[-1])
    return bool(parts.sum() <= CHI_SQUARE_95)


def radius_95_mm(covariance_mm2: Array) -> float:
    """Radius, mm, about a place within which 95 % of errors of that covariance (3, 3), mm^2, lie.

    The quantile of a sum of squares with variances l_i, by Jensen & Solomon (1972): with t_k = sum l_i^k and
    h = 1 - 2 t_1 t_3 / (3 t_2^2), (sum / t_1)^h is normal about 1 + t_2 h (h - 1) / t_1^2 with variance
    2 t_2 h^2 / t_1^2. Within 1.3 % of the exact radius, which is 1.61 (ball) to 1.96 (line) times the sd.
    """
    first, second, third = ((np.linalg.eigvalsh(covariance_mm2) ** k).sum() for k in (1, 2, 3))
    h = 1 - 2 * first * third / (3 * second**2)
    root = NORMAL_95 * np.sqrt(2 * second) * h / first + 1 + second * h * (h - 1) / first**2
    return float(np.sqrt(first * root ** (1 / h)))
