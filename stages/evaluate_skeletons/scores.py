"""How well the skeletons do in one recording: a row of skeleton_scores for each, digit by digit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.long_sample import LongSample
from kinematics.recordings import BLOCK_FRAMES, Recordings
from kinematics.rotations import Array
from kinematics.skeleton import Rows, all_valid, ride
from schemas.catalogue import METACARPALS, POSED_TIPS, TIPS
from schemas.errors import InputError
from schemas.layout import Digit, Layout
from schemas.poses import Poses, RecordingName, read_poses, recording_name
from schemas.tables import Table
from stages.evaluate_skeletons.skeleton_folder import (
    Columns,
    SkeletonFolder,
    digit_runs,
    joined,
    read_digits,
    stack,
)
from stages.evaluate_skeletons.truth_folder import (
    QUATERNION,
    TIP,
    TrueDigit,
    TruthFolder,
    at_frames,
    directions,
)

Row = dict[str, Any]
Samples = Mapping[str, LongSample]
"""What is known of the numbers in a column, by its name."""


@dataclass(frozen=True)
class Recording:
    """An evaluated recording.

    poses_in_blocks : None where it cannot be read; message : why. truth : by digit, frames numbered as the
    recording's, of a simulated one; truth_folder : where it is from.
    """

    path: Path
    name: RecordingName
    layout: Layout
    poses_in_blocks: Recordings | None
    truth_folder: TruthFolder | None
    truth: Mapping[str, TrueDigit]
    message: str

    def poses(self, digit: Digit) -> Poses:
        """Poses of the receivers that a digit's replay needs, whole."""
        measured = [segment for segment in digit.segments if self.layout.segments[segment].measured]
        return read_poses(self.path, (digit.base, *measured))

    def blocks(self, *segments: str) -> Iterable[Poses]:
        """Poses of those receivers at least, a block of frames at a time."""
        return () if self.poses_in_blocks is None else self.poses_in_blocks.blocks(*segments)

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


def read_recording(
    path: Path, layout: Layout, truths: Sequence[TruthFolder], block_frames: int = BLOCK_FRAMES
) -> Recording:
    """Give an evaluated recording with the truth of the same task and trial, or of the same task.

    Raises InputError where a truth is not that of the recording.
    """
    name, tip_of = recording_name(path), {digit.name: digit.tip for digit in layout.digits.values()}
    own = [truth for truth in truths if truth.name.task == name.task and truth.name.trial in ("", name.trial)]
    best = max(own, key=lambda truth: truth.name.trial, default=None)
    try:
        blocks = Recordings([path], layout.measured, block_frames)
        poses = read_poses(path, tuple(dict.fromkeys(tip_of.values()))) if best else None
    except InputError as error:
        return Recording(path, name, layout, None, None, {}, str(error))
    truth = {} if best is None or poses is None else best.digits(poses, tip_of)
    return Recording(path, name, layout, blocks, best, truth, "")


def score_folder(
    recording: Recording, folder: SkeletonFolder, wrist_mcp_sd_mm: Mapping[str, float | None]
) -> list[Row]:
    """Rows of one skeleton in one recording, a digit each; without numbers, and why, where it has none.

    wrist_mcp_sd_mm : by digit, see `wrist_mcp_sd`.
    """
    reasons, name = [folder.message], recording.name
    own = POSED_TIPS if folder.whole_hand else TIPS
    replayed = _known(folder, TIPS, ("error_mm",), name, reasons)
    posed: dict[str, Samples] = {}
    if folder.whole_hand:
        posed = _known(folder, POSED_TIPS, ("error_mm", "error_left_out_mm"), name, reasons)
    tips: dict[str, Columns] = {}
    metacarpals: dict[str, Columns] = {}
    if recording.truth:
        tips = _read(folder, own, ("frame", *TIP), name, reasons)
        metacarpals = _read(folder, METACARPALS, ("frame", *QUATERNION), name, reasons)
    rows = []
    for digit in recording.layout.digits:
        told = folder.errors.get((name.task, name.trial, digit), {}).get("message", "")
        row = recording.row(digit, folder.model, joined([*reasons, told]))
        row |= {
            "calibrated_on": folder.calibrated_text,
            "held_out": folder.held_out(name),
            "reference": False,
            "wrist_mcp_sd_mm": wrist_mcp_sd_mm.get(digit),
        }
        row |= tip_numbers(replayed.get(digit), posed.get(digit), whole_hand=folder.whole_hand)
        true = recording.truth.get(digit)
        if true is not None:
            row |= truth_numbers(tips.get(digit), metacarpals.get(digit), true)
        rows.append(row)
    return rows


def tip_numbers(replayed: Samples | None, posed: Samples | None, *, whole_hand: bool) -> Row:
    """Tip errors of one digit in one recording, and n_frames.

    replayed : columns of tips; posed : of posed_tips. The replay follows receivers and never asks where the
    distal one is: of a model that does not pose the whole hand its error is the left-out one, too.
    """
    nothing = LongSample()
    replay = nothing if replayed is None else replayed["error_mm"]
    together = nothing if posed is None else posed["error_mm"]
    left_out = nothing if posed is None else posed["error_left_out_mm"]
    found = mean_and_p95("replay", replay)
    found |= mean_and_p95("left_out", left_out if whole_hand else replay)
    posed_mean = together.mean() if len(together) else None
    return found | {"posed_mean_mm": posed_mean, "n_frames": max(len(replay), len(together))}


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
    apart = np.linalg.norm(tip_mm - at_frames(true.tip_mm, true.frame, frame), axis=-1)
    return mean_and_p95("true_tip", known(apart))


def metacarpal_deg(direction: Array, frame: npt.NDArray[np.int64], true: TrueDigit) -> float | None:
    """Mean angle between unit directions (T, 3) and the metacarpal's true ones; None without a frame."""
    truth = directions(at_frames(true.metacarpal, true.frame, frame))
    across = np.linalg.norm(np.cross(direction, truth), axis=-1)
    angle = np.degrees(np.arctan2(across, (direction * truth).sum(-1)))
    known = angle[np.isfinite(angle)]
    return float(known.mean()) if len(known) else None


def wrist_mcp_sd(
    blocks: Iterable[Poses], digit: Digit, layout: Layout, skeletons: Sequence[Rows]
) -> list[float | None]:
    """SD over the frames of the distance from the wrist to the digit's MCP joint, mm, for every skeleton; a
    true skeleton's is 0 where the palm does not fold.

    blocks : poses of the base and the proximal phalanx. skeletons : rows of joint_centres by joint. The wrist
    by its child half, on the hand's receiver, the MCP joint by its child half, on the proximal phalanx's.
    None where there is no wrist, or no such joint, or no two frames that show both.
    """
    if layout.wrist is None or not digit.metacarpal or digit.base != layout.wrist.segment:
        return [None] * len(skeletons)
    names, ends = (layout.wrist.joint, digit.joints[1]), (digit.base, digit.segments[1])
    points = [tuple(_child_mm(joints, name) for name in names) for joints in skeletons]
    apart_mm = {pair: LongSample() for pair in points if None not in pair}  # models share most joints
    for poses in blocks:
        seen = all_valid(poses, ends)
        for (wrist, mcp), sample in apart_mm.items():
            between = ride(poses, ends[1], np.array(mcp)) - ride(poses, ends[0], np.array(wrist))
            sample.add(np.linalg.norm(between, axis=-1)[seen])
    sd = {pair: sample.sd() for pair, sample in apart_mm.items() if len(sample) > 1}
    return [sd.get(pair) for pair in points]


def known(values: Array) -> LongSample:
    """What is known among the values (T,)."""
    sample = LongSample()
    sample.add_known(values)
    return sample


def mean_and_p95(name: str, values_mm: LongSample) -> Row:
    """Mean and 95th percentile; nothing where nothing is known."""
    if not len(values_mm):
        return {}
    return {f"{name}_mean_mm": values_mm.mean(), f"{name}_p95_mm": values_mm.percentile(95)}


def _child_mm(joints: Rows, name: str) -> tuple[float, ...] | None:
    row = joints.get(name)
    if row is None or row["status"] == "failed" or row["child_x_mm"] is None:
        return None
    return tuple(float(row[f"child_{axis}_mm"]) for axis in "xyz")


def _known(
    folder: SkeletonFolder, table: Table, columns: Sequence[str], name: RecordingName, reasons: list[str]
) -> dict[str, Samples]:
    """What is known of columns, by digit; a table that cannot be read has none and a reason."""
    found: dict[str, dict[str, LongSample]] = {}
    if not folder.path.is_dir():
        return {}
    try:
        for digit, numbers in digit_runs(folder.table(table), table, columns, name):
            samples = found.setdefault(digit, {column: LongSample() for column in columns})
            for sample, values in zip(samples.values(), numbers.T, strict=True):
                sample.add_known(values)
    except InputError as error:
        reasons.append(str(error))
        return {}
    return dict(found)


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
