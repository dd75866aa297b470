"""What a page or a print figure of one recording is made from: its motion, errors and angles under each
model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from schemas.catalogue import BONE_POSES, JOINT_ANGLES, JOINT_CENTRES, JOINT_SOLUTIONS, POSED_TIPS, TIPS
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.model import the_papers
from schemas.parts import Part, read_part
from schemas.parts import read_recording as read_frames
from schemas.poses import Poses, read_poses
from schemas.study import Recording
from schemas.tables import Table
from skeleton.posing import Motion
from stages.report.hand_motion import (
    HandMotion,
    SkeletonMotion,
    fitted_skeleton,
    hand_motion,
    open_frame,
    ridden_skeleton,
    view_base,
)
from stages.report.study_results import Row, StudyResults, recording_key, row_key

Array = npt.NDArray[np.float64]

ANGLES = ("flexion", "abduction", "rotation")
_BONE_POSE = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
_TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")


@dataclass(frozen=True)
class JointAngles:
    """Angles under one model at T frames: joints (J,) names, angle_deg (T, J, 3) as ANGLES."""

    model: str
    joints: tuple[str, ...]
    angle_deg: Array


@dataclass(frozen=True)
class ModelResults:
    """What one model says of the hand and the recording; angles is None unless it fits the whole hand.

    joints, solutions : rows of joint_centres and joint_solutions. tip_errors : this recording's rows.
    """

    name: str
    joints: list[Row]
    solutions: list[Row]
    tip_errors: list[Row]
    angles: JointAngles | None


@dataclass(frozen=True)
class RecordingResults:
    """One recording of a study; row is what the recordings table says of it.

    models : those with results, in the study's order. left_out : the others and why. motion : None where
    nothing can be shown; trouble then says why and is else empty.
    """

    study: StudyResults
    recording: Recording
    row: Row
    models: tuple[ModelResults, ...]
    left_out: dict[str, str]
    motion: HandMotion | None
    trouble: str


def read_recording(results: StudyResults, recording: Recording) -> RecordingResults:
    """Read what belongs to the recording.

    A model whose tables are absent, not to be read, empty or the record of a failure is left out with the
    reason; so is all motion where the poses are.
    """
    row = results.recording_row_of.get(recording_key(recording), {"status": "missing", "message": ""})
    layout = results.layouts[recording.hand]
    found: dict[str, ModelResults] = {}
    skeletons: list[SkeletonMotion] = []
    left_out: dict[str, str] = {}
    trouble, motion, poses = "no model of the study has results of this hand", None, None
    try:
        poses = read_poses(results.poses(recording), layout.measured)
    except InputError as error:
        trouble = str(error)
    for name in results.models:
        try:
            found[name] = _model_results(results, recording, name, poses)
            if poses is not None:
                skeletons.append(_skeleton(results, recording, name, layout, poses))
        except InputError as error:
            left_out[name] = str(error)
            found.pop(name, None)
    if row["status"] == "failed":
        trouble = row["message"]
    elif skeletons and poses is not None:
        paper = the_papers(results.models[skeleton.model] for skeleton in skeletons)
        try:
            motion, trouble = hand_motion(recording.hand.hand, layout, poses, skeletons, paper), ""
        except InputError as error:
            trouble = str(error)
    return RecordingResults(results, recording, row, tuple(found.values()), left_out, motion, trouble)


def read_still(results: StudyResults, recording: Recording, models: Collection[str]) -> HandMotion:
    """The hand in the one frame that a still picture shows, under each of the models.

    Raises InputError where the recording has no frame to show.
    """
    layout, path = results.layouts[recording.hand], results.poses(recording)
    place = path.relative_to(results.paths.folder).as_posix()
    try:
        poses = read_poses(path, layout.measured)
    except InputError as error:
        raise InputError(str(error).replace(str(path), place).rstrip(".")) from error
    if not poses.valid[:, poses.index(view_base(layout))].any():
        raise InputError(f"{place} has no frame with a valid base receiver")
    tips, base = [poses.index(d.tip) for d in layout.digits.values()], poses.index(view_base(layout))
    index = open_frame(poses.valid, base, poses.position_mm[:, tips], poses.position_mm[:, base])
    skeletons = [
        _skeleton(results, recording, name, layout, poses, slice(index, index + 1)) for name in models
    ]
    return hand_motion(recording.hand.hand, layout, poses.take(slice(index, index + 1)), skeletons)


def read_angles(
    results: StudyResults, recording: Recording, model: str, poses: Poses | None = None
) -> JointAngles:
    """The recording's joint angles under a model that fits the whole hand; InputError where it has none."""
    of_joint = _frames(results, recording, JOINT_ANGLES, model, [f"{angle}_deg" for angle in ANGLES], poses)
    return JointAngles(model, tuple(of_joint), np.stack(list(of_joint.values()), 1))


def read_tip_errors(results: StudyResults, recording: Recording, model: str) -> dict[str, Array]:
    """The replay's tip error (T,) by digit, mm, NaN in gaps. Raises InputError where there is none."""
    found = _frames(results, recording, TIPS, model, ["error_mm"])
    return {digit: errors[:, 0] for digit, errors in found.items()}


def angles_of(models: Iterable[ModelResults]) -> list[JointAngles]:
    """The joint angles of those models that state any, in their order."""
    return [model.angles for model in models if model.angles is not None]


def _model_results(
    results: StudyResults, recording: Recording, name: str, poses: Poses | None
) -> ModelResults:
    hand = recording.hand
    part = Part(hand.hand, name, "", *hand.who)
    joints = results.joints_of.get((hand, name), [])
    if not joints:
        read_part(results.subject_table(hand, JOINT_CENTRES.name), JOINT_CENTRES, part, ["joint"])
        raise InputError("the joint_centres table has no row")
    solutions = read_part(
        results.subject_table(hand, JOINT_SOLUTIONS.name),
        JOINT_SOLUTIONS,
        part,
        ["joint", "singular_values"],
    ).to_pylist()
    errors = [
        row for row in results.tip_errors if row_key(row) == recording_key(recording) and row["model"] == name
    ]
    angles = None
    if results.models[name].fitting is not None:
        angles = read_angles(results, recording, name, poses)
    return ModelResults(name, joints, solutions, errors, angles)


def _skeleton(
    results: StudyResults,
    recording: Recording,
    name: str,
    layout: Layout,
    poses: Poses,
    still: slice | None = None,
) -> SkeletonMotion:
    """One model's motion, or of a still picture that one frame without tip errors.

    A fitted hand that was not posed in a recording that only calibrates is shown as its receivers carry it.
    """
    rows = results.joints_of.get((recording.hand, name), [])
    model, joints = results.models[name], {row["joint"]: row for row in rows}
    place, shown = list(results.models).index(name), poses if still is None else poses.take(still)
    errors: dict[str, Array] = {}
    if still is None:
        try:
            errors = _frames(results, recording, TIPS, name, ["error_mm"], poses)
        except InputError:
            if model.fitting is None:
                raise  # a fitted hand is posed, and shown, without a replay too
    if model.fitting is None:
        return ridden_skeleton(layout, model, place, joints, _by_digit(layout, errors, shown), shown)
    try:
        bones = _frames(results, recording, BONE_POSES, name, _BONE_POSE, poses)
        ends = _frames(results, recording, POSED_TIPS, name, [*_TIP, "error_mm"], poses)
    except InputError:
        if still is None:
            raise
        return ridden_skeleton(layout, model, place, joints, _by_digit(layout, {}, shown), shown)
    kept = still or slice(None)
    posed = Motion(
        bone_poses={segment: pose[kept] for segment, pose in bones.items()},
        tips={digit: end[kept, :3] for digit, end in ends.items()},
    )
    worn = {row["segment"]: row for row in results.receivers_of.get((recording.hand, name), [])}
    missed = {digit: end[kept, 3:] for digit, end in ends.items()}
    replayed, missed_mm = _by_digit(layout, errors, shown), _by_digit(layout, missed, shown)
    return fitted_skeleton(layout, model, place, joints, worn, posed, replayed, missed_mm, shown)


def _frames(
    results: StudyResults,
    recording: Recording,
    table: Table,
    model: str,
    columns: Sequence[str],
    poses: Poses | None = None,
) -> dict[str, Array]:
    """Numbers (T, C) of one recording by segment, digit or joint; InputError where there is no row of it."""
    hand = recording.hand
    subject_wide = results.subject_table(hand, table.name)
    path = subject_wide if table is TIPS else results.fit_table(hand, model, table.name)
    by = next(name for name in ("segment", "joint", "digit") if name in table.key)
    count = None if poses is None else len(poses.frame)
    part = Part(hand.hand, model, "", *hand.who)
    found = read_frames(path, table, part, recording.task, recording.trial, by, columns, count)
    if not found:
        raise InputError(f"the {table.name} table has no row of this recording")
    return found


def _by_digit(layout: Layout, errors: Mapping[str, Array], poses: Poses) -> Array:
    """Columns (T, D) of numbers (T, 1) by digit, NaN for a digit without."""
    nothing = np.full((len(poses.frame), 1), np.nan)
    return np.concatenate([errors.get(digit, nothing) for digit in layout.digits], 1)
