"""Posture of a metacarpal from its MCP joint's position and the proximal phalanx's rotation (Eq. 8-11).

All directions are in the hand's frame. With the paper's factor 1 in Eq. 11 the result is the same as in the
transmitter's frame. With other factors, the hand's frame keeps a rotation of the whole hand out of the bone's
twist. In either case the swing stays small, so that turning the hand over is not a singularity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Float
from shukotsu.hand.rotations import Array, about_axis, cross, multiply, rotate, unit

SWING_LIMIT_DEG = 175.0
"""Swing beyond which the axis of Eq. 8 is poorly defined: the two vectors are nearly opposite."""

TWIST_LIMIT_DEG = 75.0
"""MCP flexion beyond which the twist is unreliable.

The component of the proximal normal perpendicular to the metacarpal shrinks with flexion and vanishes at 90
deg.
"""


@dataclass(frozen=True)
class Posture:
    """Change of a metacarpal's posture since the reference frame, seen from the hand.

    Attributes
    ----------
    change : array, shape (T, 4)
        q_meta * q_swing, unit quaternions (w, x, y, z).
    swing_rad, twist_rad : array, shape (T,)
        Swing angle, and twist angle after Eq. 11.
    swing_singular, twist_singular : array of bool, shape (T,)
        Whether the angle is near its singularity and therefore unreliable.

    """

    change: Array
    swing_rad: Array
    twist_rad: Array
    swing_singular: npt.NDArray[np.bool_]
    twist_singular: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Reference:
    """Reference frame of the posture (frame 1 of the paper), seen from the hand.

    Attributes
    ----------
    vector_mm : array, shape (3,)
        v(1), from the metacarpal's base to the MCP joint, mm.
    normal : array, shape (3,)
        Unit normal of the metacarpal, perpendicular to v(1).
    twist_rad : float
        Angle about v(1) from this normal to that of the proximal phalanx (Fig. 6).

    """

    vector_mm: Array
    normal: Array
    twist_rad: float

    @classmethod
    def of(cls, vector_mm: Array, normal: Array, normal_proximal: Array) -> Reference:
        """Build the reference of Eq. 8-10 from one frame.

        Parameters
        ----------
        vector_mm : array, shape (3,)
            v(1), in the base receiver's frame.
        normal, normal_proximal : array, shape (3,)
            Unit dorsal normals of the metacarpal and of the proximal phalanx, in the same frame.

        Returns
        -------
        Reference
            The reference, including the twist of that frame.

        """
        angle, _ = twist(vector_mm[None], normal[None], normal_proximal[None])
        return cls(vector_mm, normal, float(angle[0]))


def swing(
    start: Float[Array, " 3"], vector: Float[Array, "T 3"]
) -> tuple[Float[Array, "T 4"], Float[Array, " T"]]:
    """Compute the shortest rotations from one vector to each of several others (Eq. 8-10).

    Parameters
    ----------
    start : array, shape (3,)
        v(1).
    vector : array, shape (T, 3)
        v(k), in the same frame.

    Returns
    -------
    quaternion : array, shape (T, 4)
        Unit quaternions (w, x, y, z).
    angle : array, shape (T,)
        Swing angle, rad: atan2(|v1 x vk|, v1 . vk), since acos loses half the digits of a small angle.

    """
    axis = cross(start, vector)
    angle = np.arctan2(np.sqrt(_dot(axis, axis)), _dot(vector, start))
    return about_axis(unit(axis), angle), angle


def twist(
    vector: Float[Array, "T 3"], normal_metacarpal: Float[Array, "T 3"], normal_proximal: Float[Array, "T 3"]
) -> tuple[Float[Array, " T"], Float[Array, " T"]]:
    """Compute the angle about the metacarpal from its normal to that of the proximal phalanx (Fig. 6-8).

    Parameters
    ----------
    vector : array, shape (T, 3)
        v(k), of any length.
    normal_metacarpal, normal_proximal : array, shape (T, 3)
        Unit normals in the same frame.

    Returns
    -------
    angle : array, shape (T,)
        Signed angle, rad.
    across : array, shape (T,)
        Length of the proximal normal's component perpendicular to v(k); the angle is undefined if it is 0.

    """
    along = unit(vector)
    across = normal_proximal - along * _dot(along, normal_proximal)[:, None]
    sine = _dot(along, cross(normal_metacarpal, across))
    cosine = _dot(normal_metacarpal, across)
    return np.arctan2(sine, cosine), np.sqrt(_dot(across, across))


def estimate_posture(
    vector: Float[Array, "T 3"],
    normal_proximal: Float[Array, "T 3"],
    reference: Reference,
    twist_factor: float,
) -> Posture:
    """Estimate the posture of a metacarpal: swing first, then twist about the swung bone (Eq. 8-11).

    Parameters
    ----------
    vector : array, shape (T, 3)
        v(k) seen from the hand, mm.
    normal_proximal : array, shape (T, 3)
        Unit normal of the proximal phalanx, seen from the hand.
    reference : Reference
        The reference frame.
    twist_factor : float
        c of theta_meta = c * theta_pro; 1 in the paper.

    Returns
    -------
    Posture
        Change since the reference frame.

    """
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


def _dot(first: Array, second: Array) -> Array:
    """Return scalar products (...) of vectors (..., 3); a frame's result does not depend on other frames."""
    a, b, c = np.moveaxis(first, -1, 0)
    x, y, z = np.moveaxis(second, -1, 0)
    return np.asarray(a * x + b * y + c * z)
