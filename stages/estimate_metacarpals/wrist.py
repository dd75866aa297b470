"""The wrist point that digits start from: fitted, measured, or the point that keeps its distance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shukotsu.skeleton.rotations import Array

DISTANCE_SD_MM = 1.0
"""How far skin lets the distance between wrist and MCP joint vary."""

INDEPENDENT_SAMPLES = 20.0
"""Independent samples in a recording of some ten seconds, for each digit."""

NOMINAL_SD_MM = 15.0
"""How far a wrist lies from that of the average hand, receiver placement included."""

MAX_FRAMES = 4096


@dataclass(frozen=True)
class WristPoint:
    """point_mm : (3,) and covariance_mm2 : (3, 3), in the hand receiver's frame."""

    point_mm: Array
    covariance_mm2: Array


def estimate_wrist(mcp_mm: list[Array], nominal_mm: Array) -> WristPoint:
    """The point whose distance to every MCP joint varies least.

    mcp_mm : per digit (T, 3) positions of its MCP joint in the hand receiver's frame, gaps left out.
    nominal_mm : (3,) the wrist of an average hand, which decides what the data leave open: in a palm that
    does not move every point keeps its distance. Minimises
    samples / sd^2 * sum over digits of var_k |MCP(k) - w| + |w - nominal|^2 / sd_nominal^2
    by Gauss-Newton steps.
    """
    digits = tuple(
        positions[:: max(1, len(positions) // MAX_FRAMES)].T.tobytes()
        for positions in mcp_mm
        if len(positions)
    )
    return _estimate(digits, tuple(map(float, nominal_mm)))


@lru_cache(maxsize=4)
def _estimate(positions: tuple[bytes, ...], nominal_mm: tuple[float, ...]) -> WristPoint:
    """Do the same for positions (3, T) as bytes, kept: a hand's models differ beyond the MCP joints."""
    digits = [np.frombuffer(one).reshape(3, -1) for one in positions]
    nominal = np.array(nominal_mm)
    point = nominal.copy()
    hessian = np.eye(3) / NOMINAL_SD_MM**2
    for _ in range(50):
        hessian, gradient = _normal_equations(digits, point, nominal)
        step = np.linalg.solve(hessian, gradient)
        point = point - step
        if np.linalg.norm(step) < 1e-9:
            break
    covariance = np.linalg.inv(hessian)
    for array in (point, covariance):
        array.flags.writeable = False
    return WristPoint(point, np.asarray(covariance))


def _normal_equations(digits: list[Array], point: Array, nominal: Array) -> tuple[Array, Array]:
    """Hessian and gradient at a point; digits : (3, T) positions, an axis at a time."""
    hessian = np.eye(3) / NOMINAL_SD_MM**2
    gradient = (point - nominal) / NOMINAL_SD_MM**2
    for positions in digits:
        count = positions.shape[1]
        x, y, z = positions - point[:, None]
        distance = np.sqrt(x * x + y * y + z * z)
        slope = np.empty((count, 3))
        for axis, offset in enumerate((x, y, z)):
            along = -offset / distance
            slope[:, axis] = along - np.cumsum(along)[-1] / count  # summed in order, as rows of (T, 3) are
        weight = INDEPENDENT_SAMPLES / DISTANCE_SD_MM**2 / count
        hessian = hessian + weight * slope.T @ slope
        gradient = gradient + weight * slope.T @ (distance - distance.mean())
    return hessian, gradient
