"""Three angles of a rotation over time, without jumps."""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton.rotations import Array


def continuous_angles(angles_rad: Array) -> Array:
    """Angles (T, ..., 3) in rad of turns about three axes at right angles, continuous over time.

    angles_rad : those of each frame by itself. Of the two triples of every rotation, (a, b, c) and
    (a + 180, 180 - b, c + 180 deg), that which is nearer to the frame before; then unwrapped. The first frame
    stays as it is.
    """
    other = angles_rad * np.array([1.0, -1.0, 1.0]) + np.pi
    swapped = _distance(other[1:], angles_rad[:-1]) < _distance(angles_rad[1:], angles_rad[:-1])
    # second to second is as far as first to first
    swapped = np.concatenate([np.zeros((1, *swapped.shape[1:]), bool), swapped])
    second = np.logical_xor.accumulate(swapped, axis=0)
    return np.asarray(np.unwrap(np.where(second[..., None], other, angles_rad), axis=0))


def _distance(first: Array, second: Array) -> Array:
    """Sum of three angles' distances (...) in rad, whole turns aside."""
    return np.asarray(np.abs(np.mod(first - second + np.pi, 2 * np.pi) - np.pi).sum(-1))
