"""Eq. 8-11: a metacarpal's posture from where its MCP joint is and how the proximal phalanx is turned.

Everything is seen from the hand. For the paper's factor 1 in Eq. 11 that is the same as seen from the
transmitter; for other factors it keeps a turn of the whole hand out of the bone's own twist, and it keeps
the swing small, so that turning the hand over is no singularity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.hand.rotations import Array, about_axis, multiply, rotate, unit

SWING_LIMIT_DEG = 175.0
"""Beyond this the axis of Eq. 8 is the difference of two nearly opposite vectors."""

TWIST_LIMIT_DEG = 75.0
"""MCP flexion beyond which the proximal normal's component across the metacarpal is too short to trust
(at 90 deg it vanishes)."""


@dataclass(frozen=True)
class Posture:
    """A metacarpal's change of posture since the reference frame, seen from the hand.

    change : (T, 4), q_meta * q_swing. swing_rad, twist_rad : (T,), twist after Eq. 11; singular : (T,) where
    not to be trusted.
    """

    change: Array
    swing_rad: Array
    twist_rad: Array
    swing_singular: npt.NDArray[np.bool_]
    twist_singular: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Reference:
    """The frame that the paper calls 1, seen from the hand.

    vector_mm : (3,) to the MCP joint. normal : (3,) unit, the metacarpal's, across it. twist_rad : from it to
    the proximal phalanx's normal (Fig. 6).
    """

    vector_mm: Array
    normal: Array
    twist_rad: float

    @classmethod
    def of(cls, vector_mm: Array, normal: Array, normal_proximal: Array) -> Reference:
        """The reference from the vector and the normals, (3,) unit, of metacarpal and phalanx."""
        angle, _ = twist(vector_mm[None], normal[None], normal_proximal[None])
        return cls(vector_mm, normal, float(angle[0]))


def swing(start: Array, vector: Array) -> tuple[Array, Array]:
    """Eq. 8-10: the shortest rotation that takes `start` (3,) to each `vector` (T, 3).

    Returns unit quaternions (T, 4) and angles (T,), rad: atan2(|a|, v1 . vk), as acos loses half the digits
    of a small one.
    """
    axis = _cross(start, vector)
    angle = np.arctan2(np.sqrt(_dot(axis, axis)), _dot(vector, start))
    return about_axis(unit(axis), angle), angle


def twist(vector: Array, normal_metacarpal: Array, normal_proximal: Array) -> tuple[Array, Array]:
    """Fig. 6-8: the angle about the metacarpal (T, 3) from its normal to the proximal phalanx's, unit.

    Returns signed angles (T,) in radians, and the length (T,) of the proximal normal's component across: 0
    where the angle is lost.
    """
    along = unit(vector)
    across = normal_proximal - along * _dot(along, normal_proximal)[:, None]
    sine = _dot(along, _cross(normal_metacarpal, across))
    cosine = _dot(normal_metacarpal, across)
    return np.arctan2(sine, cosine), np.sqrt(_dot(across, across))


def estimate_posture(
    vector: Array, normal_proximal: Array, reference: Reference, twist_factor: float
) -> Posture:
    """Swing first, then twist about the swung bone; vector : (T, 3) mm, v(k), normal : (T, 3) unit."""
    swung, swing_rad = swing(reference.vector_mm, vector)
    carried = rotate(swung, reference.normal)
    angle, across = twist(vector, carried, normal_proximal)
    relative = np.angle(np.exp(1j * (angle - reference.twist_rad)))
    twist_rad = twist_factor * relative
    return Posture(
        change=multiply(about_axis(unit(vector), twist_rad), swung),
        swing_rad=swing_rad,
        twist_rad=twist_rad,
        swing_singular=swing_rad > np.radians(SWING_LIMIT_DEG),
        twist_singular=across < np.cos(np.radians(TWIST_LIMIT_DEG)),
    )


def _cross(first: Array, second: Array) -> Array:
    """Cross products (..., 3); a component at a time, which takes a fraction of np.cross' time."""
    a, b, c = np.moveaxis(first, -1, 0)
    x, y, z = np.moveaxis(second, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], -1)


def _dot(first: Array, second: Array) -> Array:
    """Scalar products (...) of vectors (..., 3), each frame's the same whatever frames are beside it."""
    a, b, c = np.moveaxis(first, -1, 0)
    x, y, z = np.moveaxis(second, -1, 0)
    return np.asarray(a * x + b * y + c * z)
