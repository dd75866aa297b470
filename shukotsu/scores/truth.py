"""Truth of a simulated recording, and errors of joints and bones (docs/method.md, "Against the truth")."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError, reading_user_tables
from shukotsu.hand import posed_recording, rotations
from shukotsu.hand.digit_chain import Rows
from shukotsu.study.layout import Layout
from shukotsu.study.stated_error import halves_mm2, is_within_95
from shukotsu.study.verdict import NOT_WORN
from shukotsu.tables.catalogue import BONE_LENGTHS, DISTAL_RECEIVER, JOINT_CENTRES, METACARPALS, TIPS
from shukotsu.tables.parts import numbers_by_name
from shukotsu.tables.poses import Poses, RecordingName
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Table, read_table, rows_of, vector_columns, vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow, JointErrorsRow

TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")

OTHER_MM = 0.5
"""Median discrepancy of tip-to-receiver distances above which a truth is of another recording.

For the right truth the distances agree to rounding.
"""

DISTAL = np.array([1.0, 0.0, 0.0])
"""Direction of a bone in its own frame."""


@dataclass(frozen=True)
class Stated:
    """Joints and bones of a skeleton: rows of joint_centres by joint, and of bone_lengths by segment."""

    joints: Rows
    bones: Mapping[str, BoneLengthsRow]


@dataclass(frozen=True)
class TrueDigit:
    """True motion of one digit over T frames, in the transmitter frame.

    Attributes
    ----------
    frame : array of int, shape (T,)
        Frame numbers.
    tip_mm : array, shape (T, 3)
        Tip of the distal bone, mm.
    to_receiver_mm : array, shape (T,)
        Distance from the tip to the distal receiver as recorded, mm; NaN if the receiver's pose was lost.
    metacarpal : array, shape (T, 3)
        Unit direction of the metacarpal.
    metacarpal_mm : float
        Length of the metacarpal.

    """

    frame: Integers
    tip_mm: Array
    to_receiver_mm: Array
    metacarpal: Array
    metacarpal_mm: float

    def tip_errors_mm(self, tip_mm: Array, frame: Integers) -> Array:
        """Return the distances (N,), mm, of tips (N, 3) in frames (N,) from the true tips; else NaN."""
        return np.asarray(np.linalg.norm(tip_mm - at_frames(self.tip_mm, self.frame, frame), axis=-1))

    def metacarpals_at(self, frame: Integers) -> Array:
        """Return the true directions (N, 3) of the metacarpal in frames (N,); NaN in other frames."""
        return at_frames(self.metacarpal, self.frame, frame)

    def metacarpal_deg(self, quaternion: Array, frame: Integers) -> float | None:
        """Compute the mean angle between directions of the metacarpal and the true ones.

        Parameters
        ----------
        quaternion : array, shape (N, 4)
            Metacarpal to transmitter frame.
        frame : array of int, shape (N,)
            Frame numbers.

        Returns
        -------
        float or None
            Angle, deg; None without a common frame.

        """
        direction, truth = directions(quaternion), self.metacarpals_at(frame)
        apart, together = (np.linalg.norm(sides, axis=-1) for sides in (direction - truth, direction + truth))
        angle_deg = np.degrees(2 * np.arctan2(apart, together))
        angle_deg = angle_deg[np.isfinite(angle_deg)]
        return float(angle_deg.mean()) if len(angle_deg) else None


@dataclass(frozen=True)
class RecordingTruth:
    """Truth of one recording.

    Attributes
    ----------
    folder : Path
        Folder of the truth tables.
    name : RecordingName
        The recording.
    stated : Stated
        Mean joint centres in the frames of the receivers as they moved on the skin, and bones.

    """

    folder: Path
    name: RecordingName
    stated: Stated

    def digits(self, poses: Poses, layout: Layout) -> dict[str, TrueDigit]:
        """Read the truth of every digit, with frames numbered as in the recording.

        Parameters
        ----------
        poses : Poses
            The recording.
        layout : Layout
            Layout of the hand.

        Returns
        -------
        dict
            Digit -> TrueDigit; empty if there is no truth or no valid pose.

        Raises
        ------
        InputError
            If the truth cannot be read or is of another recording.

        """
        of_digit = _digits(self.folder)
        if not of_digit or not poses.valid.any():
            return {}
        first = next(iter(of_digit.values())).frame[0]
        off_mm = {
            shift: _off_mm(of_digit, poses, layout, shift) for shift in (0, int(poses.frame[0] - first))
        }
        shift = min(off_mm, key=lambda shift: off_mm[shift])
        if off_mm[shift] > OTHER_MM:
            raise InputError(
                f"{self.folder}: is not the truth of this recording of {self.name}: receivers' positions "
                "differ from the recorded ones; simulate the recording and its truth again"
            )
        return {digit: replace(true, frame=true.frame + shift) for digit, true in of_digit.items()}


def read_truth(folder: Path, name: RecordingName) -> RecordingTruth:
    """Read the truth of a recording from its folder.

    Parameters
    ----------
    folder : Path
        Folder with joint_centres, bone_lengths, tips and metacarpals.
    name : RecordingName
        The recording.

    Returns
    -------
    RecordingTruth
        Joints and bones; the motion is read by `RecordingTruth.digits`.

    Raises
    ------
    InputError
        If a table cannot be read or is of another hand.

    """
    joints, bones = _rows(folder, JOINT_CENTRES, name), _rows(folder, BONE_LENGTHS, name)
    stated = Stated({row["joint"]: row for row in joints}, {row["bone"]: row for row in bones})
    return RecordingTruth(folder, name, stated)


def _rows(folder: Path, table: Table, name: RecordingName) -> list[Any]:
    """Read the rows of one truth table; raise InputError if they are not of the recording's hand."""
    path = folder / f"{table.name}.parquet"
    with reading_user_tables():
        rows = list(rows_of(read_table(path, table)))
    for hand in {Hand(row["subject"], row["hand"], row["session"]) for row in rows} - {name.of_hand}:
        raise InputError(f"{path}: is of {hand}; expected {name.of_hand}")
    return rows


def at_frames(values: Array, frames: Integers, wanted: Integers) -> Array:
    """Look up values by frame number.

    Parameters
    ----------
    values : array, shape (T, ...)
        Values in `frames`.
    frames : array of int, shape (T,)
        Ascending frame numbers.
    wanted : array of int, shape (N,)
        Frames to look up.

    Returns
    -------
    array, shape (N, ...)
        Values; NaN for wanted frames that are not in `frames`.

    """
    if np.array_equal(frames, wanted):
        return values
    if not len(frames):
        return np.full((len(wanted), *values.shape[1:]), np.nan)
    index = np.minimum(np.searchsorted(frames, wanted), len(frames) - 1)
    rows = np.array(values[index], float)
    rows[frames[index] != wanted] = np.nan
    return rows


def directions(quaternion: Array) -> Array:
    """Compute the directions of bones.

    Parameters
    ----------
    quaternion : array, shape (T, 4)
        Bone to transmitter frame.

    Returns
    -------
    array, shape (T, 3)
        Unit vectors towards the tip, in the transmitter frame.

    """
    return np.asarray(rotations.rotate(quaternion, DISTAL))


def _digits(folder: Path) -> dict[str, TrueDigit]:
    """Read the truth of the digits that are in both tables, tips and metacarpals."""
    tips = _by_digit(folder, TIPS, ("frame", *TIP, "error_mm"))
    metacarpals = _by_digit(folder, METACARPALS, ("frame", *posed_recording.QUATERNION, "length_mm"))
    digits = {}
    for digit in tips.keys() & metacarpals.keys():
        tip, bone = tips[digit], metacarpals[digit]
        frame = tip[:, 0].astype(np.int64)
        metacarpal = at_frames(directions(bone[:, 1:5]), bone[:, 0].astype(np.int64), frame)
        digits[digit] = TrueDigit(frame, tip[:, 1:4], tip[:, 4], metacarpal, float(bone[0, 5]))
    return digits


def _by_digit(folder: Path, table: Table, columns: Sequence[str]) -> dict[str, Array]:
    """Read columns of a truth table as arrays (T, C), by digit."""
    with reading_user_tables():
        rows = read_table(folder / f"{table.name}.parquet", table, ["digit", *columns])
    return numbers_by_name(rows, "digit", columns)


def _off_mm(of_digit: Mapping[str, TrueDigit], poses: Poses, layout: Layout, shift: int) -> float:
    """Compute the median absolute difference, mm, between recorded and true tip-to-receiver distances.

    shift : added to the frame numbers of the truth. Return inf if they have no frame in common.
    """
    off = [np.empty(0)]
    for digit, true in of_digit.items():
        if digit in layout.digits:
            index = poses.index(layout.digits[digit].tip)
            tip_mm = at_frames(true.tip_mm, true.frame + shift, poses.frame)
            stated = at_frames(true.to_receiver_mm, true.frame + shift, poses.frame)
            distance = np.linalg.norm(tip_mm - poses.position_mm[:, index], axis=-1)
            off.append(np.abs(distance - stated)[poses.valid[:, index]])
    together = np.concatenate(off)
    finite = together[np.isfinite(together)]
    return float(np.median(finite)) if len(finite) else float("inf")


def truth_for(tasks: Sequence[str], truths: Sequence[RecordingTruth]) -> Stated | None:
    """Return the reference for a skeleton: true joints averaged over its calibration recordings.

    Parameters
    ----------
    tasks : sequence of str
        Tasks on which the skeleton was calibrated.
    truths : sequence of RecordingTruth
        Truths of the hand's recordings.

    Returns
    -------
    Stated or None
        The reference, averaged over all truths if no calibration recording has one; None without any truth.

    """
    stated = [truth.stated for truth in truths if truth.name.task in tasks]
    stated = stated or [truth.stated for truth in truths]
    if not stated:
        return None
    joints = {
        name: _average_rows([each.joints[name] for each in stated if name in each.joints])
        for name in stated[0].joints
    }
    return replace(stated[0], joints=joints)


def _average_rows(rows: Sequence[JointCentresRow]) -> JointCentresRow:
    """Average one joint's rows over several recordings: centres and axes, weighted by frames."""
    frames = [row["n_frames"] for row in rows]
    mean: JointCentresRow = {**rows[0]}
    for side in ("parent_", "child_"):
        centre_mm = np.average([vector_of(row, side, "_mm") for row in rows], 0, frames)
        mean |= vector_columns(side, centre_mm, "_mm")
        axis = np.average([vector_of(row, f"axis_{side}") for row in rows], 0, frames)
        mean |= vector_columns(f"axis_{side}", rotations.unit(axis))
    return mean


def joint_errors(stated: Stated, truth: Stated, layout: Layout) -> list[JointErrorsRow]:
    """Compute the errors of every joint between two receivers whose truth is available.

    Parameters
    ----------
    stated, truth : Stated
        The skeleton, and its reference.
    layout : Layout
        Layout of the hand.

    Returns
    -------
    list of dict
        Rows of joint_errors without the skeleton's keys.

    """
    rows = []
    for joint in layout.solvable:
        true = truth.joints.get(joint.name)
        if true is None or not true["parent_segment"]:
            continue
        row: JointErrorsRow = {"joint": joint.name, "bone": ""}
        estimated = stated.joints.get(joint.name)
        if estimated is not None and estimated["status"] != "failed":
            row |= centre_errors(estimated, true)
        bone, true_bone = stated.bones.get(joint.child), truth.bones.get(joint.child)
        # a row that starts at the wrist or ends at the distal receiver does not span the bone itself
        if bone and true_bone and bone["starts_at"] == joint.name and bone["ends_at"] != DISTAL_RECEIVER:
            ends = (stated.joints.get(end, {}) for end in (bone["starts_at"], bone["ends_at"]))
            only_anatomy = any(end.get("reason") == NOT_WORN for end in ends)
            stated_mm, true_mm = bone["length_mm"], true_bone["length_mm"]
            if not only_anatomy and stated_mm is not None and true_mm is not None:
                off_mm = stated_mm - true_mm
                row |= {"bone": joint.child, "bone_error_mm": off_mm}
                row["bone_error_percent"] = 100 * off_mm / true_mm
        rows.append(row)
    return rows


def centre_errors(estimated: Mapping[str, Any], true: Mapping[str, Any]) -> JointErrorsRow:
    """Compute the errors of one joint centre and axis, each half compared with its own covariance.

    Parameters
    ----------
    estimated, true : mapping
        Rows of joint_centres.

    Returns
    -------
    dict
        Columns of joint_errors: distances in the child's and the parent's receiver frame, mm, also along and
        across the axis; the angle between the axes of a hinge, deg; whether the stated 95 % hold.

    """
    child, parent = (
        vector_of(estimated, side, "_mm") - vector_of(true, side, "_mm") for side in ("child_", "parent_")
    )
    axis, estimated_axis = (vector_of(row, "axis_child_") for row in (true, estimated))
    turned = np.linalg.norm(np.cross(estimated_axis, axis)), abs(estimated_axis @ axis)
    axis_deg = float(np.degrees(np.arctan2(*turned)))  # independent of the axes' signs
    sd_mm = estimated["sd_mm"]
    stated: list[bool | None] = [None, None]
    if sd_mm is not None:
        halves = halves_mm2(estimated.get("covariance_mm2"), sd_mm)
        stated = [is_within_95(off, half) for off, half in zip((parent, child), halves, strict=True)]
    return {
        "error_mm": float(np.linalg.norm(child)),
        "along_mm": float(abs(child @ axis)),
        "across_mm": float(np.linalg.norm(np.cross(child, axis))),
        "parent_error_mm": float(np.linalg.norm(parent)),
        "axis_deg": axis_deg if true["dof"] == 1 else None,
        "sd_mm": sd_mm,
        "within_95": stated[1],
        "parent_within_95": stated[0],
    }
