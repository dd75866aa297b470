"""What moving skin does to a joint's centre, as unknowns beside the centre that stay linear.

A receiver that slides and tilts on its bone in step with a joint's angle sees the centre move in its frame
by (slide + tilt x lever) per rad. That leaves almost no gap, so the data cannot tell such a slide from a
centre elsewhere: c mm per rad move the centre by c mm. Here each slide is an unknown with a prior of the
literature's size, and what the data cannot decide becomes part of the centre's uncertainty.

The numbers are those of `anatomy.average_hand`. The two axes of the thumb's CMC joint pass each other at some
millimetres: the point midway between them moves like a slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anatomy.average_hand import (
    JOINTWISE_NAIL,
    JOINTWISE_SLIDE_SD_MM,
    JOINTWISE_THENAR,
    JOINTWISE_TILT_SD,
    SKEW_MM,
)
from skeleton.rotations import Array

SKEW_SD_MM = SKEW_MM / 2
"""Per rad of either angle of the thumb's CMC joint: half the distance of its axes."""


@dataclass(frozen=True)
class Drift:
    """How a centre moves over the frames: columns (N, 3, K), prior mean (K,) and covariance (K, K)."""

    columns: Array
    mean: Array
    covariance: Array


def drift(columns: Array, covariance: Array, mean: Array | None = None) -> Drift:
    """Give a drift whose prior mean is zero unless it is given."""
    return Drift(columns, np.zeros(columns.shape[-1]) if mean is None else mean, covariance)


def stacked(drifts: Sequence[Drift]) -> Drift:
    """All drifts of a joint as one; their priors are independent of each other."""
    size = [len(own.mean) for own in drifts]
    covariance = np.zeros((sum(size), sum(size)))
    for start, own in zip(np.cumsum([0, *size]), drifts, strict=False):
        rows = slice(start, start + len(own.mean))
        covariance[rows, rows] = own.covariance
    return Drift(
        np.concatenate([own.columns for own in drifts], -1),
        np.concatenate([own.mean for own in drifts]),
        covariance,
    )


def slide_covariance(segment: str, axes: Array, lever_mm: Array, looseness: float) -> Array:
    """Covariance (3, 3), mm^2 per rad^2, of the motion of a point on a bone seen by its receiver.

    axes : (3, 3) from the bone's axes to the receiver's; lever_mm : (3,) the point, from the receiver.
    """
    loose = looseness
    if segment == "thumb_metacarpal":
        loose *= JOINTWISE_THENAR
    elif segment.endswith("_distal"):
        loose *= JOINTWISE_NAIL
    cross = cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(JOINTWISE_SLIDE_SD_MM)) @ axes.T
    return np.asarray(loose**2 * (slide + JOINTWISE_TILT_SD**2 * cross @ cross.T))


def cross_matrix(vector: Array) -> Array:
    """The matrix (3, 3) that crosses `vector` with what it is multiplied with."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
