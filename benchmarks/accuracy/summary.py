"""Errors of many hands summed up: what a row of the tables says of one estimator in one scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy.errors import HandScore, JointError
from kinematics.rotations import Array

GROSS_MM = 5.0


@dataclass(frozen=True)
class Summary:
    """One estimator over many hands; None where nothing was estimated or stated.

    Distances in mm over all counted joints of all hands; gross_percent : share beyond 5 mm; axis_deg,
    bone_percent : medians over hinges and phalanges; palm_deg : mean over the ring's and the little finger's
    metacarpals; radius_percent, ellipsoid_percent : how often the stated 95 % hold the truth; seconds : mean.
    """

    n_hands: int
    median_mm: float | None
    p90_mm: float | None
    along_mm: float | None
    across_mm: float | None
    gross_percent: float | None
    axis_deg: float | None
    bone_percent: float | None
    palm_deg: float | None
    radius_percent: float | None
    ellipsoid_percent: float | None
    seconds: float | None


def summary(hands: Sequence[HandScore]) -> Summary:
    """Sum up the scores of one estimator."""
    joints = [joint for hand in hands for joint in hand.joints]
    child = _finite(joint.child_mm for joint in joints)
    return Summary(
        len(hands),
        _of(np.median, child),
        _of(lambda values: np.percentile(values, 90), child),
        _of(np.median, _finite(joint.along_mm for joint in joints)),
        _of(np.median, _finite(joint.across_mm for joint in joints)),
        _of(np.mean, np.asarray(100.0 * (child > GROSS_MM))),
        _of(np.median, _finite(joint.axis_deg for joint in joints)),
        _of(np.median, _finite(percent for hand in hands for percent in hand.bones_percent)),
        _of(np.mean, _finite(angle for hand in hands for angle in hand.palm_deg)),
        _of(np.mean, 100.0 * _stated(joints, lambda joint: joint.in_radius)),
        _of(np.mean, 100.0 * _stated(joints, lambda joint: joint.in_ellipsoid)),
        _of(np.mean, _finite(hand.seconds for hand in hands)),
    )


def errors_mm(hands: Iterable[HandScore]) -> Array:
    """Distances of all centres in mm, sorted."""
    return np.asarray(np.sort(_finite(joint.child_mm for hand in hands for joint in hand.joints)))


def _stated(joints: Iterable[JointError], what: Callable[[JointError], float | None]) -> Array:
    return np.array([value for joint in joints if (value := what(joint)) is not None], float)


def _finite(values: Iterable[float]) -> Array:
    found = np.fromiter(values, float)
    return np.asarray(found[np.isfinite(found)])


def _of(statistic: Callable[..., object], values: Array) -> float | None:
    return float(statistic(values)) if len(values) else None  # type: ignore[arg-type]
