"""Model the effect of moving skin on a joint's centre, as unknowns beside the centre that stay linear.

A slide in step with the joint's angle (`anatomy.skin`) leaves almost no gap; the data cannot tell it from a
centre elsewhere: c mm per rad move the centre by c mm. Here each slide is an unknown with a prior of the
literature's size, and what the data cannot decide becomes part of the centre's uncertainty. The two axes of
the thumb's CMC joint pass each other at some millimetres: the point midway between them moves like a slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.anatomy.average_hand import SKEW_MM
from shukotsu.skeleton.rotations import Array

SKEW_SD_MM = SKEW_MM / 2
"""Per rad of either angle of the thumb's CMC joint: half the distance of its axes."""


@dataclass(frozen=True)
class Drift:
    """Hold how a centre moves over the frames: columns (N, 3, K), prior mean (K,) and covariance (K, K)."""

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
