"""The page of one recording: the moving hand, plots that follow it, and tables of its numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from shukotsu.report import palette, provenance, skeleton_tables, table_cells
from shukotsu.report.belief import belief, believed_counts
from shukotsu.report.figures.drawing import page_pictures
from shukotsu.report.figures.recording_figures import angle_looks, curve_panels, digit_rows, recording_text
from shukotsu.report.movement_results import recording_curves, why_no_curves
from shukotsu.report.recording_results import ModelResults, RecordingResults
from shukotsu.report.study_results import StudyResults, hand_of, task_title
from shukotsu.report.table_cells import Folded, Link, PageColumn, number, title
from shukotsu.report.templates import render
from shukotsu.report.viewer import NumberBlock, view_of
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import RANGES_OF_MOTION
from shukotsu.tables.subjects import SubjectSession
from shukotsu.translation import ngettext, tr, translated, word

ANGLE_STEP_DEG = 0.1
"""Step to which angles are rounded, the precision at which the page prints them."""


def recording_page(results: RecordingResults) -> str:
    """Return the recording's page as HTML; the same results give the same text."""
    title, motion = recording_title(results.recording), results.motion
    angles = [model.angles for model in results.models if model.angles is not None]
    row, facts = results.row, []
    if row["n_frames"]:
        facts.append(ngettext("{n} frame", "{n} frames", row["n_frames"]))
    if row.get("duration_s") is not None:
        facts.append(f"{number(row['duration_s'])} s")
    if row.get("valid_percent") is not None:
        facts.append(tr("{valid} % of the poses are valid", valid=number(row["valid_percent"], 1)))
    blocks = [
        NumberBlock(f"{name}{i}", ANGLE_STEP_DEG, values)
        for i, each in enumerate(angles)
        for name, values in (("angles", each.angle_deg), ("angle_sds", each.sd_deg))
    ]
    header = {
        "angles": [{"model": each.model, "joints": [word(joint) for joint in each.joints]} for each in angles]
    }
    columns = (
        table_cells.text_column(tr("Model"), "model"),
        table_cells.text_column(tr("Digit"), "digit"),
        table_cells.text_column(tr("Binding"), "binding"),
        table_cells.quantity_column("mean_mm"),
        table_cells.number_column("SD [mm]", "sd_mm"),
        *map(table_cells.quantity_column, ("median_mm", "p95_mm", "max_mm", "min_mm", "n_frames")),
        table_cells.number_column(tr("Of"), "n_frames_total", 0),
        PageColumn(tr("Held out"), lambda row: tr("yes") if row["held_out"] else tr("○ no"), is_text=True),
        table_cells.text_column(tr("Message"), "message"),
    )
    caption = tr("Tip error of the replay, {title}.", title=title)
    rows = [row for model in results.models for row in model.tip_errors]
    tip_errors = table_cells.table_of(caption, columns, rows, source="tip_errors")
    cycles = _cycles(results.study, results.recording, title)
    return render(
        "recording_page/page.html.j2",
        title=title,
        tables_at=f"../../../{quote(results.study.paths.subject(*results.recording.hand.who).name)}/",
        study=results.study.name,
        facts=", ".join(facts),
        problems=provenance.faults_listed(
            [row for row in results.study.suspect_rows if hand_of(row) == results.recording.hand]
        ),
        said=translated(row["message"]) if motion is not None else "",
        trouble=translated(results.trouble),
        left_out={model: translated(reason) for model, reason in results.left_out.items()},
        to=_navigation(results.study, results.recording),
        view=None if motion is None else view_of(title, motion, blocks, header),
        angles=angles,
        cycles=cycles,
        no_cycles="" if cycles else why_no_curves(results.study, results.recording, results.study.leading),
        leading=results.study.leading,
        angle_looks=[*angle_looks().values()],
        marks=list(palette.MARK_PATHS.values()),
        replayed=results.recording.role != "calibration",
        tip_errors=Folded(tr("Tip error of the replay in numbers"), tip_errors),
        ranges=_ranges(results),
        evidence=[_evidence(model) for model in results.models],
    )


def failure_page(title: str, message: str) -> str:
    """Return a page that only states why the recording has no page."""
    text = tr("This recording has no page: {message}", message=translated(message))
    return render("base.html.j2", title=title, message=text)


def recording_title(recording: Recording) -> str:
    """Return subject, hand, task and trial in words, and whether the recording is only for calibration."""
    calibrates = recording.role == "calibration"
    return table_cells.capital(recording_text(recording)) + (f" ({tr('calibration')})" if calibrates else "")


def _cycles(results: StudyResults, recording: Recording, title: str) -> dict[str, list[tuple[str, Markup]]]:
    """Return the curves over cycles under the leading model, by event: a heading and a picture per joint."""
    pictures = {}
    for event, curves in recording_curves(results, recording, results.leading).items():
        panels = curve_panels(f"{title}, {event}", curves, angle_looks())
        rows = digit_rows(results.layouts[recording.hand], curves)
        pictures[event] = page_pictures(panels[joint] for row in rows for joint in row)
    return pictures


def _ranges(results: RecordingResults) -> list[Folded]:
    """Return a table of the recording's rows of ranges_of_motion for each model that has any."""
    return [
        Folded(model.name, skeleton_tables.measured_table(model.name, rows, with_recording=False))
        for model in results.models
        if (rows := results.study.recording_rows(RANGES_OF_MOTION, results.recording, model.name))
    ]


def _evidence(model: ModelResults) -> Folded:
    """Return a table of each joint's gap, error and singular values in the calibration."""
    values_of = {row["joint"]: row["singular_values"] or [None] * 6 for row in model.solutions}
    singular = [tr("Singular value {n}", n=n) for n in range(1, 7)]
    nothing = dict.fromkeys(singular)
    rows = [
        nothing | row | dict(zip(singular, values_of.get(row["joint"], []), strict=False))
        for row in model.joints
    ]
    quantities = ("gap_rms_mm", "gap_rms_free_mm", "sd_mm", "n_frames", "n_effective")
    columns = (
        table_cells.text_column(tr("Joint"), "joint"),
        PageColumn(tr("Believe it?"), lambda row: tr(belief(row)), is_text=True),
        *map(table_cells.quantity_column, quantities),
        *(table_cells.number_column(heading, heading, 4) for heading in singular),
        table_cells.text_column(tr("Message"), "message"),
    )
    joints = ngettext("{n} joint", "{n} joints", len(model.joints))
    caption = tr("What the calibration says of each joint, {name}.", name=model.name)
    summary = f"{model.name}: {joints}; {believed_counts(model.joints)}"
    return Folded(summary, table_cells.table_of(caption, columns, rows, source="joint_solutions"))


def recording_links(results: StudyResults, page: Path, who: SubjectSession) -> list[Link]:
    """Return links to the pages of a subject's recordings."""
    links = []
    for recording in results.shown:
        if recording.hand.who == who:
            calibrates = recording.role == "calibration"
            words = task_title(recording.task, recording.trial, calibrates=calibrates)
            words += ", " + tr("{hand} hand", hand=recording.hand.hand)
            links.append(table_cells.link(words, page, results.paths.recording_page(recording)))
    return links


class Navigation(NamedTuple):
    """Links of a recording's page; other_hand : None if the other hand has no page of the task."""

    study: Link
    subject: Link
    other_hand: Link | None
    others: list[Link]


def _navigation(results: StudyResults, recording: Recording) -> Navigation:
    paths, hand = results.paths, recording.hand
    page = paths.recording_page(recording)
    other_hand = replace(hand, hand="left" if hand.hand == "right" else "right")
    same_task = [each for each in results.shown if (each.hand, each.task) == (other_hand, recording.task)]
    same_trial = [each for each in same_task if each.trial == recording.trial]
    other = next(iter([*same_trial, *same_task]), None)
    words = tr("{hand} hand", hand=title(other_hand.hand))
    subject = tr("Subject %(name)s") % {"name": hand.who.label}
    links, mine = recording_links(results, page, hand.who), table_cells.link("", page, page).href
    return Navigation(
        table_cells.link(tr("Study %(study)s") % {"study": results.name}, page, paths.report),
        table_cells.link(subject, page, paths.subject_page(*hand.who)),
        None if other is None else table_cells.link(words, page, paths.recording_page(other)),
        [to for to in links if to.href != mine],
    )
