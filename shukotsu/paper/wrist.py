"""Wrist point from which the digits start: fitted, configured, or estimated from the MCP joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.arrays import Array, Float
from shukotsu.hand.digit_chain import Rows, all_valid, seen_from
from shukotsu.study.layout import Layout, Wrist
from shukotsu.study.model import SkeletonModel
from shukotsu.study.verdict import BY_ANATOMY, FROM_DOUBTFUL, NO, Values, judged_joint, note_doubts
from shukotsu.tables.poses import PosesReader
from shukotsu.tables.typed_table import vector_columns, vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow

DISTANCE_SD_MM = 1.0
"""Standard deviation of the distance from wrist to MCP joint due to skin motion."""

INDEPENDENT_SAMPLES = 20.0
"""Number of independent samples of each digit in a recording of about ten seconds."""

NOMINAL_SD_MM = 15.0
"""Standard deviation of a wrist relative to that of the average hand, including receiver placement."""

MAX_FRAMES = 4096


@dataclass(frozen=True)
class WristPoint:
    """Wrist point in the hand receiver's frame: point_mm (3,) and covariance_mm2 (3, 3)."""

    point_mm: Array
    covariance_mm2: Array


def estimate_wrist(mcp_mm: list[Float[Array, "_ 3"]], nominal_mm: Float[Array, " 3"]) -> WristPoint:
    """Find the point whose distance to the MCP joints varies least (docs/method.md, "Wrist and metacarpals").

    Gauss-Newton minimises samples / sd^2 * sum over digits of var_k |MCP(k) - w| + |w - nominal|^2 /
    sd_nominal^2. The nominal wrist determines what the data leave open: if the palm does not move, every
    point keeps its distance.

    Parameters
    ----------
    mcp_mm : list of array, shape (T, 3)
        MCP centres of each digit in the hand receiver's frame, mm.
    nominal_mm : array, shape (3,)
        Wrist of the average hand, mm.

    Returns
    -------
    WristPoint
        Point and covariance in the hand receiver's frame.

    """
    thinned = [positions[:: max(1, len(positions) // MAX_FRAMES)] for positions in mcp_mm if len(positions)]
    return _estimate(tuple(each.T.tobytes() for each in thinned), tuple(map(float, nominal_mm)))


@lru_cache(maxsize=4)
def _estimate(positions: tuple[bytes, ...], nominal_mm: tuple[float, ...]) -> WristPoint:
    """Estimate the wrist from positions (3, T) as bytes; cached, as models often share MCP joints."""
    digits = [np.frombuffer(data).reshape(3, -1) for data in positions]
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
    """Compute the Hessian (3, 3) and gradient (3,) at a point; digits : positions (3, T) of each."""
    hessian = np.eye(3) / NOMINAL_SD_MM**2
    gradient = (point - nominal) / NOMINAL_SD_MM**2
    for positions in digits:
        count = positions.shape[1]
        x, y, z = positions - point[:, None]
        distance = np.sqrt(x * x + y * y + z * z)
        slope = np.empty((count, 3))
        for axis, offset in enumerate((x, y, z)):
            along = -offset / distance
            slope[:, axis] = along - np.cumsum(along)[-1] / count  # sequential sum, as over rows of (T, 3)
        weight = INDEPENDENT_SAMPLES / DISTANCE_SD_MM**2 / count
        hessian = hessian + weight * slope.T @ slope
        gradient = gradient + weight * slope.T @ (distance - distance.mean())
    return hessian, gradient


def wrist_row(
    rows: Rows, layout: Layout, model: SkeletonModel, calibration: PosesReader
) -> JointCentresRow | None:
    """Build the wrist's row of joint_centres, without subject, hand and model.

    Parameters
    ----------
    rows : mapping
        Rows of joint_centres by joint.
    layout : Layout
        Layout of the hand.
    model : SkeletonModel
        model.wrist selects the joint fitted against a forearm receiver (functional), the layout's point_mm
        (point), or the point at constant distance from the MCP joints; auto takes the first available.
    calibration : PosesReader
        Calibration recordings.

    Returns
    -------
    dict or None
        The row; None if the layout has no wrist.

    """
    wrist = layout.wrist
    if wrist is None:
        return None
    fitted = rows.get(wrist.joint)
    wanted = model.wrist
    if wanted in ("functional", "auto") and fitted is not None and fitted["status"] != "failed":
        return fitted
    if wanted == "functional":
        why = fitted["message"] if fitted is not None else "no receiver on the forearm"
        return _point_row(wrist, None, f"the wrist joint was not fitted: {why}", "fit")
    if wanted == "point" or (wanted == "auto" and wrist.point_mm is not None):
        if wrist.point_mm is None:
            return _point_row(wrist, None, f"layout {layout.name} has no wrist.point_mm", "configured point")
        configured = WristPoint(np.array(wrist.point_mm), np.zeros((3, 3)))
        return _point_row(wrist, configured, "as configured in the layout", "configured point")
    positions = _mcp_positions(rows, layout, wrist, calibration)
    point = estimate_wrist([*positions.values()], np.array(wrist.nominal_mm))
    how = "the average hand's wrist; there is no forearm receiver and no MCP joint to estimate it from"
    if positions:
        joints = f"{len(positions)} MCP joint{'s' if len(positions) > 1 else ''}"
        how = f"the point whose distance to {joints} varies least"
    doubtful = [j for j in positions if judged_joint(rows[j], layout.wanted_mm)["verdict"] == NO]
    doubts: dict[str, Values] = {} if positions else {BY_ANATOMY: {}}
    if len(doubtful) > len(positions) / 2:
        doubts[FROM_DOUBTFUL] = {"joints": doubtful}
    return _point_row(wrist, point, how, "estimated point", doubts)


def _mcp_positions(rows: Rows, layout: Layout, wrist: Wrist, calibration: PosesReader) -> dict[str, Array]:
    """Return MCP centres (N, 3), mm in the hand receiver's frame, of digits without a metacarpal receiver.

    N frames are evenly spaced.
    """
    positions = {}
    for digit in layout.digits.values():
        if layout.segments[digit.segments[0]].measured or digit.base != wrist.segment:
            continue
        row = rows.get(digit.joints[1])
        if row is None or row["status"] == "failed":
            continue
        mcp_mm = vector_of(row, "child_", "_mm")
        both = (digit.base, digit.segments[1])
        seen_mm = [seen_from(poses, *both, mcp_mm)[all_valid(poses, both)] for poses in calibration(*both)]
        together = np.concatenate([np.empty((0, 3)), *seen_mm])
        together = together[:: max(1, len(together) // MAX_FRAMES)]
        if len(together):
            positions[digit.joints[1]] = together
    return positions


def _point_row(
    wrist: Wrist, point: WristPoint | None, how: str, source: str, doubts: Mapping[str, Values] | None = None
) -> JointCentresRow:
    """Build the row of joint_centres of a wrist point, or of a failed one if point is None."""
    row: JointCentresRow = {
        "joint": wrist.joint,
        "parent_segment": "",
        "child_segment": wrist.segment,
        "dof": 0,
        "n_frames": 0,
        "source": source,
        "status": "failed" if point is None else "ok",
        "message": how,
    }
    row |= note_doubts(doubts or {})
    if point is not None:
        whole = np.zeros((6, 6))
        whole[3:, 3:] = point.covariance_mm2
        row |= vector_columns("child_", point.point_mm, "_mm")
        row["covariance_mm2"] = whole.ravel().tolist()
        row["sd_mm"] = float(np.sqrt(np.trace(point.covariance_mm2)))
    return row
