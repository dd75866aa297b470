"""Poses of N records from the numbers that a tracker sends, and which of them cannot be right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton.rotations import Array, about_axis, from_matrix, multiply
from shukotsu.trackers.protocols.records import Records

ROTATION_TOLERANCE = 1e-2
"""How far R^T R may be off the identity, element by element: more than rounding of its float32."""

NORM_TOLERANCE = 1e-3
FARTHEST_MM = 3048.0
"""120 inches: no magnetic tracker of this kind sees farther."""

_AXES = "xyz"
_COUNTERS = ("frame", "device_ms", "button", "distortion", "sync")
_MOST = {"button": 1, "distortion": 2, "sync": 1}


def fill_in(records: Records, numbers: Mapping[str, np.ndarray], mm_per_unit: float) -> None:
    """Put the numbers into records of which they are all that is not known yet.

    numbers : name -> (N,), any of x, y, z; qw, qx, qy, qz; azimuth, elevation, roll in degrees; cosine_xx to
    cosine_zz; frame, device_ms, button, distortion, sync. Other names are not read.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs, and floats beyond any tracker
        position = "x" in numbers
        if position:
            for column, axis in enumerate(_AXES):
                np.multiply(numbers[axis], mm_per_unit, out=records.position_mm[:, column], dtype=float)
        quaternion = _quaternion(numbers)
        if quaternion is not None:
            records.quaternion[:] = quaternion
        for name in _COUNTERS:
            if name in numbers:
                getattr(records, name)[:] = numbers[name]
        records.doubtful[:] = doubtful_poses(records, position=position, orientation=quaternion is not None)
    for name, most in _MOST.items():
        if name in numbers:
            values = getattr(records, name)
            records.doubtful[:] |= (values < 0) | (values > most)


def doubtful_poses(
    records: Records, *, position: bool = True, orientation: bool = True
) -> npt.NDArray[np.bool_]:
    """Whether poses cannot be right, (N,): not finite, no unit quaternion, farther than FARTHEST_MM.

    position, orientation : whether the stream has them; what it does not have is no reason.
    """
    wrong = np.zeros(len(records), bool)
    if position:
        squared = np.einsum("ij,ij->i", records.position_mm, records.position_mm)
        wrong |= ~(squared <= FARTHEST_MM**2)
    if orientation:
        squared = np.einsum("ij,ij->i", records.quaternion, records.quaternion)
        wrong |= ~(np.abs(squared - 1) <= 2 * NORM_TOLERANCE)
    return wrong


def quaternion_of_angles(angles_deg: Array) -> Array:
    """Unit quaternions of azimuth, elevation and roll, R = Rz(azimuth) Ry(elevation) Rx(roll).

    angles_deg : (N, 3). Returns (N, 4) w, x, y, z; NaN where an angle is not finite. Source: LIBERTY User
    Manual URM03PH156, attitude matrix; VIPER uses the same angles.
    """
    finite = np.isfinite(angles_deg).all(-1, keepdims=True)
    azimuth, elevation, roll = np.radians(np.where(finite, angles_deg, np.nan)).T
    x, y, z = np.eye(3)
    return multiply(multiply(about_axis(z, azimuth), about_axis(y, elevation)), about_axis(x, roll))


def quaternion_of_cosines(cosines: Array) -> Array:
    """Unit quaternions (w >= 0) of direction cosines, whose columns are the receiver's axes.

    cosines : (N, 3, 3). Returns (N, 4); NaN where the matrix is no rotation: a number is not finite, it is
    mirrored, or R^T R is off the identity by more than ROTATION_TOLERANCE.
    """
    bounded: npt.NDArray[np.bool_] = np.all(np.abs(cosines) < 2, axis=(-2, -1))  # False for NaN too
    matrices = np.where(bounded[:, None, None], cosines, np.eye(3))
    off = np.abs(np.swapaxes(matrices, -1, -2) @ matrices - np.eye(3)).max((-2, -1))
    proper = bounded & (off <= ROTATION_TOLERANCE) & (np.linalg.det(matrices) > 0)
    matrices[~proper] = np.eye(3)
    return np.where(proper[:, None], from_matrix(matrices), np.nan)


def _quaternion(numbers: Mapping[str, np.ndarray]) -> Array | None:
    if "qw" in numbers:
        return np.stack([numbers[f"q{part}"] for part in "wxyz"], -1, dtype=float)
    if "azimuth" in numbers:
        angles = [numbers[name] for name in ("azimuth", "elevation", "roll")]
        return quaternion_of_angles(np.stack(angles, -1, dtype=float))
    if "cosine_xx" not in numbers:
        return None
    cosines = [numbers[f"cosine_{row}{column}"] for row in _AXES for column in _AXES]
    return quaternion_of_cosines(np.stack(cosines, -1, dtype=float).reshape(-1, 3, 3))
