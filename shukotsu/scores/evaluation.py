"""Score every skeleton and reference of a hand in every recording, digit by digit, and its joint errors.

The columns are explained in docs/method.md, "Judging a skeleton".
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import join_reasons
from shukotsu.hand.digit_chain import Rows, all_valid, carried_mm
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.posed_recording import QUATERNION, RecordingReader, part_rows, readable
from shukotsu.hand.rotations import conjugate, rotate
from shukotsu.scores.truth import TIP, RecordingTruth, Stated, TrueDigit, joint_errors, read_truth, truth_for
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables import catalogue
from shukotsu.tables.parts import Opened, Part, opened_once
from shukotsu.tables.poses import Poses, RecordingName, read_poses
from shukotsu.tables.typed_table import Table, vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointErrorsRow, SkeletonScoresRow

Scored = TypeVar("Scored", "SkeletonScoresRow", "JointErrorsRow")

DISTAL_RECEIVER, TRUE_SKELETON = "distal-receiver", "true-skeleton"
"""References without a model: the distal receiver as the tip, and the true skeleton."""

_OF_A_FIT = {"joint_centres": "fitted_joints", "bone_lengths": "fitted_bones"}
"""Tables of the anatomical prior, which exist only as tables of the fit."""


@dataclass(frozen=True)
class ScoredSkeleton:
    """A skeleton to score, and the reader of its tables.

    Attributes
    ----------
    reader : RecordingReader
        Reader for any recording of the hand.
    calibrated_on : str
        Recordings from which the skeleton was made, "task" or "task, trial", joined by ";".
    tasks : tuple of str
        Tasks of these recordings.
    stated : Stated
        Joints and bones of the skeleton.
    tip_messages : mapping
        (task, trial, digit) -> message.
    message : str
        Why tables could not be read; empty if all were read.
    reference : bool
        Whether it is the anatomical prior, scored in the frames in which it was posed.

    """

    reader: RecordingReader
    calibrated_on: str
    tasks: tuple[str, ...]
    stated: Stated
    tip_messages: Mapping[tuple[str, str, str], str]
    message: str
    reference: bool = False


def read_skeleton(opened: Opened, plan: SubjectPlan, part: Part) -> ScoredSkeleton:
    """Read a skeleton's short tables; report tables that could not be made in `message`.

    Parameters
    ----------
    opened : callable
        Opens a subject table.
    plan : SubjectPlan
        Plan of the subject.
    part : Part
        The skeleton; the model REFERENCE is the anatomical prior.

    Returns
    -------
    ScoredSkeleton
        The skeleton.

    Raises
    ------
    TableError
        If a table is damaged or of another version.

    """
    hand, layout, reference = part.hand, plan.layouts[part.hand], part.model == REFERENCE
    any_recording = next(each for each in plan.recordings if each.hand.hand == hand)
    reader = RecordingReader(
        any_recording,
        layout,
        read_model(REFERENCE) if reference else plan.models[part.model],
        part,
        plan.poses(any_recording),
        lambda name: plan.table(_OF_A_FIT.get(name, name) if reference else name, hand, part.model),
        opened,
    )
    reasons: list[str] = []

    def rows(table: Table) -> list[Any]:
        return readable(lambda: part_rows(reader.tables, opened, table, part), reasons) or []

    joints, bones = rows(catalogue.JOINT_CENTRES), rows(catalogue.BONE_LENGTHS)
    stated = Stated({row["joint"]: row for row in joints}, {row["bone"]: row for row in bones})
    if reference:
        calibrating, calibrated_on = plan.all_calibrating(hand), ""
        unknown = layout.digits.keys() - {digit.name for digit in known_digits(layout)}
        tip_messages = {
            (recording.task, recording.trial, digit): "no published anatomy of this digit"
            for recording in plan.evaluated(hand)
            for digit in unknown
        }
    else:
        calibrating = plan.calibrating(hand, part.model, part.made_without)
        calibrated_on = ";".join(", ".join(filter(None, (r.task, r.trial))) for r in calibrating)
        errors = rows(catalogue.TIP_ERRORS)
        tip_messages = {(row["task"], row["trial"], row["digit"]): row["message"] for row in errors}
    tasks = tuple(recording.task for recording in calibrating)
    return ScoredSkeleton(
        reader, calibrated_on, tasks, stated, tip_messages, join_reasons(reasons), reference
    )


@dataclass(frozen=True)
class EvaluatedRecording:
    """A recording in which skeletons are scored.

    Attributes
    ----------
    recording, layout : Recording, Layout
        The recording and the layout of its hand.
    poses : Poses or None
        Its poses; None if it has none, with the reason in `message`.
    truth : mapping
        Digit -> its true motion, for a simulated recording.
    stated_truth : RecordingTruth or None
        Its true joints and bones.
    message : str
        Why it has no poses.

    """

    recording: Recording
    layout: Layout
    poses: Poses | None
    truth: Mapping[str, TrueDigit]
    stated_truth: RecordingTruth | None
    message: str = ""

    def row(self, digit: str, model: str, message: str = "") -> SkeletonScoresRow:
        """Build a row without scores, by default for a reference that was not made from recordings."""
        row: SkeletonScoresRow = {
            "model": model,
            "calibrated_on": "",
            "held_out": True,
            "reference": True,
            "digit": digit,
            "n_frames": 0,
            "message": join_reasons([self.message, message]),
        }
        key: Any = self.recording.key
        row |= key
        return row


def evaluated_recording(
    plan: SubjectPlan, recording: Recording, truth: RecordingTruth | None
) -> EvaluatedRecording:
    """Read a recording and its truth.

    Parameters
    ----------
    plan : SubjectPlan
        Plan of the subject.
    recording : Recording
        The recording.
    truth : RecordingTruth or None
        Its truth, if it is simulated.

    Returns
    -------
    EvaluatedRecording
        The recording, or the reason why it has no poses.

    Raises
    ------
    InputError
        If the truth is of another recording.

    """
    layout = plan.layouts[recording.hand.hand]
    reasons: list[str] = []
    poses = readable(lambda: read_poses(plan.poses(recording), layout.measured), reasons)
    if poses is None:
        return EvaluatedRecording(recording, layout, None, {}, None, *reasons)
    true = {} if truth is None else truth.digits(poses, layout)
    return EvaluatedRecording(recording, layout, poses, true, truth)


def score_skeleton(recording: EvaluatedRecording, skeleton: ScoredSkeleton) -> list[SkeletonScoresRow]:
    """Score one skeleton in one recording.

    Parameters
    ----------
    recording : EvaluatedRecording
        The recording.
    skeleton : ScoredSkeleton
        The skeleton.

    Returns
    -------
    list of dict
        Rows of skeleton_scores, one per digit; a digit that cannot be scored has a message instead of scores.

    """
    recorded, rows = recording.recording, []
    reader = replace(skeleton.reader, recording=recorded)
    columns = ("error_mm", "frame", *TIP)
    lost = skeleton.reference and bool(skeleton.message)
    for digit in recording.layout.digits.values():  # one digit at a time, to bound memory
        reasons = [skeleton.message]

        def numbers(table: Table, names: Sequence[str], of: str, why: list[str] = reasons) -> Array:
            read = readable(lambda: reader.numbers(table, names, name=of, every=False), why) or {}
            return read.get(of, np.empty((0, len(names))))

        replayed = posed = np.empty((0, len(columns)))
        if not skeleton.reference:
            replayed = posed = numbers(catalogue.TIPS, columns, digit.name)
        if reader.is_fitted and not lost:
            posed = numbers(catalogue.POSED_TIPS, (*columns, "error_left_out_mm"), digit.name)
        bone = np.empty((0, 5))
        if recording.truth and not lost:
            table, of = catalogue.METACARPALS, digit.name
            if skeleton.reference:
                table, of = catalogue.BONE_POSES, digit.segments[0]
            bone = numbers(table, ("frame", *QUATERNION), of)
        message = skeleton.tip_messages.get((recorded.task, recorded.trial, digit.name), "")
        row = recording.row(digit.name, reader.part.model, join_reasons([*reasons, message]))
        frame, poses = posed[:, 1].astype(np.int64), recording.poses
        if skeleton.reference and poses is not None:
            poses = poses.take(np.flatnonzero(np.isin(poses.frame, frame)))
        row |= {
            "calibrated_on": skeleton.calibrated_on,
            "held_out": skeleton.reference or recorded.task not in skeleton.tasks,
            "reference": skeleton.reference,
            "wrist_mcp_sd_mm": wrist_mcp_sd(poses, digit, recording.layout, skeleton.stated.joints),
        }
        row |= tip_numbers(replayed, posed, fitted=reader.is_fitted)
        true = recording.truth.get(digit.name)
        if true is not None:
            row |= mean_and_p95("true_tip", true.tip_errors_mm(posed[:, 2:5], frame))
            if digit.metacarpal:
                row["metacarpal_deg"] = true.metacarpal_deg(bone[:, 1:], bone[:, 0].astype(np.int64))
        rows.append(row)
    return rows


def tip_numbers(replayed: Array, posed: Array, *, fitted: bool) -> SkeletonScoresRow:
    """Compute the tip errors of one digit in one recording.

    A replay never uses the position of the distal receiver. For a model that does not pose the whole hand,
    its error is therefore also the left-out error.

    Parameters
    ----------
    replayed : array, shape (T, C)
        Rows of tips, the error (mm) first.
    posed : array, shape (T, C)
        Rows of posed_tips: the error first, the error with the distal receivers left out last.
    fitted : bool
        Whether the model poses the whole hand.

    Returns
    -------
    dict
        Columns replay_*, posed_mean_mm, left_out_* and n_frames.

    """
    replay_mm = finite_values(replayed[:, 0])
    error_mm = finite_values(posed[:, 0]) if fitted else np.empty(0)
    numbers: SkeletonScoresRow = {
        "posed_mean_mm": float(error_mm.mean()) if len(error_mm) else None,
        "n_frames": max(len(replay_mm), len(error_mm)),
    }
    numbers |= mean_and_p95("replay", replay_mm)
    numbers |= mean_and_p95("left_out", posed[:, -1] if fitted else replay_mm)
    return numbers


def wrist_mcp_sd(poses: Poses | None, digit: Digit, layout: Layout, joints: Rows) -> float | None:
    """Compute the SD over frames of the distance from wrist to MCP joint.

    Parameters
    ----------
    poses : Poses or None
        The recording.
    digit, layout : Digit, Layout
        The digit and the layout of the hand.
    joints : mapping
        Rows of joint_centres by joint.

    Returns
    -------
    float or None
        SD, mm; None if the digit does not start at the wrist, either centre is missing, or fewer than two
        frames are valid.

    """
    if poses is None or layout.wrist is None or not digit.metacarpal or digit.base != layout.wrist.segment:
        return None
    wrist, mcp = (_child_mm(joints, name) for name in (layout.wrist.joint, digit.joints[1]))
    if wrist is None or mcp is None:
        return None
    ends = (digit.base, digit.segments[1])
    seen = all_valid(poses, ends)
    along_mm = carried_mm(poses, ends[1], mcp) - carried_mm(poses, ends[0], wrist)
    apart_mm = np.linalg.norm(along_mm, axis=-1)[seen]
    return float(apart_mm.std()) if len(apart_mm) > 1 else None


def finite_values(values: Array) -> Array:
    """Select the finite values.

    Parameters
    ----------
    values : array, shape (T,)
        Values, NaN in gaps.

    Returns
    -------
    array, shape (n,)
        The finite values in their order.

    """
    return values[np.isfinite(values)]


def mean_and_p95(name: str, values_mm: Array) -> Any:
    """Compute the columns of the mean and the 95th percentile of the finite values.

    Parameters
    ----------
    name : str
        Prefix of the columns' names.
    values_mm : array, shape (T,)
        Values, NaN in gaps.

    Returns
    -------
    dict
        NAME_mean_mm and NAME_p95_mm; empty if no value is finite.

    """
    values_mm = finite_values(values_mm)
    if not len(values_mm):
        return {}
    return {f"{name}_mean_mm": float(values_mm.mean()), f"{name}_p95_mm": float(np.percentile(values_mm, 95))}


def _child_mm(joints: Rows, name: str) -> Array | None:
    """Return the child half (3,), mm, of a joint's centre, or None if it has none."""
    row = joints.get(name)
    if row is None or row["status"] == "failed" or row["child_x_mm"] is None:
        return None
    return vector_of(row, "child_", "_mm")


def distal_receiver_row(recording: EvaluatedRecording, digit: Digit) -> SkeletonScoresRow:
    """Build the row of reference distal-receiver: tip error 0, and the receiver's distance to the tip."""
    row, poses = recording.row(digit.name, DISTAL_RECEIVER), recording.poses
    if poses is None:
        return row
    true = recording.truth.get(digit.name)
    valid, index = all_valid(poses, (digit.tip,)), poses.index(digit.tip)
    row["n_frames"] = int(valid.sum())
    row |= mean_and_p95("replay", np.zeros(row["n_frames"]))
    if true is not None:
        errors_mm = true.tip_errors_mm(poses.position_mm[valid, index], poses.frame[valid])
        row |= mean_and_p95("true_tip", errors_mm)
    return row


def true_skeleton_row(recording: EvaluatedRecording, digit: Digit) -> SkeletonScoresRow | None:
    """Build the row of reference true-skeleton, whose replay has only errors of skin and tracker.

    The metacarpal is the true one in every frame; the true tip is fixed at its mean position in the distal
    receiver's frame. Return None if the truth lacks the digit.
    """
    true, truth, poses = recording.truth.get(digit.name), recording.stated_truth, recording.poses
    if true is None or truth is None or poses is None or not digit.metacarpal:
        return None
    joints, bones = truth.stated.joints, truth.stated.bones
    needed = [joints.get(name, {}).get("child_x_mm") for name in digit.joints[1:]]
    needed += [bones.get(name, {}).get("x_mm") for name in digit.segments[1:]]
    if None in needed:
        return None
    measured = [name for name in digit.segments if recording.layout.segments[name].measured]
    usable = all_valid(poses, (digit.base, *measured))
    bone = true.metacarpal_mm * true.metacarpals_at(poses.frame)
    replayed = carried_mm(poses, digit.base, _true_base(digit, joints, bone, poses)) + bone
    for segment in digit.segments[1:-1]:
        bone_mm = vector_of(bones[segment], "", "_mm")
        replayed = replayed + rotate(poses.quaternion[:, poses.index(segment)], bone_mm)
    last = poses.index(digit.tip)
    dip_mm = vector_of(joints[digit.joints[-1]], "child_", "_mm")
    replayed = replayed - rotate(poses.quaternion[:, last], dip_mm)
    error = np.where(usable, np.linalg.norm(replayed - poses.position_mm[:, last], axis=-1), np.nan)
    row = recording.row(digit.name, TRUE_SKELETON) | {"n_frames": int(np.isfinite(error).sum())}
    row |= mean_and_p95("replay", error) | mean_and_p95("left_out", error)
    row["wrist_mcp_sd_mm"] = wrist_mcp_sd(poses, digit, recording.layout, joints)
    row["metacarpal_deg"] = 0.0
    tip_mm = carried_mm(poses, digit.tip, dip_mm + vector_of(bones[digit.tip], "", "_mm"))
    valid = poses.valid[:, last]
    errors_mm = true.tip_errors_mm(np.where(valid[:, None], tip_mm, np.nan), poses.frame)
    row |= mean_and_p95("true_tip", errors_mm)
    return row


def _true_base(digit: Digit, joints: Rows, bone: Array, poses: Poses) -> Array:
    """Return a digit's first joint (3,), mm in the base receiver's frame, or its metacarpal's mean start."""
    first = joints.get(digit.joints[0])
    if first is not None and first["parent_x_mm"] is not None:
        return vector_of(first, "parent_", "_mm")
    back = rotate(conjugate(poses.quaternion[:, poses.index(digit.base)]), bone)
    seen = poses.valid[:, poses.index(digit.base)] & np.isfinite(bone[:, 0])
    if not seen.any():
        return np.full(3, np.nan)
    return np.asarray(vector_of(joints[digit.joints[1]], "parent_", "_mm") - back[seen].mean(0))


def evaluate_hand(plan: SubjectPlan, hand: str) -> tuple[list[SkeletonScoresRow], list[JointErrorsRow]]:
    """Score all skeletons and references of a hand.

    A model that does not use a task is identical with and without it, so only the first row of each key is
    kept.

    Parameters
    ----------
    plan : SubjectPlan
        Plan of the subject.
    hand : str
        right or left.

    Returns
    -------
    tuple of list of dict
        Rows of skeleton_scores and of joint_errors.

    Raises
    ------
    InputError
        If a truth is of another recording or hand.

    """
    truths = _truths(plan, hand)
    with opened_once() as opened:
        parts = [part for part in plan.parts() if part.hand == hand]
        if known_digits(plan.layouts[hand]):
            parts.append(plan.part(hand, REFERENCE))
        skeletons = [read_skeleton(opened, plan, part) for part in parts]
        scores = [
            row
            for recording in plan.evaluated(hand)
            for row in _score_rows(evaluated_recording(plan, recording, truths.get(recording)), skeletons)
        ]
    errors: list[JointErrorsRow] = []
    for skeleton in skeletons:
        truth = truth_for(skeleton.tasks, list(truths.values()))
        if truth is not None:
            model = skeleton.reader.part.model
            keys: JointErrorsRow = {"model": model, "calibrated_on": skeleton.calibrated_on}
            errors += [{**keys, **row} for row in joint_errors(skeleton.stated, truth, plan.layouts[hand])]
    scores = _first_of_each(scores, catalogue.SKELETON_SCORES.key)
    return scores, _first_of_each(errors, catalogue.JOINT_ERRORS.key)


def _first_of_each(rows: Sequence[Scored], key: Sequence[str]) -> list[Scored]:
    """Return the first row of each key."""
    first: dict[tuple[object, ...], Scored] = {}
    for row in rows:
        first.setdefault(tuple(row.get(name) for name in key), row)
    return list(first.values())


def _truths(plan: SubjectPlan, hand: str) -> dict[Recording, RecordingTruth]:
    """Read the truths of a hand's recordings; if a folder is missing, print a note and leave it out."""
    truths = {}
    for recording in plan.recordings_of(hand, "calibration", "evaluation", "both"):
        folder = recording.truth
        if folder is not None and folder.is_dir():
            name = RecordingName(plan.who.subject, *recording.key_in_session, plan.who.session)
            truths[recording] = read_truth(folder, name)
        elif folder is not None:
            print(f"note: no truth: {folder}: no such folder", file=sys.stderr)
    return truths


def _score_rows(
    recording: EvaluatedRecording, skeletons: Sequence[ScoredSkeleton]
) -> Iterator[SkeletonScoresRow]:
    """Yield rows of skeleton_scores of one recording: skeletons first, then references without a model."""
    for skeleton in skeletons:
        # the skeleton's tables cover this recording
        if skeleton.reader.part.made_without in ("", recording.recording.task):
            yield from score_skeleton(recording, skeleton)
    digits = recording.layout.digits.values()
    yield from (distal_receiver_row(recording, digit) for digit in digits)
    yield from (row for digit in digits if (row := true_skeleton_row(recording, digit)) is not None)
