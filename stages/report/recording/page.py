"""The page of one recording: gathers the view, the plots' data, charts and tables for the template."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.study import Recording
from stages.report.data_table import DataTable, counted, number
from stages.report.error_chart import error_chart, error_scale
from stages.report.figures import Figure
from stages.report.recording.angles import ANGLES, JointAngles, angle_blocks, angle_ranges
from stages.report.recording.joint_charts import range_chart, singular_value_chart
from stages.report.recording.navigation import navigation
from stages.report.recording.reading import ModelResults, RecordingResults, angles_of
from stages.report.recording.tables import evidence_table, range_table, tip_error_table
from stages.report.templates import render
from stages.report.tip_traces import Trace, thin
from stages.report.viewer.motion import Array, HandMotion
from stages.report.viewer.page import View, view_of

SENSES = {
    "flexion": "flexion is positive, extension negative",
    "abduction": "ulnar deviation is positive, radial deviation negative",
    "rotation": "pronation is positive, supination negative",
}
"""What the sign of each angle says, in words (docs/joint-angles.md)."""


@dataclass(frozen=True)
class RangePart:
    """The range of motion under one model: a chart an angle, and the numbers."""

    model: str
    figures: list[Figure]
    table: DataTable


@dataclass(frozen=True)
class EvidencePart:
    """What the calibration says of the joints under one model; chart is None where nothing was solved."""

    summary: str
    chart: Figure | None
    table: DataTable


def recording_page(results: RecordingResults) -> str:
    """Give the recording's page; the same results give the same text."""
    title, motion, angles = recording_title(results.recording), results.motion, angles_of(results.models)
    return render(
        "recording/page.html.j2",
        title=title,
        study=results.study.name,
        facts=_facts(results),
        said=results.row["message"] if motion is not None else "",
        trouble=results.trouble,
        left_out=results.left_out,
        to=navigation(results.study, results.paths, results.recording),
        view=None if motion is None else _view(title, motion, angles),
        every=1 if motion is None else motion.every,
        stills=[] if motion is None else _error_charts(title, motion),
        angles=angles,
        tip_errors=tip_error_table(f"Tip error of the replay in numbers: {title}.", results.models),
        ranges=[_range_part(title, model) for model in results.models if model.angles is not None],
        evidence=[_evidence_part(title, model) for model in results.models],
    )


def failure_page(title: str, message: str) -> str:
    """Give a page that says only why there is none of the recording."""
    return render("recording/failure.html.j2", title=title, message=message)


def recording_title(recording: Recording) -> str:
    """Subject, hand, task and trial in words."""
    trial = f", trial {recording.trial}" if recording.trial else ""
    return f"Subject {recording.hand.subject}, {recording.hand.hand} hand, {recording.task}{trial}"


def _facts(results: RecordingResults) -> str:
    row = results.row
    facts = [counted(row["n_frames"], "frame")] if row["n_frames"] else []
    facts += [f"{number(row['duration_s'])} s"] if row.get("duration_s") is not None else []
    valid = row.get("valid_percent")
    facts += [f"{number(valid, 1)} % of the poses may be used"] if valid is not None else []
    return ", ".join(facts)


def _view(title: str, motion: HandMotion, angles: list[JointAngles]) -> View:
    """The moving hand with the joint angles packed beside it."""
    header = {"angles": [{"model": own.model, "joints": own.joints} for own in angles]}
    return view_of(title, motion, angle_blocks(angles, motion.frame), header)


def _error_charts(title: str, motion: HandMotion) -> list[Figure]:
    """Tip error over time as still pictures, one a model, all on one scale."""
    traces = [_traces(motion, skeleton.tip_error_mm) for skeleton in motion.skeletons]
    scale = error_scale(trace for own in traces for trace in own.values())
    return [
        Figure(
            f"{skeleton.model}: {skeleton.error_is}",
            error_chart(f"Tip error over time, {title}, {skeleton.model}", motion.digits, own, scale),
        )
        for skeleton, own in zip(motion.skeletons, traces, strict=True)
    ]


def _traces(motion: HandMotion, tip_error_mm: Array) -> dict[str, Trace]:
    frame = motion.frame.astype(float)
    made = (thin(frame, motion.time_s, tip_error_mm[:, index]) for index in range(len(motion.digits)))
    return {digit: trace for digit, trace in zip(motion.digits, made, strict=True) if trace is not None}


def _range_part(title: str, model: ModelResults) -> RangePart:
    assert model.angles is not None
    ranges, joints = angle_ranges(model.angles), model.angles.joints
    figures = [
        Figure(
            f"{angle.capitalize()}: {SENSES[angle]}",
            range_chart(
                f"Range of {angle} by joint, {title}, {model.name}",
                joints,
                [own for own in ranges if own.angle == angle],
            ),
        )
        for angle in ANGLES
    ]
    table = range_table(f"Range of motion in this recording, {model.name}.", ranges, model.joints)
    return RangePart(model.name, figures, table)


def _evidence_part(title: str, model: ModelResults) -> EvidencePart:
    solved = [row for row in model.solutions if row["singular_values"] is not None]
    chart = None
    if solved:
        chart = Figure(
            "Singular values of each joint’s system: open circles the first three, filled ones the fourth "
            "and fifth, diamonds the sixth",
            singular_value_chart(
                f"Singular values by joint, {title}, {model.name}",
                [row["joint"] for row in solved],
                [row["singular_values"] for row in solved],
            ),
        )
    doubtful = sum(row["status"] != "ok" for row in model.joints)
    summary = f"{model.name}: {counted(len(model.joints), 'joint')}, {doubtful or 'none'} of them doubtful"
    return EvidencePart(
        summary, chart, evidence_table(f"What the calibration says of each joint, {model.name}.", model)
    )
