"""Analyse a joint's rotation: its main axis, the angle about it, and how many axes the rotation needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton.angle_range import angle_range
from shukotsu.skeleton.rotations import Array, conjugate, from_matrix, matrix, multiply, nearest_rotation
from shukotsu.stages.solve_joints.posture_sample import rotation_vector

SKIN_FLOOR_DEG = 4.0
"""Skin alone turns receivers by this much (Metcalf et al. 2020), so less says nothing about a joint."""

_HINGE, _UNIVERSAL = 0.2, 0.35


@dataclass(frozen=True)
class JointMotion:
    """Rotation of the child's receiver, seen from the parent's, over N frames.

    axis_parent, axis_child : (3,) unit, the main axis in either frame, with the sign of the hint. mean :
    (3, 3) child to parent, the middle posture. turn_rad : (N, 3) rotation vectors from there, in the child's
    frame; angle_rad : (N,) their part about the axis. spread_rad : (3,) principal standard deviations of
    turn_rad, largest first.
    """

    axis_parent: Array
    axis_child: Array
    mean: Array
    turn_rad: Array
    angle_rad: Array
    spread_rad: Array

    @property
    def range_deg(self) -> float:
        """Range of the angle about the axis."""
        return angle_range(np.degrees(self.angle_rad))

    @property
    def second_angle_rad(self) -> Array:
        """Angle (N,) about the second principal axis, at right angles to the main one."""
        rest = self.turn_rad - np.outer(self.angle_rad, self.axis_child)
        return np.asarray(rest @ np.linalg.svd(rest, full_matrices=False)[2][0])


def joint_motion(quaternion: Array, weights: Array, hint_child: Array) -> JointMotion:
    """Give the motion of quaternions (N, 4), child to parent frame, under weights (N,).

    The axis is the leading singular pair of the mean rotation matrix (SARA, Ehrig et al. 2007); hint_child :
    (3,) direction in the child's frame on whose side it shall point.
    """
    mean = ((weights / weights.sum()) @ matrix(quaternion).reshape(-1, 9)).reshape(3, 3)
    left, _, right = np.linalg.svd(mean)
    sign = 1.0 if right[0] @ hint_child >= 0 else -1.0
    axis_child, axis_parent = sign * right[0], sign * left[:, 0]
    middle = nearest_rotation(mean)
    turn = turns_from(middle, quaternion)
    covariance = (turn.T * (weights / weights.sum())) @ turn
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[::-1], 0.0))
    return JointMotion(axis_parent, axis_child, middle, turn, turn @ axis_child, spread)


def turns_from(mean: Array, quaternion: Array) -> Array:
    """Rotation vectors (N, 3) in rad from the rotation `mean` (3, 3) to quaternions (N, 4)."""
    return rotation_vector(multiply(conjugate(from_matrix(mean)), quaternion))


def degrees_of_freedom(spread_rad: Array, anatomical: int) -> int:
    """Give the number of axes, 1 to 3, that the motion shows; the anatomical one where it is too small.

    spread_rad : (3,) as in JointMotion. A motion about one axis is a hinge whatever the joint could do.
    """
    first, second, third = np.degrees(spread_rad)
    if first < SKIN_FLOOR_DEG:
        return max(anatomical, 1)
    if second < max(SKIN_FLOOR_DEG, _HINGE * first):
        return 1
    return 2 if third < max(SKIN_FLOOR_DEG, _UNIVERSAL * second) else 3
