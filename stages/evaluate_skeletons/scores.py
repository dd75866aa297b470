"""How well the skeletons do in one recording: a row of skeleton_scores for each, digit by digit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array
from kinematics.skeleton import Rows, all_valid, ride
from schemas.catalogue import METACARPALS, POSED_TIPS, TIPS
from schemas.errors import InputError
from schemas.layout import Digit, Layout
from schemas.poses import Poses, RecordingName, read_poses, recording_name
from schemas.tables import Table
from stages.evaluate_skeletons.skeleton_folder import SkeletonFolder, joined, read_digits, stack
from stages.evaluate_skeletons.truth_folder import (
    QUATERNION,
    TIP,
    TrueDigit,
    TruthFolder,
    at_frames,
    directions,
)

Row = dict[str, Any]
Columns = Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Recording:
    """An evaluated recording.

    truth : by digit, frames numbered as the recording's, of a simulated one; truth_folder : where it is from.
    message : why the recording cannot be read.
    """

    path: Path
    name: RecordingName
    layout: Layout
    truth_folder: TruthFolder | None
    truth: Mapping[str, TrueDigit]
    message: str

    def poses(self, digit: Digit) -> Poses:
        """Poses of the receivers that a digit's replay needs."""
        measured = [segment for segment in digit.segments if self.layout.segments[segment].measured]
        return read_poses(self.path, (digit.base, *measured))

    def row(self, digit: str, model: str, message: str = "") -> Row:
        """A reference's row without numbers; one that no recording made."""
        return {
            "subject": self.name.subject,
            "hand": self.name.hand,
            "task": self.name.task,
            "trial": self.name.trial,
            "model": model,
            "calibrated_on": "",
            "held_out": True,
            "reference": True,
            "digit": digit,
            "n_frames": 0,
            "message": joined([self.message, message]),
        }


def read_recording(path: Path, layout: Layout, truths: Sequence[TruthFolder]) -> Recording:
    """Give an evaluated recording with the truth of the same task and trial, or of the same task.

    Raises InputError where a truth is not that of the recording.
    """
    name, tip_of = recording_name(path), {digit.name: digit.tip for digit in layout.digits.values()}
    own = [truth for truth in truths if truth.name.task == name.task and truth.name.trial in ("", name.trial)]
    best = max(own, key=lambda truth: truth.name.trial, default=None)
    try:
        poses = read_poses(path, tuple(dict.fromkeys(tip_of.values())) if best else ())
    except InputError as error:
        return Recording(path, name, layout, None, {}, str(error))
    return Recording(path, name, layout, best, best.digits(poses, tip_of) if best else {}, "")


def score_folder(
    recording: Recording, folder: SkeletonFolder, wrist_mcp_sd_mm: Mapping[str, float | None]
) -> list[Row]:
    """Rows of one skeleton in one recording, a digit each; without numbers, and why, where it has none.

    wrist_mcp_sd_mm : by digit, see `wrist_mcp_sd`.
    """
    reasons = [folder.message]
    with_truth = TIP if recording.truth else ()
    replayed = _read(folder, TIPS, ("frame", "error_mm", *with_truth), recording.name, reasons)
    posed: dict[str, Columns] = {}
    if folder.whole_hand:
        columns = ("frame", "error_mm", "error_left_out_mm", *with_truth)
        posed = _read(folder, POSED_TIPS, columns, recording.name, reasons)
    metacarpals: dict[str, Columns] = {}
    if recording.truth:
        metacarpals = _read(folder, METACARPALS, ("frame", *QUATERNION), recording.name, reasons)
    rows = []
    for digit in recording.layout.digits:
        told = folder.errors.get((recording.name.task, recording.name.trial, digit), {}).get("message", "")
        row = recording.row(digit, folder.model, joined([*reasons, told]))
        row |= {
            "calibrated_on": folder.calibrated_text,
            "held_out": folder.held_out(recording.name),
            "reference": False,
            "wrist_mcp_sd_mm": wrist_mcp_sd_mm.get(digit),
        }
        row |= tip_numbers(replayed.get(digit), posed.get(digit), whole_hand=folder.whole_hand)
        true = recording.truth.get(digit)
        if true is not None:
            own = posed if folder.whole_hand else replayed
            row |= truth_numbers(own.get(digit), metacarpals.get(digit), true)
        rows.append(row)
    return rows


def tip_numbers(replayed: Columns | None, posed: Columns | None, *, whole_hand: bool) -> Row:
    """Tip errors of one digit in one recording, and n_frames.

    replayed : columns of tips; posed : of posed_tips. The replay follows receivers and never asks where the
    distal one is: of a model that does not pose the whole hand its error is the left-out one, too.
    """
    nothing = np.empty(0)
    replay = nothing if replayed is None else replayed["error_mm"]
    together = nothing if posed is None else posed["error_mm"]
    left_out = nothing if posed is None else posed["error_left_out_mm"]
    found = mean_and_p95("replay", replay)
    found |= mean_and_p95("left_out", left_out if whole_hand else replay)
    posed_mean = mean_and_p95("posed", together).get("posed_mean_mm")
    counts = [int(np.isfinite(error).sum()) for error in (replay, together)]
    return found | {"posed_mean_mm": posed_mean, "n_frames": max(counts)}


def truth_numbers(tip: Columns | None, metacarpal: Columns | None, true: TrueDigit) -> Row:
    """How far a digit's tip and its metacarpal's direction are from their truth, over the shared frames."""
    found: Row = {}
    if tip is not None:
        found |= true_tip_numbers(stack(tip, TIP), np.asarray(tip["frame"], np.int64), true)
    if metacarpal is not None:
        found["metacarpal_deg"] = metacarpal_deg(
            directions(stack(metacarpal, QUATERNION)), np.asarray(metacarpal["frame"], np.int64), true
        )
    return found


def true_tip_numbers(tip_mm: Array, frame: npt.NDArray[np.int64], true: TrueDigit) -> Row:
    """Mean and 95th percentile of the distance of tips (T, 3) to the true ones; nothing without a frame."""
    return mean_and_p95(
        "true_tip", np.linalg.norm(tip_mm - at_frames(true.tip_mm, true.frame, frame), axis=-1)
    )


def metacarpal_deg(direction: Array, frame: npt.NDArray[np.int64], true: TrueDigit) -> float | None:
    """Mean angle between unit directions (T, 3) and the metacarpal's true ones; None without a frame."""
    truth = directions(at_frames(true.metacarpal, true.frame, frame))
    across = np.linalg.norm(np.cross(direction, truth), axis=-1)
    angle = np.degrees(np.arctan2(across, (direction * truth).sum(-1)))
    known = angle[np.isfinite(angle)]
    return float(known.mean()) if len(known) else None


def wrist_mcp_sd(poses: Poses, digit: Digit, layout: Layout, joints: Rows) -> float | None:
    """SD over the frames of the distance from the wrist to the digit's MCP joint, mm; a true skeleton's is 0
    where the palm does not fold.

    The wrist by its child half, on the hand's receiver, the MCP joint by its child half, on the proximal
    phalanx's. None where there is no wrist, or no such joint, or no two frames that show both.
    """
    if layout.wrist is None or not digit.metacarpal or digit.base != layout.wrist.segment:
        return None
    wrist, mcp = (_child_mm(joints, name) for name in (layout.wrist.joint, digit.joints[1]))
    if wrist is None or mcp is None:
        return None
    proximal = digit.segments[1]
    apart = np.linalg.norm(ride(poses, proximal, mcp) - ride(poses, digit.base, wrist), axis=-1)
    seen = apart[all_valid(poses, (digit.base, proximal))]
    return float(seen.std()) if len(seen) > 1 else None


def mean_and_p95(name: str, values: Array) -> Row:
    """Mean and 95th percentile of what is known among the values (T,), in mm; nothing where nothing is."""
    known = values[np.isfinite(values)]
    if not len(known):
        return {}
    return {f"{name}_mean_mm": float(known.mean()), f"{name}_p95_mm": float(np.percentile(known, 95))}


def _child_mm(joints: Rows, name: str) -> Array | None:
    row = joints.get(name)
    if row is None or row["status"] == "failed" or row["child_x_mm"] is None:
        return None
    return np.array([row[f"child_{axis}_mm"] for axis in "xyz"])


def _read(
    folder: SkeletonFolder, table: Table, columns: Sequence[str], name: RecordingName, reasons: list[str]
) -> dict[str, Columns]:
    """Columns by digit; a table that cannot be read has none and a reason."""
    if not folder.path.is_dir():
        return {}
    try:
        return dict(read_digits(folder.table(table), table, columns, name))
    except InputError as error:
        reasons.append(str(error))
        return {}
