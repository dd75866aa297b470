"""The tables of a fitted hand; rows of its joints, bones, receivers and gains, all but the part's keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from schemas.catalogue import (
    BONE_LENGTHS,
    BONE_POSES,
    FINGERTIP,
    GAINS,
    JOINT_ANGLES,
    JOINT_CENTRES,
    POSED_TIPS,
    RECEIVER_COSTS,
    RECEIVERS,
)
from schemas.parts import PartsWriter, parts_writer
from schemas.poses import Poses, RecordingName
from schemas.tables import Provenance, Table, vector_columns
from schemas.verdict import UNJUDGED, noted
from stages.fit_hand.fingertips import Fingertips
from stages.fit_hand.fit import HandFit
from stages.fit_hand.gains import gains
from stages.fit_hand.loose_receivers import LooseReceiver
from stages.fit_hand.measurements import MOUNT_PARTS
from stages.fit_hand.posterior_summary import FittedJoint
from stages.fit_hand.receiver_costs import receiver_costs

SOURCE = "fit of the whole hand"
Row = dict[str, Any]

FIT: Mapping[str, Table] = {
    "fitted_joints": JOINT_CENTRES,
    "fitted_bones": BONE_LENGTHS,
    "receivers": RECEIVERS,
    "gains": GAINS,
    "receiver_costs": RECEIVER_COSTS,
    "joint_angles": JOINT_ANGLES,
    "bone_poses": BONE_POSES,
    "posed_tips": POSED_TIPS,
}
"""File to table, of a fit of the whole hand."""

PRIOR: Mapping[str, Table] = {
    "prior_joints": JOINT_CENTRES,
    "prior_bones": BONE_LENGTHS,
    "prior_bone_poses": BONE_POSES,
    "prior_posed_tips": POSED_TIPS,
}
"""The same of the hand that anatomy expects."""


@contextmanager
def open_tables(
    folder: Path, tables: Mapping[str, Table], provenance: Provenance
) -> Iterator[Mapping[str, PartsWriter]]:
    """Open the tables of a folder for writing, by file; all take their names when they close."""
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(parts_writer(folder / f"{name}.parquet", table, provenance))
            for name, table in tables.items()
        }


def joint_rows(fit: HandFit) -> list[Row]:
    """Rows of joint_centres: joints between two receivers, those that lack one, those under the palm, and
    fixed centres.
    """
    groups = (fit.joints, fit.summary.lone, fit.summary.palm, fit.summary.fixed)
    return [_joint_row(joint) for group in groups for joint in group.values()]


def _joint_row(joint: FittedJoint) -> Row:
    row: Row = {
        "joint": joint.name,
        "parent_segment": joint.parent_segment,
        "child_segment": joint.child_segment,
        "dof": joint.dof,
        "sd_mm": joint.sd_mm,
        "gap_rms_mm": joint.gap_rms_mm,
        "range_deg": joint.range_deg,
        "axis_sd_deg": joint.axis_sd_deg,
        "n_frames": 0,
        "source": SOURCE,
        **noted(joint.doubts),
        "status": "failed" if joint.message else "ok",
        "message": joint.message,
        **vector_columns("parent_", joint.parent_mm, "_mm"),
        **vector_columns("child_", joint.child_mm, "_mm"),
        **vector_columns("axis_parent_", joint.axis_parent),
        **vector_columns("axis_child_", joint.axis_child),
    }
    if np.isfinite(joint.covariance_mm2).all():
        row["covariance_mm2"] = joint.covariance_mm2.ravel()
    return row


def bone_rows(fit: HandFit) -> list[Row]:
    """Rows of bone_lengths: every bone from joint to joint, the last of a digit to its tip."""
    return [
        {
            "digit": digit.name,
            "bone": segment,
            "starts_at": digit.joints[index],
            "ends_at": (*digit.joints, FINGERTIP)[index + 1],
            "length_mm": fit.bones[segment].length_mm,
            "sd_mm": fit.bones[segment].sd_mm,
            "driven_by": "",
            **UNJUDGED,
            "message": "",
        }
        for digit in fit.evidence.layout.digits.values()
        for index, segment in enumerate(digit.segments)
        if segment in fit.bones
    ]


def gain_rows(tips: Fingertips) -> list[Row]:
    """Rows of gains, best first."""
    return [asdict(gain) for gain in gains(tips)]


def cost_rows(tips: Fingertips, task: Poses) -> list[Row]:
    """Rows of receiver_costs; task : frames of a task, or of the calibration."""
    return [asdict(cost) for cost in receiver_costs(tips, task)]


def receiver_rows(tips: Fingertips, loose: Sequence[tuple[RecordingName, LooseReceiver]]) -> list[Row]:
    """Rows of receivers; loose : those that came loose, and in which recording."""
    fit, rows = tips.fit, []
    digit_of = {tip.receiver: digit for digit, tip in tips.digits.items()}
    loose_columns = _loose_columns(loose)
    for segment in fit.evidence.model.receivers:
        residual_mm, residual_deg = fit.residual_rms[segment]
        row: Row = {"segment": segment, "residual_mm": residual_mm, "residual_deg": residual_deg}
        for name, amount in zip(MOUNT_PARTS, fit.evidence.model.mount.get(segment, ()), strict=False):
            row[f"{name}_mm"], row[f"{name}_sd_mm"] = fit.evidence.posterior.of_amount(amount)
        row |= {"loose_task": "", "status": "ok", "message": ""}
        if not np.isfinite(residual_mm):
            row |= {"status": "failed", "message": "no valid pose in the calibration"}
        row |= loose_columns.get(segment, {})
        digit = digit_of.get(segment)
        if digit is not None:
            row |= _tip_columns(tips, digit)
            refused = [text for text in tips.refused if f"({digit}, " in text or f" and {digit})" in text]
            row["message"] = "; ".join(filter(None, [row["message"], *refused]))
        rows.append(row)
    return rows


def _loose_columns(loose: Sequence[tuple[RecordingName, LooseReceiver]]) -> dict[str, Row]:
    """Columns of each receiver that came loose, by segment: the largest of its moves."""
    columns = {}
    for name, receiver in sorted(loose, key=lambda pair: pair[1].shift_mm + pair[1].turn_deg):
        where = ", ".join(filter(None, (name.task, name.trial)))
        when = f"{receiver.time_s:.1f} s" if np.isfinite(receiver.time_s) else f"frame {receiver.frame}"
        columns[receiver.segment] = {
            "loose_from_frame": receiver.frame,
            "loose_task": where,
            "loose_shift_mm": receiver.shift_mm,
            "loose_turn_deg": receiver.turn_deg,
            "status": "weak",
            "message": f"came loose in {where} at {when}: it moved {receiver.shift_mm:.1f} mm and turned "
            f"{receiver.turn_deg:.0f} deg on its bone; only the longer part, before or after, was used",
        }
    return columns


def _tip_columns(tips: Fingertips, digit: str) -> Row:
    tip = tips[digit]
    row: Row = {}
    for name, point, covariance in (
        ("bone_tip", tip.point_mm, tip.covariance_mm2),
        ("soft_tip", tip.soft_tip_mm, tip.soft_tip_covariance_mm2),
    ):
        row |= vector_columns(f"{name}_", point, "_mm")
        row[f"{name}_sd_mm"] = float(np.sqrt(np.trace(covariance)))
    return row
