"""Input of the pages and print figures of one recording: its motion, errors and angles under each model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.hand.known_digits import root_of
from shukotsu.hand.posed_recording import RecordingReader
from shukotsu.hand.posing import Skeleton
from shukotsu.report import hand_motion
from shukotsu.report.hand_motion import MOST_FRAMES, HandMotion, ShownSkeleton
from shukotsu.report.study_results import StudyResults, recording_key, row_key
from shukotsu.study.model import paper_skeleton
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import JOINT_ANGLES, JOINT_CENTRES, JOINT_SOLUTIONS, TIPS
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.poses import Poses
from shukotsu.translation import N_

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow, JointSolutionsRow, RecordingsRow, TipErrorsRow

ANGLES = ("flexion", "abduction", "rotation")
ANGLE_COLUMNS = [f"{angle}_{what}" for what in ("deg", "sd_deg") for angle in ANGLES]
"""Columns of joint_angles: the angles, then their 1-sigma errors."""


@dataclass(frozen=True)
class JointAngles:
    """Angles of J joints under one model in the T displayed frames.

    angle_deg : (T, J, 3), in the order of ANGLES. sd_deg : (T, J, 3), their 1-sigma errors, NaN if not
    stated.
    """

    model: str
    joints: tuple[str, ...]
    angle_deg: Array
    sd_deg: Array


@dataclass(frozen=True)
class ModelResults:
    """Results of one model for a recording.

    joints, solutions : the hand's rows of joint_centres and joint_solutions. tip_errors : the recording's
    rows. angles : None unless the model fits the whole hand.
    """

    name: str
    joints: list[JointCentresRow]
    solutions: list[JointSolutionsRow]
    tip_errors: list[TipErrorsRow]
    angles: JointAngles | None


@dataclass(frozen=True)
class RecordingResults:
    """Results of one recording of a study.

    row : its row of the recordings table. models : models with results, in the study's order. left_out : the
    other models and why. motion : None if nothing can be shown. trouble : the reason for that, or empty.
    """

    study: StudyResults
    recording: Recording
    row: RecordingsRow
    models: list[ModelResults]
    left_out: dict[str, str]
    motion: HandMotion | None
    trouble: str


def read_recording(results: StudyResults, recording: Recording) -> RecordingResults:
    """Read the results of a recording, with its motion thinned to MOST_FRAMES.

    A model whose tables are missing, unreadable, empty or failed is left out with the reason. If the poses
    are missing or unreadable, the motion is left out with the reason.
    """
    row = results.recording_row_of[recording_key(recording)]
    models: list[ModelResults] = []
    skeletons: list[ShownSkeleton] = []
    left_out: dict[str, str] = {}
    trouble, motion, poses, every = N_("no model of the study has results of this hand"), None, None, 1
    readers = [reader_of(results, recording, model) for model in results.models]
    try:
        every = _thinning(readers[0])
        poses = readers[0].poses(every)
    except InputError as error:
        trouble = error.message
    for reader in readers:
        try:
            model = _model_results(results, reader, poses)
            if poses is not None:
                skeletons.append(_skeleton(results, reader, poses))
            models.append(model)
        except InputError as error:
            left_out[reader.model.name] = error.message
    if row["status"] == "failed":
        trouble = row["message"]
    elif skeletons and poses is not None:
        paper = paper_skeleton(results.models[skeleton.model] for skeleton in skeletons)
        layout = results.layouts[recording.hand]
        try:
            motion = hand_motion.hand_motion(recording.hand.hand, layout, poses, skeletons, paper, every)
            trouble = ""
        except InputError as error:
            trouble = error.message
    return RecordingResults(results, recording, row, models, left_out, motion, trouble)


def _thinning(reader: RecordingReader) -> int:
    """Return n for which every n-th frame of the recording makes at most MOST_FRAMES."""
    return max(1, -(-reader.n_frames // MOST_FRAMES))


def read_still(results: StudyResults, recording: Recording, model: str) -> HandMotion:
    """Read the hand under a model in the frame that a still picture shows.

    Raises InputError if the recording has no frame to show.
    """
    layout, path = results.layouts[recording.hand], results.poses(recording)
    name = path.relative_to(results.paths.folder).as_posix()
    reader = reader_of(results, recording, model)
    try:
        shown = hand_motion.open_frame(reader.pose_blocks(), layout)
    except InputError as error:
        raise InputError(str(error).replace(str(path), name).rstrip(".")) from error
    if shown is None:
        raise InputError(f"{name} has no frame with a valid base receiver")
    return hand_motion.hand_motion(
        recording.hand.hand, layout, shown, [_skeleton(results, reader, shown, still=True)]
    )


STRETCH_S, STRETCH_HZ = 6.0, 30.0
"""Duration and frame rate of the hand in motion on the study's page."""


def read_stretch(results: StudyResults, recording: Recording, model: str) -> HandMotion:
    """Read the hand under one model during the STRETCH_S of the recording in which its fingertips move most.

    Raises InputError if the recording or the model has nothing to show.
    """
    reader, layout = reader_of(results, recording, model), results.layouts[recording.hand]
    poses = reader.poses(_thinning(reader))
    seconds = np.nanmedian(np.diff(poses.time_s)) if len(poses.time_s) > 1 else np.nan
    step = max(1, round(1.0 / (STRETCH_HZ * seconds))) if seconds > 0 else 8
    poses = poses.take(slice(0, None, step))
    tips = poses.position_mm[:, [poses.index(digit.tip) for digit in layout.digits.values()]]
    apart = tips - poses.position_mm[:, [poses.index(root_of(layout))]]
    moved = np.nan_to_num(np.linalg.norm(np.diff(apart, axis=0), axis=-1)).sum(1)
    length = min(len(poses.frame), round(STRETCH_S * STRETCH_HZ))
    start = int(np.argmax(np.convolve(moved, np.ones(max(1, length - 1)), "valid"))) if len(moved) else 0
    begins_s = np.nan_to_num(poses.time_s[start] - poses.time_s[0])
    poses = poses.take(slice(start, start + length))
    motion = hand_motion.hand_motion(
        recording.hand.hand, layout, poses, [_skeleton(results, reader, poses)], every=step
    )
    return replace(motion, begins_s=float(begins_s))


def reader_of(results: StudyResults, recording: Recording, model: str) -> RecordingReader:
    """Return the reader of a recording under one of the study's models."""
    hand = recording.hand
    return RecordingReader(
        recording,
        results.layouts[hand],
        results.models[model],
        Part(hand.hand, model, "", *hand.who),
        results.poses(recording),
        lambda name: results.subject_table(hand, name, model),
        results.opened,
    )


def _model_results(results: StudyResults, reader: RecordingReader, poses: Poses | None) -> ModelResults:
    name, part, key = reader.model.name, reader.part, recording_key(reader.recording)
    joints = results.joints_of.get((reader.recording.hand, name), [])
    if not joints:
        read_part(reader.tables(JOINT_CENTRES.name), JOINT_CENTRES, part, ["joint"])
        raise InputError(N_("the joint_centres table has no row"))
    with reader.opened(reader.tables(JOINT_SOLUTIONS.name), JOINT_SOLUTIONS) as parts:
        solutions = parts.part(part, ["joint", "singular_values"]).to_pylist()
    errors = [row for row in results.rows.tip_errors if (row_key(row), row["model"]) == (key, name)]
    angles = None
    if reader.is_fitted and poses is not None:
        shown = reader.numbers_at(JOINT_ANGLES, ANGLE_COLUMNS, poses.frame)
        angles = JointAngles(name, tuple(shown), *np.split(np.stack(list(shown.values()), 1), 2, axis=2))
    return ModelResults(name, joints, solutions, errors, angles)


def _skeleton(
    results: StudyResults, reader: RecordingReader, poses: Poses, *, still: bool = False
) -> ShownSkeleton:
    """Return one model's skeleton in the frames of `poses`; a still picture has no tip errors."""
    key = reader.recording.hand, reader.model.name
    joints = {row["joint"]: row for row in results.joints_of.get(key, [])}
    hand = Skeleton(reader.layout, reader.model, joints, {})
    if reader.is_fitted:
        worn = {row["segment"]: row for row in results.receivers_of.get(key, [])}
        shown = hand_motion.fitted_skeleton(hand, worn, reader.bones(poses, hand))
    else:
        shown = hand_motion.receiver_skeleton(hand, poses)
    errors: dict[str, Array] = {}
    if not still and reader.recording.role != "calibration":
        try:
            errors = reader.numbers_at(TIPS, ["error_mm"], poses.frame)
        except InputError:
            if not reader.is_fitted:
                raise  # a fitted hand can be shown without a replay
    nothing = np.full((len(poses.frame), 1), np.nan)
    replayed = np.concatenate([errors.get(digit, nothing) for digit in hand.layout.digits], 1)
    return replace(shown, model_index=list(results.models).index(hand.model.name), tip_error_mm=replayed)
