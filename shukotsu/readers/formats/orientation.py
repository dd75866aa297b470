"""A mapping's numbers of an orientation, whichever they are, as quaternions (w, x, y, z)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.hand.rotations import Array, about_axis, conjugate, from_matrix, multiply, nearest_rotation

TOLERANCE = 1e-2
"""How far a matrix may be off a rotation, element by element of R^T R, and still be rounding."""


def quaternions(numbers: Array, orientation: Mapping[str, Any], locate: Callable[[int], str]) -> Array:
    """Return quaternions that take receiver coordinates to the transmitter frame.

    numbers : (N, 4), (N, 3) or (N, 9) as the mapping's `orientation` says, NaN where there is none.
    locate : row -> file and line, for messages. Returns (N, 4), (w, x, y, z), for angles and matrices unit;
    a row of angles or of a matrix that lacks a number is NaN altogether, one with an infinite number
    infinite. Raises InputError at the first matrix that is no rotation.
    """
    kind = orientation["kind"]
    if kind == "quaternion":
        turned = numbers if orientation["order"] == "wxyz" else numbers[:, [3, 0, 1, 2]]
    elif kind == "euler":  # Polhemus azimuth, elevation, roll are ZYX (LIBERTY user manual, attitude matrix)
        # R = R_a(first) R_b(second) R_c(third): each turn is about the receiver's axes as they then stand
        angles_rad = np.radians(numbers) if orientation["unit"] == "deg" else numbers
        angles_rad = np.where(np.isfinite(angles_rad), angles_rad, np.nan)
        axes = [np.eye(3)["XYZ".index(axis)] for axis in orientation["axes"]]
        first, second, third = (about_axis(axis, angles_rad[:, i]) for i, axis in enumerate(axes))
        turned = multiply(multiply(first, second), third)
        turned = np.where(np.isnan(angles_rad).any(-1, keepdims=True), np.nan, turned)
    else:
        turned = from_matrix(proper_rotations(numbers.reshape(-1, 3, 3), locate))
    if kind != "quaternion":
        turned = np.where(np.isinf(numbers).any(-1, keepdims=True), np.inf, turned)
    return conjugate(turned) if orientation["rotates"] == "transmitter-to-receiver" else np.asarray(turned)


def proper_rotations(matrices: Array, locate: Callable[[int], str]) -> Array:
    """Return the rotation nearest to each matrix, shape (N, 3, 3); NaN where a number is missing or infinite.

    Raises InputError at the first that is mirrored or off by more than TOLERANCE: a nearest rotation of
    something else would be made up.
    """
    rotations = np.full(matrices.shape, np.nan)
    whole = np.isfinite(matrices).all((-2, -1))
    some = matrices[whole]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(np.swapaxes(some, -1, -2) @ some - np.eye(3)).max((-2, -1))
        mirrored = np.linalg.det(some) < 0
    bad = ~(off <= TOLERANCE) | mirrored
    if bad.any():
        first = int(np.argmax(bad))
        what = (
            f"the matrix is no rotation: its columns are off unit length and right angles by "
            f"{off[first]:.3g}; expected {TOLERANCE} at most; check which numbers these are"
        )
        if mirrored[first] and off[first] <= TOLERANCE:
            what = (
                "the rotation is mirrored (determinant -1); expected a right-handed one (+1); "
                "an axis was negated on the way, so export it again from a right-handed system"
            )
        if not some[first].any():
            what = "the rotation is all zeros; zeros that stand for missing values must be written as NaN"
        raise InputError(f"{locate(int(np.flatnonzero(whole)[first]))}: {what}")
    rotations[whole] = nearest_rotation(some)
    return rotations
