"""The page of one recording: gathers the view, the plots' data, charts and tables for the template."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import N_, ngettext, tr, translated, word
from shukotsu.stages.report.belief import belief
from shukotsu.stages.report.hand_motion import HandMotion
from shukotsu.stages.report.links import navigation
from shukotsu.stages.report.measured_ranges import measured_ranges, measured_table, of_recording
from shukotsu.stages.report.palette import MARK_PATHS
from shukotsu.stages.report.recording_results import (
    AngleRange,
    JointAngles,
    ModelResults,
    RecordingResults,
    angles_of,
)
from shukotsu.stages.report.study_results import Row
from shukotsu.stages.report.table_cells import (
    Column,
    DataTable,
    capital,
    number,
    number_column,
    table_of,
    text_column,
)
from shukotsu.stages.report.templates import render
from shukotsu.stages.report.trust import believed_counts
from shukotsu.stages.report.viewer.packed_motion import Block
from shukotsu.stages.report.viewer.view import View, view_of

ANGLE_STEP_DEG = 0.1
"""As the page prints angles: rounded to it once, they show the table's own digits."""
SENSES = {
    "flexion": N_("flexion is positive, extension negative"),
    "abduction": N_("ulnar deviation is positive, radial deviation negative"),
    "rotation": N_("pronation is positive, supination negative"),
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
        said=translated(results.row["message"]) if motion is not None else "",
        trouble=translated(results.trouble),
        left_out={model: translated(reason) for model, reason in results.left_out.items()},
        to=navigation(results.study, results.recording),
        view=None if motion is None else _view(title, motion, angles),
        every=1 if motion is None else motion.every,
        posed=motion is not None and any(own.posed_error_mm is not None for own in motion.skeletons),
        angles=angles,
        marks=list(MARK_PATHS.values()),
        tip_errors=tip_error_table(
            tr("Tip error of the replay in numbers: {title}.", title=title), results.models
        ),
        senses=[(capital(word(angle)), tr(sense)) for angle, sense in SENSES.items()],
        ranges=[_range_part(results, model) for model in results.models if model.angles is not None],
        evidence=[_evidence_part(model) for model in results.models],
    )


def failure_page(title: str, message: str) -> str:
    """Give a page that says only why there is none of the recording."""
    return render(
        "failure.html.j2",
        title=title,
        message=tr("This recording has no page: {message}", message=translated(message)),
    )


def recording_title(recording: Recording) -> str:
    """Subject, hand, task and trial in words."""
    trial = tr(", trial {trial}", trial=recording.trial) if recording.trial else ""
    return capital(tr("{hand}, {task}{trial}", hand=recording.hand, task=recording.task, trial=trial))


def _facts(results: RecordingResults) -> str:
    row = results.row
    facts = [ngettext("{n} frame", "{n} frames", row["n_frames"])] if row["n_frames"] else []
    facts += (
        [tr("{duration_s} s", duration_s=number(row["duration_s"]))]
        if row.get("duration_s") is not None
        else []
    )
    valid = row.get("valid_percent")
    facts += [tr("{valid} % of the poses may be used", valid=number(valid, 1))] if valid is not None else []
    return ", ".join(facts)


def _view(title: str, motion: HandMotion, angles: list[JointAngles]) -> View:
    """The moving hand with the joint angles packed beside it."""
    header = {
        "angles": [{"model": own.model, "joints": [word(joint) for joint in own.joints]} for own in angles]
    }
    return view_of(title, motion, angle_blocks(angles), header)


def _range_part(results: RecordingResults, model: ModelResults) -> dict[str, Any]:
    """Give the range of motion under one model, in numbers."""
    assert model.angles is not None
    caption = tr("Range of motion in this recording, {name}.", name=model.name)
    table = range_table(caption, model.angles.ranges, model.joints)
    rows = of_recording(measured_ranges(results.study, results.recording.hand, model.name), results.recording)
    caption = tr("Range of motion, posture and speed with stated 1-sigma errors, {name}.", name=model.name)
    measured = measured_table(caption, rows, with_recording=False) if rows else None
    return {"model": model.name, "table": table, "measured": measured}


def _evidence_part(model: ModelResults) -> dict[str, Any]:
    """Show the calibration's evidence under one model."""
    joints = ngettext("{n} joint", "{n} joints", len(model.joints))
    summary = f"{model.name}: {joints}; {believed_counts(model.joints)}"
    table = evidence_table(tr("What the calibration says of each joint, {name}.", name=model.name), model)
    return {"summary": summary, "table": table}


def angle_blocks(angles: Sequence[JointAngles]) -> list[Block]:
    """Pack the angles with the motion as blocks angles0, angles1, ..., (T, J, 3)."""
    return [Block(f"angles{i}", ANGLE_STEP_DEG, own.angle_deg) for i, own in enumerate(angles)]


def tip_error_table(caption: str, models: Iterable[ModelResults]) -> DataTable:
    """The recording's rows of tip_errors, mm: the replay under every model, both bindings."""
    return table_of(caption, _TIP_ERROR_COLUMNS, [row for model in models for row in model.tip_errors])


def range_table(caption: str, ranges: Iterable[AngleRange], joints: Iterable[Row]) -> DataTable:
    """Percentiles of every angle, degrees; beside them the range about the joint's axis in calibration."""
    calibrated = {row["joint"]: row["range_deg"] for row in joints}
    columns = (
        Column(tr("Joint"), lambda own: own.joint, is_text=True),
        Column(tr("Angle"), lambda own: word(own.angle), is_text=True),
        Column(tr("Min [deg]"), lambda own: number(own.at_deg[0], 1)),
        Column(tr("2.5 % [deg]"), lambda own: number(own.at_deg[1], 1)),
        Column(tr("Median [deg]"), lambda own: number(own.at_deg[2], 1)),
        Column(tr("97.5 % [deg]"), lambda own: number(own.at_deg[3], 1)),
        Column(tr("Max [deg]"), lambda own: number(own.at_deg[4], 1)),
        Column(tr("2.5 to 97.5 % [deg]"), lambda own: number(own.at_deg[3] - own.at_deg[1], 1)),
        Column(tr("Frames"), lambda own: str(own.n_frames)),
        Column(
            tr("Calibration, about the joint’s axis [deg]"), lambda own: number(calibrated.get(own.joint), 1)
        ),
    )
    return table_of(caption, columns, ranges)


def evidence_table(caption: str, model: ModelResults) -> DataTable:
    """Tabulate each joint's gap, error and singular values in the calibration."""
    values_of = {row["joint"]: row["singular_values"] or [None] * 6 for row in model.solutions}
    singular = [tr("Singular value {n}", n=n) for n in range(1, 7)]
    nothing = dict.fromkeys(singular)
    rows = [
        nothing | row | dict(zip(singular, values_of.get(row["joint"], []), strict=False))
        for row in model.joints
    ]
    columns = (
        text_column(tr("Joint"), "joint"),
        Column(tr("Believe it?"), lambda row: tr(belief(row)), is_text=True),
        number_column(tr("Gap rms [mm]"), "gap_rms_mm"),
        number_column(tr("Free gap rms [mm]"), "gap_rms_free_mm"),
        number_column(tr("SD of the centre [mm]"), "sd_mm"),
        number_column(tr("Frames"), "n_frames", 0),
        number_column(tr("Independent samples"), "n_effective", 1),
        *(number_column(heading, heading, 4) for heading in singular),
        text_column(tr("Message"), "message"),
    )
    return table_of(caption, columns, rows)


_TIP_ERROR_COLUMNS = (
    text_column(N_("Model"), "model"),
    text_column(N_("Digit"), "digit"),
    text_column(N_("Binding"), "binding"),
    number_column(N_("Mean [mm]"), "mean_mm"),
    number_column(N_("SD [mm]"), "sd_mm"),
    number_column(N_("Median [mm]"), "median_mm"),
    number_column(N_("95 % [mm]"), "p95_mm"),
    number_column(N_("Max [mm]"), "max_mm"),
    number_column(N_("Min [mm]"), "min_mm"),
    number_column(N_("Frames"), "n_frames", 0),
    number_column(N_("Of"), "n_frames_total", 0),
    Column(
        N_("Held out"), lambda row: tr("held out") if row["held_out"] else tr("○ in-sample"), is_text=True
    ),
    text_column(N_("Message"), "message"),
)
