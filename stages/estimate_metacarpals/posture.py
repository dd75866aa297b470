"""Eq. 8-11: a metacarpal's posture from where its MCP joint is and how the proximal phalanx is turned.

Everything is seen from the hand. For the paper's factor 1 in Eq. 11 that is the same as seen from the
transmitter; for other factors it keeps a turn of the whole hand out of the bone's own twist, and it keeps
the swing small, so that turning the hand over is no singularity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, about_axis, multiply, rotate, unit

SWING_LIMIT_DEG = 175.0
"""Beyond this the axis of Eq. 8 is the difference of two nearly opposite vectors."""

TWIST_LIMIT_DEG = 75.0
"""MCP flexion beyond which the proximal normal's component across the metacarpal is too short to trust
(at 90 deg it vanishes)."""


@dataclass(frozen=True)
class Posture:
    """A metacarpal's change of posture since the reference frame, seen from the hand.

    change : (T, 4) unit quaternions, q_meta * q_swing. swing_rad, twist_rad : (T,), twist after Eq. 11.
    swing_singular, twist_singular : (T,) where the angle is not to be trusted.
    """

    change: Array
    swing_rad: Array
    twist_rad: Array
    swing_singular: npt.NDArray[np.bool_]
    twist_singular: npt.NDArray[np.bool_]


def swing(start: Array, vector: Array) -> tuple[Array, Array]:
    """Eq. 8-10: the shortest rotation that takes `start` (3,) to each `vector` (T, 3).

    Returns unit quaternions (T, 4) and angles (T,) in radians. The angle is atan2(|a|, v1 . vk): acos
    loses half the digits of a small angle. Where both vectors are parallel the rotation is none.
    """
    axis = np.cross(start, vector)
    angle = np.arctan2(np.linalg.norm(axis, axis=-1), vector @ start)
    return about_axis(unit(axis), angle), angle


def twist(vector: Array, normal_metacarpal: Array, normal_proximal: Array) -> tuple[Array, Array]:
    """Fig. 6-8: the angle about the metacarpal from its normal to the proximal phalanx's.

    vector : (T, 3) along the metacarpal. normal_metacarpal : (T, 3) at right angles to it.
    normal_proximal : (T, 3) unit. Returns signed angles (T,) in radians about `vector`, and the length
    (T,) of the proximal normal's component across it: 1 at no MCP flexion, 0 where the angle is lost.
    """
    along = unit(vector)
    across = normal_proximal - along * np.sum(along * normal_proximal, -1, keepdims=True)
    sine = np.sum(along * np.cross(normal_metacarpal, across), -1)
    cosine = np.sum(normal_metacarpal * across, -1)
    return np.arctan2(sine, cosine), np.linalg.norm(across, axis=-1)


def estimate_posture(
    vector: Array, normal_proximal: Array, normal_reference: Array, reference: int, twist_factor: float
) -> Posture:
    """Swing first, then twist about the swung bone, both relative to the reference frame.

    vector : (T, 3) mm from the metacarpal's base to the MCP joint, v(k). normal_proximal : (T, 3) unit.
    normal_reference : (3,) unit, the metacarpal's normal in the reference frame, at right angles to v.
    reference : the frame that the paper calls 1, whose vector must not be zero.
    twist_factor : Eq. 11's factor between the metacarpal's twist and the proximal phalanx's.
    """
    swung, swing_rad = swing(vector[reference], vector)
    carried = rotate(swung, normal_reference)
    angle, across = twist(vector, carried, normal_proximal)
    relative = np.angle(np.exp(1j * (angle - angle[reference])))
    twist_rad = twist_factor * relative
    return Posture(
        change=multiply(about_axis(unit(vector), twist_rad), swung),
        swing_rad=swing_rad,
        twist_rad=twist_rad,
        swing_singular=swing_rad > np.radians(SWING_LIMIT_DEG),
        twist_singular=across < np.cos(np.radians(TWIST_LIMIT_DEG)),
    )


def bone_frame(direction: Array, dorsal: Array) -> Array:
    """Rotation matrices (..., 3, 3) of a bone's frame: x along `direction`, z towards `dorsal`.

    Both (..., 3), in the frame that the result turns into; neither zero nor parallel.
    """
    x = unit(direction)
    z = unit(dorsal - x * np.sum(x * dorsal, -1, keepdims=True))
    return np.stack([x, np.cross(z, x), z], -1)


def circular_mean_rad(angle_rad: Array) -> float:
    """Mean direction of angles, radians."""
    return float(np.angle(np.mean(np.exp(1j * angle_rad))))
