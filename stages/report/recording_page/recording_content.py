"""The page of one recording: gathers the view, the plots' data, charts and tables for the template."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schemas.study import Recording
from skeleton.angle_range import HIGH_PERCENT, LOW_PERCENT
from stages.report.belief import belief
from stages.report.hand_motion import Array, HandMotion
from stages.report.links import navigation
from stages.report.measured_ranges import measured_ranges, measured_table, of_recording
from stages.report.palette import MARK_PATHS, model_looks
from stages.report.pictures.joint_rows import Range, range_picture, singular_value_picture
from stages.report.pictures.tip_error_strips import hidden_lines, thinned_traces, tip_error_picture
from stages.report.recording_results import ANGLES, JointAngles, ModelResults, RecordingResults, angles_of
from stages.report.skeleton_stills import Figure
from stages.report.study_results import Row
from stages.report.table_cells import (
    Column,
    DataTable,
    capital,
    counted,
    number,
    number_column,
    table_of,
    text_column,
)
from stages.report.templates import render
from stages.report.trust import believed_counts
from stages.report.viewer.packed_motion import Block
from stages.report.viewer.view import View, view_of
from stages.report.wording import mark, say, told, word

ANGLE_STEP_DEG = 0.1
"""As the page prints angles: rounded to it once, they show the table's own digits."""
PERCENTILES = (0, LOW_PERCENT, 50, HIGH_PERCENT, 100)
SENSES = {
    "flexion": mark("flexion is positive, extension negative"),
    "abduction": mark("ulnar deviation is positive, radial deviation negative"),
    "rotation": mark("pronation is positive, supination negative"),
}
"""What the sign of each angle says, in words (docs/joint-angles.md)."""


def recording_page(results: RecordingResults) -> str:
    """Give the recording's page; the same results give the same text."""
    title, motion, angles = recording_title(results.recording), results.motion, angles_of(results.models)
    return render(
        "recording_page/page.html.j2",
        title=title,
        study=results.study.name,
        facts=_facts(results),
        said=told(results.row["message"]) if motion is not None else "",
        trouble=told(results.trouble),
        left_out={model: told(reason) for model, reason in results.left_out.items()},
        to=navigation(results.study, results.recording),
        view=None if motion is None else _view(title, motion, angles),
        every=1 if motion is None else motion.every,
        still=None if motion is None else _tip_error_still(title, list(results.study.models), motion),
        posed=None if motion is None else _posed_still(title, list(results.study.models), motion),
        angles=angles,
        marks=list(MARK_PATHS.values()),
        tip_errors=tip_error_table(
            say("Tip error of the replay in numbers: {title}.", title=title), results.models
        ),
        ranges=[_range_part(results, title, model) for model in results.models if model.angles is not None],
        evidence=[_evidence_part(title, model) for model in results.models],
    )


def failure_page(title: str, message: str) -> str:
    """Give a page that says only why there is none of the recording."""
    return render(
        "failure.html.j2", title=title, message=say("This recording has no page: {message}", message=message)
    )


def recording_title(recording: Recording) -> str:
    """Subject, hand, task and trial in words."""
    trial = say(", trial {trial}", trial=recording.trial) if recording.trial else ""
    return capital(say("{hand}, {task}{trial}", hand=recording.hand, task=recording.task, trial=trial))


def _facts(results: RecordingResults) -> str:
    row = results.row
    facts = [counted(row["n_frames"], "frame")] if row["n_frames"] else []
    facts += (
        [say("{duration_s} s", duration_s=number(row["duration_s"]))]
        if row.get("duration_s") is not None
        else []
    )
    valid = row.get("valid_percent")
    facts += [say("{valid} % of the poses may be used", valid=number(valid, 1))] if valid is not None else []
    return ", ".join(facts)


def _view(title: str, motion: HandMotion, angles: list[JointAngles]) -> View:
    """The moving hand with the joint angles packed beside it."""
    header = {
        "angles": [{"model": own.model, "joints": [word(joint) for joint in own.joints]} for own in angles]
    }
    return view_of(title, motion, angle_blocks(angles, motion.every), header)


def _tip_error_still(title: str, study_models: Sequence[str], motion: HandMotion) -> Figure:
    """Tip error of the replay over time as a still picture."""
    of_model = {own.model: own.tip_error_mm for own in motion.skeletons}
    caption = say("From the replayed fingertip to its receiver, least-squares binding")
    return _still(say("Tip error over time, {title}", title=title), caption, study_models, motion, of_model)


def _posed_still(title: str, study_models: Sequence[str], motion: HandMotion) -> Figure | None:
    """How far posed hands miss the distal receivers over time; None without a fitted hand."""
    of_model = {s.model: s.posed_error_mm for s in motion.skeletons if s.posed_error_mm is not None}
    caption = say("From where the hand posed with all receivers puts the distal receiver to where it is")
    name = say("Posed hand and distal receivers over time, {title}", title=title)
    return _still(name, caption, study_models, motion, of_model) if of_model else None


def _still(
    name: str, caption: str, study_models: Sequence[str], motion: HandMotion, of_model: Mapping[str, Array]
) -> Figure:
    """Errors (T, D) by model over time as a still picture: a strip a digit, a line a model."""
    errors = {
        digit: {model: values[:, index] for model, values in of_model.items()}
        for index, digit in enumerate(motion.digits)
    }
    traces = thinned_traces(motion.frame, motion.time_s, errors)
    hidden = hidden_lines(traces, list(of_model))
    return Figure(
        say("{caption}. Of every stretch of time the largest error", caption=caption),
        tip_error_picture(name, traces, model_looks(study_models)),
        (hidden,) if hidden else (),
    )


def _range_part(results: RecordingResults, title: str, model: ModelResults) -> dict[str, Any]:
    """The range of motion under one model: a chart an angle, and the numbers."""
    assert model.angles is not None
    ranges, joints = angle_ranges(model.angles), model.angles.joints
    figures = [
        Figure(
            f"{capital(word(angle))}: {say(SENSES[angle])}",
            range_picture(
                say("Range of {angle} by joint, {title}, {name}", angle=angle, title=title, name=model.name),
                joints,
                {own.joint: own.at_deg for own in ranges if own.angle == angle},
            ),
        )
        for angle in ANGLES
    ]
    table = range_table(
        say("Range of motion in this recording, {name}.", name=model.name), ranges, model.joints
    )
    rows = of_recording(measured_ranges(results.study, results.recording.hand, model.name), results.recording)
    caption = say("Range of motion, posture and speed with stated 1-sigma errors, {name}.", name=model.name)
    measured = measured_table(caption, rows, with_recording=False) if rows else None
    return {"model": model.name, "figures": figures, "table": table, "measured": measured}


def _evidence_part(title: str, model: ModelResults) -> dict[str, Any]:
    """What the calibration says under one model; the chart is None where nothing was solved."""
    solved = [row for row in model.solutions if row["singular_values"] is not None]
    chart = None
    if solved:
        chart = Figure(
            say(
                "Singular values of each joint’s system: open circles the first three, filled ones the "
                "fourth and fifth, diamonds the sixth"
            ),
            singular_value_picture(
                say("Singular values by joint, {title}, {name}", title=title, name=model.name),
                [row["joint"] for row in solved],
                [row["singular_values"] for row in solved],
            ),
        )
    summary = f"{model.name}: {counted(len(model.joints), 'joint')}; {believed_counts(model.joints)}"
    table = evidence_table(say("What the calibration says of each joint, {name}.", name=model.name), model)
    return {"summary": summary, "chart": chart, "table": table}


@dataclass(frozen=True)
class AngleRange:
    """How far one angle of a joint went, degrees at PERCENTILES, and in how many frames it is known."""

    joint: str
    angle: str
    at_deg: Range
    n_frames: int


def angle_ranges(angles: JointAngles) -> list[AngleRange]:
    """The range of every angle of every joint; one that is never known has none."""
    ranges = []
    for j, joint in enumerate(angles.joints):
        for a, angle in enumerate(ANGLES):
            values = angles.angle_deg[:, j, a]
            known = values[np.isfinite(values)]
            if len(known):
                least, first, median, last, most = np.percentile(known, PERCENTILES).tolist()
                ranges.append(AngleRange(joint, angle, (least, first, median, last, most), len(known)))
    return ranges


def angle_blocks(angles: Sequence[JointAngles], every: int) -> list[Block]:
    """One frame in `every`, packed with the motion as blocks angles0, angles1, ..., (T, J, 3)."""
    return [Block(f"angles{i}", ANGLE_STEP_DEG, own.angle_deg[::every]) for i, own in enumerate(angles)]


def tip_error_table(caption: str, models: Iterable[ModelResults]) -> DataTable:
    """The recording's rows of tip_errors, mm: the replay under every model, both bindings."""
    return table_of(caption, _TIP_ERROR_COLUMNS, [row for model in models for row in model.tip_errors])


def range_table(caption: str, ranges: Iterable[AngleRange], joints: Iterable[Row]) -> DataTable:
    """Percentiles of every angle, degrees; beside them the range about the joint's axis in calibration."""
    calibrated = {row["joint"]: row["range_deg"] for row in joints}
    columns = (
        Column(say("Joint"), lambda own: own.joint, is_text=True),
        Column(say("Angle"), lambda own: word(own.angle), is_text=True),
        Column(say("Min [deg]"), lambda own: number(own.at_deg[0], 1)),
        Column(say("2.5 % [deg]"), lambda own: number(own.at_deg[1], 1)),
        Column(say("Median [deg]"), lambda own: number(own.at_deg[2], 1)),
        Column(say("97.5 % [deg]"), lambda own: number(own.at_deg[3], 1)),
        Column(say("Max [deg]"), lambda own: number(own.at_deg[4], 1)),
        Column(say("2.5 to 97.5 % [deg]"), lambda own: number(own.at_deg[3] - own.at_deg[1], 1)),
        Column(say("Frames"), lambda own: str(own.n_frames)),
        Column(
            say("Calibration, about the joint’s axis [deg]"), lambda own: number(calibrated.get(own.joint), 1)
        ),
    )
    return table_of(caption, columns, ranges)


def evidence_table(caption: str, model: ModelResults) -> DataTable:
    """What the calibration says of each joint: its gap, its error and its system's singular values."""
    values_of = {row["joint"]: row["singular_values"] or [None] * 6 for row in model.solutions}
    singular = [say("Singular value {n}", n=n) for n in range(1, 7)]
    nothing = dict.fromkeys(singular)
    rows = [
        nothing | row | dict(zip(singular, values_of.get(row["joint"], []), strict=False))
        for row in model.joints
    ]
    columns = (
        text_column(say("Joint"), "joint"),
        Column(say("Believe it?"), lambda row: say(belief(row)), is_text=True),
        number_column(say("Gap rms [mm]"), "gap_rms_mm"),
        number_column(say("Free gap rms [mm]"), "gap_rms_free_mm"),
        number_column(say("SD of the centre [mm]"), "sd_mm"),
        number_column(say("Frames"), "n_frames", 0),
        number_column(say("Independent samples"), "n_effective", 1),
        *(number_column(heading, heading, 4) for heading in singular),
        text_column(say("Message"), "message"),
    )
    return table_of(caption, columns, rows)


_TIP_ERROR_COLUMNS = (
    text_column(mark("Model"), "model"),
    text_column(mark("Digit"), "digit"),
    text_column(mark("Binding"), "binding"),
    number_column(mark("Mean [mm]"), "mean_mm"),
    number_column(mark("SD [mm]"), "sd_mm"),
    number_column(mark("Median [mm]"), "median_mm"),
    number_column(mark("95 % [mm]"), "p95_mm"),
    number_column(mark("Max [mm]"), "max_mm"),
    number_column(mark("Min [mm]"), "min_mm"),
    number_column(mark("Frames"), "n_frames", 0),
    number_column(mark("Of"), "n_frames_total", 0),
    Column(
        mark("Held out"), lambda row: say("held out") if row["held_out"] else say("○ in-sample"), is_text=True
    ),
    text_column(mark("Message"), "message"),
)
