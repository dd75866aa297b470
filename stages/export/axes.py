"""Units and the axis that points up: proper rotations of the world, never a mirror, so that left stays left.

The world is the transmitter's frame, and the motion is relative to the transmitter. Which of its axes points
up depends on how the transmitter stands, so that the user may say; z is the default. Bone frames do not
change: they are turned with the world.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.files.long_arrays import by_point
from shukotsu.skeleton.rotations import Array, about_axis, multiply, rotate
from shukotsu.stages.export.motion import SkeletonMotion

UNITS_PER_MM = {"m": 1e-3, "cm": 0.1, "mm": 1.0}
"""What a length in mm is multiplied by."""

DIRECTIONS = {
    f"{sign}{name}": (-1.0 if sign else 1.0) * axis
    for sign in ("", "-")
    for name, axis in zip("xyz", np.eye(3), strict=True)
}
"""Axes of a frame by name: x, y, z, -x, -y, -z."""


@dataclass(frozen=True)
class Target:
    """Hold what a file's numbers mean: its unit of length (m, cm or mm) and the axis that points up.

    up : y or z, or empty where the file is in the transmitter's own frame.
    """

    unit: str
    up: str


def upright(transmitter_up: str, up: str) -> Array:
    """Quaternion (4,) of the shortest rotation that takes one axis, of the transmitter's, to another.

    transmitter_up : the transmitter's axis that points up. up : the axis of the file that does. Half a turn
    is about x: of -z to z, or -y to y.
    """
    start, end = DIRECTIONS[transmitter_up], DIRECTIONS[up]
    axis = np.cross(start, end)
    if not axis.any():
        half_turn = float(np.pi) if start @ end < 0 else 0.0
        return about_axis(DIRECTIONS["x"], half_turn)
    return about_axis(axis, np.pi / 2)


def turned(motion: SkeletonMotion, turn: Array) -> SkeletonMotion:
    """Give the motion in a world that is turned by the quaternion (4,): new = turn * old. Still in mm."""
    return motion.mapped(
        lambda places: by_point(lambda series: rotate(turn, series), places),
        lambda turns: by_point(lambda series: multiply(turn, series), turns),
    )
