"""From the numbers of N records of one output list, by name, to Records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinematics.rotations import Array
from stages.capture.trackers.orientation import quaternion_of_angles, quaternion_of_cosines
from stages.capture.trackers.plausibility import doubtful_poses
from stages.capture.trackers.records import Records

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
        found = _quaternion(numbers)
        if found is not None:
            records.quaternion[:] = found
        for name in _COUNTERS:
            if name in numbers:
                getattr(records, name)[:] = numbers[name]
        records.doubtful[:] = doubtful_poses(records, position=position, orientation=found is not None)
    for name, most in _MOST.items():
        if name in numbers:
            values = getattr(records, name)
            records.doubtful[:] |= (values < 0) | (values > most)


def _quaternion(numbers: Mapping[str, np.ndarray]) -> Array | None:
    if "qw" in numbers:
        return np.stack([numbers[f"q{part}"] for part in "wxyz"], -1, dtype=float)
    if "azimuth" in numbers:
        angles = [numbers[name] for name in ("azimuth", "elevation", "roll")]
        return quaternion_of_angles(np.stack(angles, -1, dtype=float))
    rows = {axis: _row(numbers, axis) for axis in _AXES if f"cosine_{axis}x" in numbers}
    if len(rows) < 2:
        return None
    for axis in _AXES:  # the row that was not asked for stands upright on the other two
        if axis not in rows:
            following = [_AXES[(_AXES.index(axis) + step) % 3] for step in (1, 2)]
            rows[axis] = np.cross(rows[following[0]], rows[following[1]])
    return quaternion_of_cosines(np.stack([rows[axis] for axis in _AXES], -2))


def _row(numbers: Mapping[str, np.ndarray], axis: str) -> Array:
    return np.stack([numbers[f"cosine_{axis}{column}"] for column in _AXES], -1, dtype=float)
