"""A fitted hand as rows of the tables: joints, bones and receivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from kinematics.rotations import Array
from stages.fit_hand.fingertips import Fingertip, Fingertips
from stages.fit_hand.fit import HandFit
from stages.fit_hand.gains import Gain
from stages.fit_hand.reading import FittedJoint, FixedCentre

SOURCE = "fit of the whole hand"
Row = dict[str, Any]


def joint_rows(fit: HandFit, started: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Rows of joint_centres (names of subject, hand and model left out).

    started : the rows that the fit started from, joint by joint. A joint that the fit does not reach keeps
    its row; the joints under the palm, and the wrist where no forearm receiver makes it a joint, are new.
    """
    before = {row["joint"]: row for row in started}
    rows = [
        _joint_row(fit.joints[name], row) if name in fit.joints else dict(row) for name, row in before.items()
    ]
    rows += [_joint_row(joint, None) for name, joint in fit.joints.items() if name not in before]
    rows += [_joint_row(joint, None) for joint in fit.palm.values()]
    rows += [_fixed_row(centre) for centre in fit.reading.fixed.values()]
    wrist = fit.evidence.layout.wrist
    if wrist is not None and wrist.joint not in fit.joints and np.isfinite(fit.reading.wrist_mm).all():
        rows.append(_wrist_row(fit, wrist.joint, wrist.segment))
    return rows


def _joint_row(joint: FittedJoint, before: Mapping[str, Any] | None) -> Row:
    """A joint's row; what only the frames joint by joint say comes from the row before."""
    kept = ("gap_rms_free_mm", "n_frames", "n_effective")
    row: Row = {name: before[name] for name in kept} if before else {"n_frames": 0}
    row |= {
        "joint": joint.name,
        "parent_segment": joint.parent_segment,
        "child_segment": joint.child_segment,
        "dof": joint.dof,
        "sd_mm": joint.sd_mm,
        "gap_rms_mm": joint.gap_rms_mm,
        "range_deg": joint.range_deg,
        "axis_sd_deg": joint.axis_sd_deg,
        "source": SOURCE,
        "status": joint.status,
        "message": joint.message,
    }
    if np.isfinite(joint.covariance_mm2).all():
        row["covariance_mm2"] = joint.covariance_mm2.ravel()
    for prefix, vector, suffix in (
        ("parent_", joint.parent_mm, "_mm"),
        ("child_", joint.child_mm, "_mm"),
        ("axis_parent_", joint.axis_parent, ""),
        ("axis_child_", joint.axis_child, ""),
    ):
        row |= _named(prefix, vector, suffix)
    return row


def _fixed_row(centre: FixedCentre) -> Row:
    row = _point_row(centre.name, centre.parent_segment, centre.child_segment, centre.covariance_mm2)
    row |= {"status": "ok", "message": "does not move, so anatomy and the palm's shape place it"}
    return row | _named("parent_", centre.parent_mm, "_mm")


def _wrist_row(fit: HandFit, joint: str, segment: str) -> Row:
    row = _point_row(joint, "", segment, fit.reading.wrist_covariance_mm2)
    row |= {"status": "ok", "message": "where the metacarpals' bases say; there is no forearm receiver"}
    return row | _named("child_", fit.reading.wrist_mm, "_mm")


def _point_row(joint: str, parent: str, child: str, covariance_mm2: Array) -> Row:
    """A point in one receiver's frame: the parent's, or the child's where there is no parent."""
    whole = np.zeros((6, 6))
    half = slice(0, 3) if parent else slice(3, 6)
    whole[half, half] = covariance_mm2
    return {
        "joint": joint,
        "parent_segment": parent,
        "child_segment": child,
        "dof": 0,
        "sd_mm": float(np.sqrt(np.trace(covariance_mm2))),
        "covariance_mm2": whole.ravel(),
        "n_frames": 0,
        "source": SOURCE,
    }


def _named(prefix: str, vector: Array, suffix: str) -> Row:
    return {f"{prefix}{axis}{suffix}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def bone_rows(fit: HandFit) -> list[Row]:
    """Rows of bone_lengths: every bone from joint to joint, the last of a digit to its tip."""
    digit_of = {
        segment: digit.name for digit in fit.evidence.layout.digits.values() for segment in digit.segments
    }
    return [
        {
            "digit": digit_of[segment],
            "bone": segment,
            "length_mm": bone.length_mm,
            "sd_mm": bone.sd_mm,
            "bone_mm": bone.length_mm,
            "bone_sd_mm": bone.sd_mm,
            "driven_by": "",
            "message": "",
        }
        for segment, bone in fit.bones.items()
    ]


def gain_rows(gains: Sequence[Gain]) -> list[Row]:
    """Rows of gains, in the order given."""
    return [asdict(gain) for gain in gains]


def receiver_rows(tips: Fingertips, loose: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """Rows of receivers; loose : by segment, what is known of a receiver that came loose."""
    fit, rows = tips.fit, []
    digit_of = {tip.receiver: digit for digit, tip in tips.digits.items()}
    for segment in fit.evidence.model.receivers:
        residual_mm, residual_deg = fit.residual_rms[segment]
        row: Row = {"segment": segment, "residual_mm": residual_mm, "residual_deg": residual_deg}
        for name, amount in zip(
            ("along", "lateral", "height"), fit.evidence.model.mount.get(segment, ()), strict=False
        ):
            row[f"{name}_mm"], row[f"{name}_sd_mm"] = fit.evidence.posterior.of_amount(amount)
        row |= _tip_columns(tips[digit_of[segment]]) if segment in digit_of else {}
        row |= {"loose_task": "", "status": "ok", "message": ""}
        if not np.isfinite(residual_mm):
            row |= {"status": "failed", "message": "no valid pose in the calibration"}
        row |= loose.get(segment, {})
        whose = digit_of.get(segment, "nobody")
        said = [text for text in tips.refused if f"({whose}, " in text or f" and {whose})" in text]
        row["message"] = "; ".join(filter(None, [row["message"], *said]))
        rows.append(row)
    return rows


def _tip_columns(tip: Fingertip) -> Row:
    row: Row = {}
    for name, point, covariance in (
        ("bone_tip", tip.point_mm, tip.covariance_mm2),
        ("soft_tip", tip.soft_tip_mm, tip.soft_tip_covariance_mm2),
    ):
        row |= _named(f"{name}_", point, "_mm")
        row[f"{name}_sd_mm"] = float(np.sqrt(np.trace(covariance)))
    return row
