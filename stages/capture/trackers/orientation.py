"""What trackers send of orientation, as quaternions (w, x, y, z), receiver to transmitter frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, from_matrix

ROTATION_TOLERANCE = 1e-2
"""How far R^T R may be off the identity, element by element: more than rounding to 14 bits or 4 decimals."""


def quaternion_of_angles(angles_deg: Array) -> Array:
    """Unit quaternions of azimuth, elevation and roll, R = Rz(azimuth) Ry(elevation) Rx(roll).

    angles_deg : (N, 3). Returns (N, 4); NaN where an angle is not finite. Source: LIBERTY User Manual
    URM03PH156, attitude matrix; FASTRAK, VIPER and Flock of Birds use the same angles.
    """
    finite: npt.NDArray[np.bool_] = np.all(np.isfinite(angles_deg), axis=-1)
    half = np.radians(np.where(finite[:, None], angles_deg, np.nan)) / 2
    (ca, ce, cr), (sa, se, sr) = np.cos(half).T, np.sin(half).T
    out = np.empty((len(angles_deg), 4))
    out[:, 0] = cr * ce * ca + sr * se * sa
    out[:, 1] = sr * ce * ca - cr * se * sa
    out[:, 2] = cr * se * ca + sr * ce * sa
    out[:, 3] = cr * ce * sa - sr * se * ca
    return out


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
