"""The page of one recording: gathers the view, the plots' data, charts and tables for the template."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import N_, ngettext, tr, translated, word
from shukotsu.stages.report.belief import belief
from shukotsu.stages.report.hand_motion import HandMotion
from shukotsu.stages.report.links import navigation
from shukotsu.stages.report.measured_ranges import measured_ranges, measured_table
from shukotsu.stages.report.palette import MARK_PATHS
from shukotsu.stages.report.recording_results import (
    JointAngles,
    ModelResults,
    RecordingResults,
    angles_of,
)
from shukotsu.stages.report.study_results import recording_key, row_key
from shukotsu.stages.report.table_cells import (
    Column,
    DataTable,
    Folded,
    capital,
    number,
    number_column,
    table_of,
    text_column,
)
from shukotsu.stages.report.templates import render
from shukotsu.stages.report.trust import believed_counts
from shukotsu.stages.report.viewer import Block, View, view_of

ANGLE_STEP_DEG = 0.1
"""As the page prints angles: rounded to it once, they show the table's own digits."""


def recording_page(results: RecordingResults) -> str:
    """Return the recording's page; the same results give the same text."""
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
        angles=angles,
        marks=list(MARK_PATHS.values()),
        tip_errors=Folded(
            tr("Tip error of the replay in numbers"),
            tip_error_table(tr("Tip error of the replay, {title}.", title=title), results.models),
        ),
        ranges=[folded for model in results.models if (folded := _ranges(results, model))],
        evidence=[_evidence(model) for model in results.models],
    )


def failure_page(title: str, message: str) -> str:
    """Return a page that says only why there is none of the recording."""
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


def _ranges(results: RecordingResults, model: ModelResults) -> Folded | None:
    """The recording's rows of ranges_of_motion under one model; None without any."""
    measured = measured_ranges(results.study, results.recording.hand, model.name)
    rows = [row for row in measured if row_key(row) == recording_key(results.recording)]
    caption = tr("Range of motion, posture and speed with stated 1-sigma errors, {name}.", name=model.name)
    return Folded(model.name, measured_table(caption, rows, with_recording=False)) if rows else None


def _evidence(model: ModelResults) -> Folded:
    """The calibration's evidence under one model."""
    joints = ngettext("{n} joint", "{n} joints", len(model.joints))
    table = evidence_table(tr("What the calibration says of each joint, {name}.", name=model.name), model)
    return Folded(f"{model.name}: {joints}; {believed_counts(model.joints)}", table)


def angle_blocks(angles: Sequence[JointAngles]) -> list[Block]:
    """Pack the angles with the motion as blocks angles0, angles1, ..., (T, J, 3)."""
    return [Block(f"angles{i}", ANGLE_STEP_DEG, own.angle_deg) for i, own in enumerate(angles)]


def tip_error_table(caption: str, models: Iterable[ModelResults]) -> DataTable:
    """The recording's rows of tip_errors, mm: the replay under every model, both bindings."""
    return table_of(caption, _TIP_ERROR_COLUMNS, [row for model in models for row in model.tip_errors])


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
