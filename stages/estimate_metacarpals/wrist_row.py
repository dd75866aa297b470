"""The row of joint_centres that says which wrist point is in use, and where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from shukotsu.schemas.layout import Layout, Wrist
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.poses import PosesReader
from shukotsu.schemas.verdict import BY_ANATOMY, FROM_DOUBTFUL, NO, Values, judged_joint, noted
from shukotsu.skeleton.digit_chain import Rows, all_valid, seen_from
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.estimate_metacarpals.wrist import MAX_FRAMES, WristPoint, estimate_wrist


def wrist_row(
    rows: Rows, layout: Layout, model: SkeletonModel, calibration: PosesReader
) -> dict[str, Any] | None:
    """Give the wrist's row (names of subject, hand and model left out); None where no wrist is needed.

    model.wrist chooses: the joint fitted against a forearm receiver, the layout's point_mm, or the point
    that the MCP joints keep their distance from; `auto` takes the first that there is.
    """
    wrist = layout.wrist
    if wrist is None:
        return None
    fitted = rows.get(wrist.joint)
    wanted = model.wrist
    if wanted in ("functional", "auto") and fitted is not None and fitted["status"] != "failed":
        return dict(fitted)
    if wanted == "functional":
        why = fitted["message"] if fitted is not None else "no receiver on the forearm"
        return _point_row(wrist, None, "failed", f"the wrist joint was not fitted: {why}", "fit")
    if wanted == "point" or (wanted == "auto" and wrist.point_mm is not None):
        if wrist.point_mm is None:
            why = f"layout {layout.name} has no wrist.point_mm"
            return _point_row(wrist, None, "failed", why, "configured point")
        given = WristPoint(np.array(wrist.point_mm), np.zeros((3, 3)))
        return _point_row(wrist, given, "ok", "as configured in the layout", "configured point")
    positions = _mcp_positions(rows, layout, wrist, calibration)
    point = estimate_wrist([*positions.values()], np.array(wrist.nominal_mm))
    how = "the average hand's wrist; there is no forearm receiver and no MCP joint to go by"
    if positions:
        joints = f"{len(positions)} MCP joint{'s' if len(positions) > 1 else ''}"
        how = f"the point that keeps its distance from {joints}"
    doubtful = [j for j in positions if judged_joint(rows[j], layout.wanted_mm)["verdict"] == NO]
    doubts: dict[str, Values] = {} if positions else {BY_ANATOMY: {}}
    if len(doubtful) > len(positions) / 2:
        doubts[FROM_DOUBTFUL] = {"joints": doubtful}
    return _point_row(wrist, point, "ok", how, "estimated point", doubts)


def _mcp_positions(rows: Rows, layout: Layout, wrist: Wrist, calibration: PosesReader) -> dict[str, Array]:
    """By MCP joint of a digit whose metacarpal carries no receiver: (N, 3) mm of it seen from the hand, in
    evenly spaced frames.
    """
    found = {}
    for digit in layout.digits.values():
        if layout.segments[digit.segments[0]].measured or digit.base != wrist.segment:
            continue
        row = rows.get(digit.joints[1])
        if row is None or row["status"] == "failed":
            continue
        own = np.array([row[f"child_{axis}_mm"] for axis in "xyz"])
        together = _even_frames(calibration, digit.base, digit.segments[1], own)
        if len(together):
            found[digit.joints[1]] = together
    return found


def _even_frames(calibration: PosesReader, base: str, segment: str, point_mm: Array) -> Array:
    """Positions (N, 3) of a segment's point seen from the base, in every n-th frame that shows both."""
    both = (base, segment)
    seen_mm = [
        seen_from(poses, base, segment, point_mm)[all_valid(poses, both)] for poses in calibration(*both)
    ]
    whole_mm = np.concatenate([np.empty((0, 3)), *seen_mm])
    return whole_mm[:: max(1, len(whole_mm) // MAX_FRAMES)]


def _point_row(
    wrist: Wrist,
    point: WristPoint | None,
    status: str,
    how: str,
    source: str,
    doubts: Mapping[str, Values] | None = None,
) -> dict[str, Any]:
    row: dict[str, Any] = {
        "joint": wrist.joint,
        "parent_segment": "",
        "child_segment": wrist.segment,
        "dof": 0,
        "n_frames": 0,
        "source": source,
        **noted(doubts or {}),
        "status": status,
        "message": how,
    }
    if point is not None:
        whole = np.zeros((6, 6))
        whole[3:, 3:] = point.covariance_mm2
        row |= {f"child_{axis}_mm": float(value) for axis, value in zip("xyz", point.point_mm, strict=True)}
        row["covariance_mm2"] = whole.ravel()
        row["sd_mm"] = float(np.sqrt(np.trace(point.covariance_mm2)))
    return row
