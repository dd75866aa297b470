"""The wrist point that digits start from: fitted, measured, or the point that keeps its distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Array

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
    nominal = np.asarray(nominal_mm, float)
    point = nominal.copy()
    digits = [positions[:: max(1, len(positions) // MAX_FRAMES)] for positions in mcp_mm if len(positions)]
    hessian = np.eye(3) / NOMINAL_SD_MM**2
    for _ in range(50):
        hessian, gradient = _normal_equations(digits, point, nominal)
        step = np.linalg.solve(hessian, gradient)
        point = point - step
        if np.linalg.norm(step) < 1e-9:
            break
    return WristPoint(point, np.asarray(np.linalg.inv(hessian)))


def _normal_equations(digits: list[Array], point: Array, nominal: Array) -> tuple[Array, Array]:
    hessian = np.eye(3) / NOMINAL_SD_MM**2
    gradient = (point - nominal) / NOMINAL_SD_MM**2
    for positions in digits:
        offset = positions - point
        distance = np.linalg.norm(offset, axis=-1)
        slope = -offset / distance[:, None]
        slope = slope - slope.mean(0)
        weight = INDEPENDENT_SAMPLES / DISTANCE_SD_MM**2 / len(positions)
        hessian = hessian + weight * slope.T @ slope
        gradient = gradient + weight * slope.T @ (distance - distance.mean())
    return hessian, gradient
