"""What moving skin does to a joint's centre, as unknowns beside the centre that stay linear.

A receiver that slides and tilts on its bone in step with a joint's angle sees the centre move in its frame
by (slide + tilt x lever) per rad. That leaves almost no gap, so the data cannot tell such a slide from a
centre elsewhere: c mm per rad move the centre by c mm. Here each slide is an unknown with a prior of the
literature's size, and what the data cannot decide becomes part of the centre's uncertainty.

Sources: marker spacings on a finger change by less than 5 % in a pinch (Yang et al. 2002), 2 mm along a
proximal phalanx; excursions are linear in flexion with R^2 of 0.89 to 0.97 (Zhang et al. 2003); markers
under-read DIP flexion by 11 %, PIP flexion by 2 % (Metcalf et al. 2020), hence the tilt. The two axes of the
thumb's CMC joint are 4.6 mm apart (Chang & Pollard 2008): the point midway between them moves like a slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Array

SLIDE_SD_MM = (1.0, 0.45, 0.45)
"""Per rad of an adjacent joint: along, lateral, dorsal."""

TILT_SD = 0.05
"""Rad per rad, about each axis."""

PALM_SLIDE_SD_MM = 0.5
"""The palm's skin is tight under a receiver, and no joint is next to it but the wrist."""

UNKNOWN_SLIDE_SD_MM = 2.0
NAIL, THUMB_METACARPAL = 0.6, 1.5
"""Of the usual slide: the distal phalanx, whose nail holds the receiver; the thenar, whose muscles swell."""

UNDER_READING, UNDER_READING_SD = 0.2, 0.15
"""Share of the thumb metacarpal's rotation that its receiver does not follow."""

DISTAL_UNDER_READING = 0.055
"""Half of what is missing of DIP flexion: the other half is the middle phalanx's."""

SKEW_SD_MM = 2.3
"""Per rad of either angle: half the distance of the thumb's CMC axes."""

REMAINDER = 0.5
"""Share of a slide that is not linear in the angle (lag, saturation), from the lowest R^2 with a margin."""


@dataclass(frozen=True)
class Drift:
    """How a centre moves over the frames: columns (N, 3, K), prior mean (K,) and covariance (K, K)."""

    columns: Array
    mean: Array
    covariance: Array


def drift(columns: Array, covariance: Array, mean: Array | None = None) -> Drift:
    """Give a drift whose prior mean is zero unless told otherwise."""
    return Drift(columns, np.zeros(columns.shape[-1]) if mean is None else mean, covariance)


def stacked(drifts: Sequence[Drift]) -> Drift:
    """All drifts of a joint as one; their priors are independent of each other."""
    size = [len(one.mean) for one in drifts]
    covariance = np.zeros((sum(size), sum(size)))
    for start, one in zip(np.cumsum([0, *size]), drifts, strict=False):
        rows = slice(start, start + len(one.mean))
        covariance[rows, rows] = one.covariance
    return Drift(
        np.concatenate([one.columns for one in drifts], -1),
        np.concatenate([one.mean for one in drifts]),
        covariance,
    )


def slide_covariance(segment: str, axes: Array, lever_mm: Array, looseness: float) -> Array:
    """Covariance (3, 3), mm^2 per rad^2, of the motion of a point on a bone seen by its receiver.

    axes : (3, 3) from the bone's axes to the receiver's; lever_mm : (3,) the point, from the receiver.
    """
    loose = looseness
    if segment == "thumb_metacarpal":
        loose *= THUMB_METACARPAL
    elif segment.endswith("_distal"):
        loose *= NAIL
    cross = cross_matrix(lever_mm)
    slide = axes @ np.diag(np.square(SLIDE_SD_MM)) @ axes.T
    return np.asarray(loose**2 * (slide + TILT_SD**2 * cross @ cross.T))


def cross_matrix(vector: Array) -> Array:
    """The matrix (3, 3) that crosses `vector` with what it is multiplied with."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
