"""Write the tables of one fitted skeleton, and of all recordings posed with it.

On paper: docs/whole-hand.md, sections 7 and 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.errors import InputError
from shukotsu.fit.calibration import REFERENCE_FRAMES, CalibratedHand, read_thinned
from shukotsu.fit.chain_builder import KINDS
from shukotsu.fit.fingertips import BONE, TIP, Fingertips, tipped_digits
from shukotsu.fit.fit import HandFit
from shukotsu.fit.fitted_motion import LEAST_RECEIVERS, PosedHand, joint_angles_of, pose_hand
from shukotsu.fit.frame_uncertainty import PosedErrors, posed_errors
from shukotsu.fit.gains import gains
from shukotsu.fit.hand_tables import (
    bone_rows,
    digits_carried,
    joint_rows,
    joints_beside,
    moved_rows,
    receiver_rows,
)
from shukotsu.fit.length_pulls import pull_rows
from shukotsu.fit.loose_receivers import NORMAL, LooseReceiver, moved_in
from shukotsu.fit.operations import Index
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.measured import NOT_MEASURED, measured_in
from shukotsu.hand.rotations import Array, rotate
from shukotsu.hand.sampled_motion import MIRROR
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.parts import Part, PartsWriter
from shukotsu.tables.poses import Poses, RecordingName, frame_count, pose_blocks, recording_name, usable_poses


def fitted_plan(plan: SubjectPlan, hand: str | None, model: str | None) -> SubjectPlan:
    """Restrict the plan to the recordings that the fit reads, and to the reference model if that is meant."""
    if model == REFERENCE:
        plan = replace(plan, models={REFERENCE: read_model(REFERENCE)})
    planned = plan.models.get(model or "") if plan.is_study else None
    fitting = None if planned is None else planned.fitting
    if hand is None or (fitting is not None and fitting.share_lengths):
        return plan
    return replace(plan, recordings=tuple(r for r in plan.recordings if r.hand.hand == hand))


def parts_of(plan: SubjectPlan, hand: str | None, model: str | None) -> list[Part]:
    """List the hand's skeletons under the model; raise InputError if the plan lacks the hand or the model."""
    if model is None:
        raise InputError("--model: is missing; expected a skeleton model that fits the whole hand")
    model = model if plan.is_study else next(iter(plan.models))
    if model not in plan.models:
        raise InputError(f"--plan: has no model {model!r}; expected one of {', '.join(plan.models)}")
    hand = hand or next(iter(plan.layouts))
    if hand not in plan.layouts:
        raise InputError(f"--plan: has no {hand} hand; expected {' or '.join(plan.layouts)}")
    parts = [part for part in plan.parts(model) if part.hand == hand]
    return parts or [plan.part(hand, model)]


def fitted_tables(plan: SubjectPlan, part: Part, tables: Mapping[str, PartsWriter]) -> list[PartsWriter]:
    """Return the tables in which to record why the skeleton cannot be fitted.

    If the hand has no usable recording, some tables are written without rows instead, as the study's problems
    already report the recordings.
    """
    recorded = dict(tables)
    calibration = plan.calibrating(part.hand, part.model, part.made_without)
    if not usable_poses([plan.poses(recording) for recording in calibration])[0]:
        for name in ("receivers", "moved_receivers", "gains", "length_pulls"):
            recorded.pop(name).rows(part, [])
    return list(recorded.values())


def write_fit(plan: SubjectPlan, part: Part, tables: Mapping[str, PartsWriter], hand: CalibratedHand) -> None:
    """Write the rows of one fitted skeleton, and of every recording posed with it, into their tables.

    Parameters
    ----------
    plan : SubjectPlan
        Recordings, layouts and models of the subject.
    part : Part
        Hand, model, and the task left out.
    tables : mapping of str to PartsWriter
        Writers of FIT_TABLES by name.
    hand : CalibratedHand
        The hand as `calibrated_hand` returns it.

    """
    tips = hand.tips
    note = {"note": hand.alone} if hand.alone else {}
    from_data = not plan.models[part.model].is_reference
    tables["fitted_joints"].rows(part, joint_rows(tips.fit, from_data=from_data))
    tables["fitted_bones"].rows(part, bone_rows(tips.fit, from_data=from_data))
    tables["receivers"].rows(part, receiver_rows(tips, hand.unsteady), **note)
    tables["gains"].rows(part, gains(tips) if from_data else [])
    tables["length_pulls"].rows(part, pull_rows(tips.fit) if from_data else [])
    for name in ("moved_receivers", "joint_angles", "bone_poses", "posed_tips"):
        tables[name].rows(part, [])
    calibrating = plan.calibrating(part.hand, part.model, part.made_without)
    layout, recordings = plan.layouts[part.hand], plan.posed if from_data else plan.evaluated
    for recording in recordings(part.hand, part.made_without):
        for path in usable_poses([plan.poses(recording)])[0]:
            if not from_data:
                for name, columns in posed_sample(tips, path).items():
                    tables[name].columns(part, columns)
                continue
            only_calibrates, moved = recording.role == "calibration", []
            # a suspect recording must first be corrected; the fit itself has checked calibrations
            if not only_calibrates and recording not in plan.suspect:
                moved = moved_in(tips.fit, read_thinned(path, layout.measured))
            tables["moved_receivers"].rows(part, moved_rows(layout, recording_name(path), moved))
            calibrates = only_calibrates or recording in calibrating
            for block in posed_blocks(tips, path, moved, calibrates=calibrates):
                for name, columns in block.items():
                    tables[name].columns(part, columns)


BLOCK_FRAMES = 1 << 14
LEFT_OUT_FRAMES = 512
"""Number of evenly spaced frames of a recording that are also posed without the distal receivers'
positions."""

ENDS = {BONE: "tip", TIP: "skin_tip"}
"""Parts of a fingertip, and the prefixes of their columns in posed_tips."""

ERRORS_OF_ANGLES = {
    "sd_deg": "angles_deg",
    "change_sd_deg": "changes_deg",
    "session_sd_deg": "session_deg",
    "session_change_sd_deg": "session_changes_deg",
}
"""Suffixes of columns of joint_angles, and the attribute of `PosedErrors` in each."""

UNSEEN_TURN_DEG = float(np.degrees(NORMAL["phalanx"][1]))
"""1-sigma turn (our choice) of the receiver on a digit's last bone about the last joint in a recording to
which the hand was not fitted: no receiver beyond that joint would show it."""

Columns = dict[str, Any]


def posed_blocks(
    tips: Fingertips, path: Path, moved: Sequence[LooseReceiver] = (), *, calibrates: bool = False
) -> Iterator[dict[str, Columns]]:
    """Pose a recording block by block; values that no receiver shows are null (`hand.measured`).

    Parameters
    ----------
    tips : Fingertips
        The hand with its fingertips.
    path : Path
        Poses file.
    moved : sequence of LooseReceiver
        Receivers that are displaced in the recording: from that frame on they are not used, and joints and
        digits that depend on them are null.
    calibrates : bool
        Whether the hand was fitted to the recording.

    Yields
    ------
    dict
        Columns of joint_angles, bone_poses and posed_tips by table, without the part's keys.

    Raises
    ------
    InputError
        If the file is not a poses table.

    """
    fit, name = tips.fit, recording_name(path)
    step = max(1, -(-frame_count(path) // LEFT_OUT_FRAMES))
    first, reference_deg = 0, None
    for recorded in pose_blocks(path, fit.layout.measured, BLOCK_FRAMES):
        valid = recorded.valid.copy()
        for receiver in moved:
            valid[recorded.frame >= receiver.start.frame, recorded.index(receiver.segment)] = False
        poses = replace(recorded, valid=valid)
        # every step-th frame of the whole recording is also posed without the distal receivers
        posed, left_out = pose_hand(fit, poses), np.arange(-first % step, len(poses.frame), step)
        frames = fit.convention.frames(poses)
        errors = posed_errors(tips, posed, frames, reference_deg)
        reference_deg = errors.reference_deg
        for digit in () if calibrates else known_digits(fit.layout):
            flexion_deg = errors.angles_deg[digit.joints[-1]][:, 0]
            flexion_deg[:] = np.hypot(flexion_deg, UNSEEN_TURN_DEG)
        block = {
            "joint_angles": angle_columns(name, fit, posed, poses, errors),
            "bone_poses": bone_columns(name, posed, poses, errors),
            "posed_tips": tip_columns(name, tips, posed, poses, left_out, errors),
        }
        for receiver in moved:
            layout, since = fit.layout, poses.frame >= receiver.start.frame
            joints = joints_beside(layout, receiver.segment)
            digits = digits_carried(layout, receiver.segment)
            _set_null(block["joint_angles"], dict.fromkeys(joints, since), "receiver-moved")
            _set_null(block["posed_tips"], dict.fromkeys(digits, since), "receiver-moved")
        _set_unmeasured_null(block, fit, poses)
        yield block
        first += len(poses.frame)


def _set_unmeasured_null(block: Mapping[str, Columns], fit: HandFit, poses: Poses) -> None:
    """Set to null all values that no receiver of the fit shows."""
    valid = poses.valid & np.isin(poses.segments, fit.model.receivers)
    measured, posed = measured_in(fit.layout, poses.segments, valid), valid.sum(1) >= LEAST_RECEIVERS
    of_table = {"joint_angles": measured.joints, "bone_poses": measured.bones, "posed_tips": measured.tips}
    for table, columns in block.items():
        _set_null(columns, {name: ~(seen & posed) for name, seen in of_table[table].items()}, NOT_MEASURED)


def _set_null(columns: Columns, gone: Mapping[str, npt.NDArray[np.bool_]], flag: str) -> None:
    """Set numbers to null, and flag the reason in rows without a flag.

    gone : frames (T,) to clear, by joint, segment or digit.
    """
    key = next(key for key in ("joint", "segment", "digit") if key in columns)
    names = columns[key].unique().to_pylist()
    count = len(columns["frame"]) // max(len(names), 1)
    kept = np.zeros(count, bool)
    null = np.concatenate([gone.get(name, kept) for name in names]) if names else kept
    for column, values in columns.items():
        if column not in ("time_s", "residual_mm") and getattr(values, "dtype", None) == np.float64:
            columns[column] = np.where(null, np.nan, values)
    flags = columns["flags"]
    columns["flags"] = pc.if_else(pa.array(null & pc.equal(flags, "").to_numpy(False)), flag, flags)


def posed_sample(tips: Fingertips, path: Path) -> dict[str, Columns]:
    """Pose a few frames of a recording with the hand that anatomy alone predicts.

    Parameters
    ----------
    tips : Fingertips
        The hand with its fingertips.
    path : Path
        Poses file.

    Returns
    -------
    dict
        Columns of bone_poses and posed_tips by table, without errors and without the part's keys.

    """
    fit, name = tips.fit, recording_name(path)
    poses = read_thinned(path, fit.layout.measured, REFERENCE_FRAMES)
    posed, every = pose_hand(fit, poses), np.arange(len(poses.frame))
    block = {
        "bone_poses": bone_columns(name, posed, poses),
        "posed_tips": tip_columns(name, tips, posed, poses, every),
    }
    _set_unmeasured_null(block, fit, poses)
    return block


def angle_columns(
    name: RecordingName, fit: HandFit, posed: PosedHand, poses: Poses, errors: PosedErrors
) -> Columns:
    """Build the columns of joint_angles for some frames, joint after joint (section 11).

    Parameters
    ----------
    name : RecordingName
        Name of the recording.
    fit : HandFit
        The hand.
    posed : PosedHand
        The hand in T frames.
    poses : Poses
        The same T frames of the recording.
    errors : PosedErrors
        Errors of the frames.

    Returns
    -------
    dict
        Columns of joint_angles, deg, without the part's keys.

    """
    angles = _turns_deg(posed, fit.layout) | joint_angles_of(fit, posed)
    unknown = np.full((len(poses.frame), 3), np.nan)
    columns = _keys(name, "joint", list(angles), poses)
    columns["time_s"] = np.tile(poses.time_s, len(angles))
    of_errors = {suffix: getattr(errors, attribute) for suffix, attribute in ERRORS_OF_ANGLES.items()}
    for suffix, values in {"deg": angles, **of_errors}.items():
        stacked = np.concatenate([*(values.get(joint, unknown) for joint in angles), np.empty((0, 3))])
        for index, part in enumerate(("flexion", "abduction", "rotation")):
            columns[f"{part}_{suffix}"] = stacked[:, index]
    return columns


def bone_columns(
    name: RecordingName, posed: PosedHand, poses: Poses, errors: PosedErrors | None = None
) -> Columns:
    """Build the columns of bone_poses for some frames, bone after bone (section 11).

    Parameters
    ----------
    name : RecordingName
        Name of the recording.
    posed : PosedHand
        The hand in T frames.
    poses : Poses
        The same T frames of the recording.
    errors : PosedErrors, optional
        Errors of the frames; null if omitted.

    Returns
    -------
    dict
        Columns of bone_poses, mm and unit quaternions, bone to transmitter frame, without the part's keys.

    """
    columns = _keys(name, "segment", posed.bones, poses)
    position, turn = _stack(posed.bone_position_mm), _stack(posed.bone_quaternion)
    columns |= {f"{axis}_mm": position[:, index] for index, axis in enumerate("xyz")}
    columns |= {f"q{part}": turn[:, index] for index, part in enumerate("wxyz")}
    if errors is None:
        return columns | dict.fromkeys(("sd_mm", "turn_sd_deg"), np.full(len(turn), np.nan))
    return columns | {"sd_mm": _stack(errors.centre_mm), "turn_sd_deg": _stack(errors.turn_deg)}


def tip_columns(
    name: RecordingName,
    tips: Fingertips,
    posed: PosedHand,
    poses: Poses,
    left_out: Index,
    errors: PosedErrors | None = None,
) -> Columns:
    """Build the columns of posed_tips for some frames, digit after digit (section 11).

    Parameters
    ----------
    name : RecordingName
        Name of the recording.
    tips : Fingertips
        The hand with its fingertips.
    posed : PosedHand
        The hand in T frames.
    poses : Poses
        The same T frames of the recording.
    left_out : array of int, shape (F,)
        Frames that are also posed without the distal receivers' positions, for the column error_left_out_mm.
    errors : PosedErrors, optional
        Errors of the frames; if omitted they are null, and the digits end where their bones carry them.

    Returns
    -------
    dict
        Columns of posed_tips, mm, without the part's keys.

    """
    fit = tips.fit
    digits, ends_mm = digits_with_tip(fit), _ends_mm(tips, posed, None if errors is None else poses)
    receivers = [posed.receivers.index(digit.tip) for digit in digits]
    measured = poses.position_mm[:, [poses.index(digit.tip) for digit in digits]]
    valid = poses.valid[:, [poses.index(digit.tip) for digit in digits]]
    blind = pose_hand(fit, poses.take(left_out), [digit.tip for digit in digits])
    error_mm = np.linalg.norm(posed.receiver_mm[:, receivers] - measured, axis=-1)
    ends_sd_mm = np.full((*valid.shape, len(ENDS)), np.nan)
    if errors is not None:
        ends_sd_mm[:, [digits.index(digit) for digit in tipped_digits(fit)]] = errors.tips_mm
    left_out_mm = np.full(valid.shape, np.nan)
    left_out_mm[left_out] = np.linalg.norm(blind.receiver_mm[:, receivers] - measured[left_out], axis=-1)
    return {
        **_keys(name, "digit", [digit.name for digit in digits], poses),
        "time_s": np.tile(poses.time_s, len(digits)),
        **{
            f"{prefix}_{axis}_mm": _stack(ends_mm[part])[:, index]
            for part, prefix in ENDS.items()
            for index, axis in enumerate("xyz")
        },
        **{f"{prefix}_sd_mm": _stack(ends_sd_mm[..., index]) for index, prefix in enumerate(ENDS.values())},
        "error_mm": _stack(np.where(valid, error_mm, np.nan)),
        "error_left_out_mm": _stack(np.where(valid, left_out_mm, np.nan)),
        "residual_mm": np.tile(posed.residual_mm, len(digits)),
    }


def digits_with_tip(fit: HandFit) -> list[Digit]:
    """List the digits whose last bone carries a receiver of the fit."""
    return [digit for digit in fit.layout.digits.values() if digit.tip in fit.model.receivers]


def _ends_mm(tips: Fingertips, posed: PosedHand, poses: Poses | None) -> dict[str, Array]:
    """Compute the ends (T, D, 3) of bone and skin of digits, by part (`ENDS`); NaN without known anatomy.

    They are carried by the distal receiver if poses are passed and it is valid, as it follows its bone
    better, otherwise by the posed bone.
    """
    fit, digits = tips.fit, list(tips.digits)
    mirrored_y = MIRROR if fit.convention.left else np.ones(3)
    ends_mm = {part: np.full((len(posed.posed), len(digits_with_tip(fit)), 3), np.nan) for part in ENDS}
    for part, out in ends_mm.items():
        carried_mm = None if poses is None else tips.in_transmitter(poses, part)
        for index, digit in enumerate(digits_with_tip(fit)):
            if digit.name not in digits:
                continue
            last, along = posed.bones.index(digit.tip), np.array([fit.bones[digit.tip].length_mm, 0.0, 0.0])
            if part == TIP:
                along += tips.offsets_mm[digits.index(digit.name), 0] * mirrored_y
            turned = rotate(posed.bone_quaternion[:, last], along)
            out[:, index] = posed.bone_position_mm[:, last] + turned
            if carried_mm is not None:
                by_receiver = carried_mm[:, digits.index(digit.name)]
                out[:, index] = np.where(np.isfinite(by_receiver), by_receiver, out[:, index])
    return ends_mm


def _keys(name: RecordingName, key: str, values: Sequence[str], poses: Poses) -> Columns:
    """Build the key columns of joints, segments or digits one after the other, each over all frames."""
    n_frames = len(poses.frame)
    columns: Columns = {"task": name.task, "trial": name.trial}
    codes = np.repeat(np.arange(len(values), dtype=np.int32), n_frames)
    columns[key] = pa.DictionaryArray.from_arrays(codes, pa.array(values, pa.string()))
    columns["flags"] = pa.repeat("", n_frames * len(values))
    return columns | {"frame": np.tile(poses.frame, len(values))}


def _stack(values: Array) -> Array:
    """Reshape (T, N, ...) to (N T, ...), name after name."""
    return np.swapaxes(values, 0, 1).reshape(-1, *values.shape[2:])


def _turns_deg(posed: PosedHand, layout: Layout) -> dict[str, Array]:
    """Return rotations (T, 3), deg, about the axes of joints without known anatomy; NaN for missing axes."""
    by_anatomy = {joint for digit in known_digits(layout) for joint in digit.joints}
    turns: dict[str, Array] = {}
    for index, (joint, kind) in enumerate(posed.angle_names):
        if joint not in by_anatomy:
            of_joint = turns.setdefault(joint, np.full((len(posed.posed), 3), np.nan))
            of_joint[:, KINDS.index(kind)] = np.degrees(posed.angles_rad[:, index])
    return turns
