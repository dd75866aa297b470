"""Table rows of a fitted hand's joints, bones and receivers, without the keys that name the hand and the
model.

On paper: docs/whole-hand.md, section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.errors import join_reasons
from shukotsu.fit.fingertips import Fingertips
from shukotsu.fit.fit import HandFit
from shukotsu.fit.left_out import Unsteady
from shukotsu.fit.loose_receivers import LooseReceiver, Moment
from shukotsu.fit.measurements import MOUNT_PARTS
from shukotsu.fit.posterior_summary import FittedJoint
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.posing import ZERO_COLUMNS
from shukotsu.study.layout import Layout
from shukotsu.study.verdict import UNJUDGED, note_doubts
from shukotsu.tables import catalogue
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.typed_table import vector_columns

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow, MovedReceiversRow, ReceiversRow

SOURCE = "fit of the whole hand"
STEP, SLIDE, FIELD = "step", "slide", "field"
"""Kinds of displacement in the column `loose_kind`: at once, by sliding, or only seemingly in a disturbed
field."""

_NO_ERRORS: Any = dict.fromkeys(("sd_mm", "covariance_mm2", "axis_sd_deg", "axes_turn_sd_deg"))
"""Empty error columns of a hand that follows from anatomy alone: without data, no errors are stated."""


def joint_rows(fit: HandFit, *, from_data: bool = True) -> list[JointCentresRow]:
    """Build the rows of joint_centres, joints between receivers first (docs/whole-hand.md, section 8).

    Parameters
    ----------
    fit : HandFit
        The hand.
    from_data : bool
        Whether the hand was fitted to data; otherwise no errors are stated.

    Returns
    -------
    list of dict
        A row for each joint; centres in the receivers' frames, mm.

    """
    summary = fit.summary
    rows = []
    for joint in (summary.joints | summary.lone | summary.palm | summary.fixed).values():
        row = _joint_row(joint)
        if axes := fit.summary.angle_axes.get(joint.name):  # zero and axes of the joint's angles
            rest_deg = joint_angles(np.array([1.0, 0.0, 0.0, 0.0]), axes.rest, "right")
            zero_deg = *rest_deg.tolist(), -float(np.degrees(axes.turn_rad))
            columns: Any = dict(zip(ZERO_COLUMNS, zero_deg, strict=True))
            row |= columns | {"axes_turn_sd_deg": axes.turn_sd_deg}
        if not from_data:
            row |= {"source": "anatomy alone", "status": "ok", "message": ""}
            row |= _NO_ERRORS
        rows.append(row)
    return rows


def _joint_row(joint: FittedJoint) -> JointCentresRow:
    row: JointCentresRow = {
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
        "status": "failed" if joint.message else "ok",
        "message": joint.message,
    }
    row |= note_doubts(joint.doubts)
    row |= vector_columns("parent_", joint.parent_mm, "_mm") | vector_columns("child_", joint.child_mm, "_mm")
    row |= vector_columns("axis_parent_", joint.axis_parent) | vector_columns("axis_child_", joint.axis_child)
    if np.isfinite(joint.covariance_mm2).all():
        row["covariance_mm2"] = joint.covariance_mm2.ravel().tolist()
    return row


def bone_rows(fit: HandFit, *, from_data: bool = True) -> list[BoneLengthsRow]:
    """Build the rows of bone_lengths: every bone from joint to joint, the last one of a digit to its tip.

    Parameters
    ----------
    fit : HandFit
        The hand.
    from_data : bool
        Whether the hand was fitted to data; otherwise no errors are stated.

    Returns
    -------
    list of dict
        A row for each bone of known anatomy, mm.

    """
    rows: list[BoneLengthsRow] = [
        {
            "digit": digit.name,
            "bone": segment,
            "starts_at": digit.joints[index],
            "ends_at": (*digit.joints, catalogue.BONE_TIP)[index + 1],
            "length_mm": fit.bones[segment].length_mm,
            "sd_mm": fit.bones[segment].sd_mm if from_data else None,
            "driven_by": "",
            "message": "",
        }
        for digit in fit.layout.digits.values()
        for index, segment in enumerate(digit.segments)
        if segment in fit.bones
    ]
    for row in rows:
        row |= UNJUDGED
    return rows


def receiver_rows(tips: Fingertips, unsteady: Unsteady) -> list[ReceiversRow]:
    """Build the rows of receivers: residuals, position on the bone, and displacements.

    Parameters
    ----------
    tips : Fingertips
        The hand with its fingertips.
    unsteady : Unsteady
        Receivers displaced in its calibration.

    Returns
    -------
    list of dict
        A row for each receiver, mm and deg.

    """
    fit = tips.fit
    rows: list[ReceiversRow] = []
    tip_of = {tip.receiver: (digit, tip) for digit, tip in tips.digits.items()}
    displaced = _loose_columns(unsteady) | _field_columns(fit, unsteady)
    for segment in fit.model.receivers:
        residual_mm, residual_deg = fit.residual_rms[segment]
        row: ReceiversRow = {"segment": segment, "residual_mm": residual_mm, "residual_deg": residual_deg}
        columns: Any = {}
        for name, amount in zip(MOUNT_PARTS, fit.model.mount.get(segment, ()), strict=False):
            columns[f"{name}_mm"], columns[f"{name}_sd_mm"] = fit.posterior.of_amount(amount)
        row |= {"loose_kind": "", "loose_task": "", "left_out_share": 0.0, "status": "ok", "message": ""}
        if not np.isfinite(residual_mm):
            row |= {"status": "failed", "message": "no valid pose in the calibration"}
        row |= displaced.get(segment, {})
        if segment in tip_of:
            digit, tip = tip_of[segment]
            for name, point, covariance in (
                ("bone_tip", tip.point_mm, tip.covariance_mm2),
                ("soft_tip", tip.soft_tip_mm, tip.soft_tip_covariance_mm2),
            ):
                columns |= vector_columns(f"{name}_", point, "_mm")
                columns[f"{name}_sd_mm"] = float(np.sqrt(np.trace(covariance)))
            refused = [text for text in tips.refused if f"({digit}, " in text or f" and {digit})" in text]
            row["message"] = join_reasons([row["message"], *refused])
        row |= columns
        rows.append(row)
    return rows


def _loose_columns(unsteady: Unsteady) -> dict[str, ReceiversRow]:
    """Return columns by segment for receivers that came loose or slid, with their largest displacement."""
    columns: dict[str, ReceiversRow] = {}
    for receiver in sorted(unsteady.displaced.loose, key=lambda loose: loose.shift_mm + loose.turn_deg):
        row: ReceiversRow = {
            "loose_kind": SLIDE if receiver.slid else STEP,
            "loose_from_frame": receiver.start.frame,
            "loose_until_frame": receiver.end.frame,
            "loose_task": _title(unsteady.recordings[receiver.start.recording]),
            "loose_shift_mm": receiver.shift_mm,
            "loose_turn_deg": receiver.turn_deg,
            "left_out_share": unsteady.left_out.get(receiver.segment, 0.0),
        }
        when, until = map(_moment, (receiver.start, receiver.end))
        did = f"slid in {row['loose_task']} between {when} and {until}"
        if not receiver.slid:
            did = f"came loose in {row['loose_task']} at {when}"
        message = (
            f"{did}: it moved {receiver.shift_mm:.1f} mm and turned {receiver.turn_deg:.0f} deg on its bone; "
            f"{_left_out(row)}"
        )
        columns[receiver.segment] = row | {"status": "weak", "message": message}
    return columns


def _field_columns(fit: HandFit, unsteady: Unsteady) -> dict[str, ReceiversRow]:
    """Return columns by segment for receivers that came near the source of a disturbed field."""
    field = unsteady.displaced.field
    if field is None:
        return {}
    source_mm = fit.convention.world(np.eye(3), field.nearest)[1]
    columns: dict[str, ReceiversRow] = {}
    for segment, error in unsteady.field_errors.items():
        row: ReceiversRow = {
            "loose_kind": FIELD,
            "loose_shift_mm": float(np.linalg.norm(error[:3])),
            "loose_turn_deg": float(np.degrees(np.linalg.norm(error[3:]))),
            "left_out_share": unsteady.left_out.get(segment, 0.0),
        }
        row |= vector_columns("field_", source_mm, "_mm")
        position = ", ".join(f"{coordinate:.0f}" for coordinate in source_mm.tolist())
        message = (
            f"the field is disturbed near ({position}) mm, probably by metal: this receiver's error there is "
            f"{row['loose_shift_mm']:.1f} mm and {row['loose_turn_deg']:.0f} deg; {_left_out(row)}"
        )
        columns[segment] = row | {"status": "weak", "message": message}
    return columns


def moved_rows(
    layout: Layout, name: RecordingName, moved: Sequence[LooseReceiver]
) -> list[MovedReceiversRow]:
    """Build the rows of moved_receivers: start of a receiver's first displacement, and the sum of all.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    name : RecordingName
        Name of the recording.
    moved : sequence of LooseReceiver
        Displacements in it.

    Returns
    -------
    list of dict
        A row for each receiver that moved, mm and deg.

    """
    rows: list[MovedReceiversRow] = []
    for segment in dict.fromkeys(receiver.segment for receiver in moved):
        moves = [receiver for receiver in moved if receiver.segment == segment]
        whole = replace(moves[0], step=np.sum([move.step for move in moves], axis=0))
        rows.append(
            {
                "task": name.task,
                "trial": name.trial,
                "segment": segment,
                "from_frame": whole.start.frame,
                "from_s": whole.start.time_s,
                "shift_mm": whole.shift_mm,
                "turn_deg": whole.turn_deg,
                "joints": ";".join(joints_beside(layout, segment)),
                "digits": ";".join(digits_carried(layout, segment)),
            }
        )
    return rows


def joints_beside(layout: Layout, segment: str) -> list[str]:
    """List the joints whose angles depend on a receiver, directly or through bones without a receiver.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    segment : str
        Segment that carries the receiver.

    Returns
    -------
    list of str
        Joints.

    """
    beside = [joint for joint in layout.joints.values() if segment in (joint.parent_receiver, joint.child)]
    bare = {joint.parent for joint in beside if not layout.segments[joint.parent].measured}
    return [joint.name for joint in layout.joints.values() if joint in beside or joint.child in bare]


def digits_carried(layout: Layout, segment: str) -> list[str]:
    """List the digits whose tips, relative to the hand, depend on a receiver.

    Parameters
    ----------
    layout : Layout
        Layout of the hand.
    segment : str
        Segment that carries the receiver.

    Returns
    -------
    list of str
        Digits.

    """
    return [digit.name for digit in layout.digits.values() if segment in (digit.tip, digit.base)]


def _title(name: RecordingName) -> str:
    return ", ".join(filter(None, (name.task, name.trial)))


def _moment(moment: Moment) -> str:
    return f"{moment.time_s:.1f} s" if np.isfinite(moment.time_s) else f"frame {moment.frame}"


def _left_out(row: ReceiversRow) -> str:
    if row["left_out_share"]:
        return f"{100 * row['left_out_share']:.0f} % of its frames were left out"
    return "all of its frames were used, as this moves no joint centre by more than its error"
