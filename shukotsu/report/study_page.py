"""The page of the study, to be looked at: a hand in motion, three numbers, figures; then all else."""

from __future__ import annotations

import platform
from importlib import metadata
from typing import Any, NamedTuple

from markupsafe import Markup

from shukotsu.errors import InputError
from shukotsu.report.at_a_glance import believed_text, class_texts, joint_picture, small_hand
from shukotsu.report.figures.panels import page_picture, taken_failures
from shukotsu.report.figures.study_figures import model_panels, range_panels
from shukotsu.report.judged_models import big_numbers, model_to_take, used_text
from shukotsu.report.links import Link, link, recording_links
from shukotsu.report.methods_text import REFERENCES, methods_text
from shukotsu.report.movement_results import Movement
from shukotsu.report.provenance import all_problems, faults_listed
from shukotsu.report.recording_results import read_stretch
from shukotsu.report.skeleton_tables import lengths_table
from shukotsu.report.study_results import StudyResults
from shukotsu.report.templates import render
from shukotsu.report.viewer import View, view_of
from shukotsu.resources import VERSION
from shukotsu.scores.paired_statistics import FEWEST_SUBJECTS
from shukotsu.study.results import (
    FIGURE_KINDS,
    MODEL_COMPARISONS,
    MOVEMENT_COMPARISONS,
    STUDY_FIGURES,
    STUDY_TABLES,
)
from shukotsu.study.study import Study
from shukotsu.tables.subjects import SubjectSession
from shukotsu.translation import tr, translated

FEW_HANDS = 30
"""As many rows of bone lengths as are shown unfolded."""
MOST_TRIED = 8
"""Recordings that are tried for one whose hand can be shown in motion."""
PACKAGES = ("numpy", "pyarrow", "scipy", "snakemake")


class SubjectCard(NamedTuple):
    """A subject: a link to the page, the hands small, joints believed of all, links to the recordings."""

    to: Link
    hands: tuple[Markup, ...]
    believed: str
    suspect: bool
    recordings: list[Link]


def render_study(results: StudyResults, study: Study, movement: Movement | None = None) -> str:
    """Return the study's page; the same results give the same text."""
    panels = model_panels(results)
    parts: dict[str, Any] = {
        "view": _front(results),
        "schema": _schema(results),
        "pictures": [page_picture(panel) for panel in panels],
        "ranges": [page_picture(panel) for panel in range_panels(movement)] if movement else [],
    }
    for message in taken_failures():  # after every picture, before the list of problems
        results.add_problem("report", message)
    return render(
        "study.html.j2",
        study=results.name,
        used=used_text(results),
        numbers=big_numbers(results),
        take=model_to_take(results),
        model=results.leading,
        panels=panels,
        fewest=FEWEST_SUBJECTS,
        joints=joint_picture(results),
        classes=class_texts(),
        problems=all_problems(results),
        accepted=faults_listed(results.accepted),
        differences=movement.differences_table() if movement else None,
        subjects=[_card(results, who) for who in results.sessions],
        lengths=lengths_table(results, results.leading),
        lengths_open=len(results.hands) <= FEW_HANDS,
        methods=methods_text(results, movement),
        references=REFERENCES,
        files=study_files(results),
        exports=exported_files(results) if study.exports else {},
        versions=", ".join(
            [
                f"shukotsu {VERSION}",
                f"python {platform.python_version()}",
                *(f"{package} {metadata.version(package)}" for package in PACKAGES),
            ]
        ),
        **parts,
    )


def _front(results: StudyResults) -> View | None:
    """The hand in motion of the first recording that counts and can be shown; None without one."""
    counted = [recording for recording in results.shown if recording.hand not in results.suspect]
    used = [recording for recording in counted if results.status_of(recording)[0] == "used"]
    for recording in used[:MOST_TRIED]:
        try:
            motion = read_stretch(results, recording, results.leading)
        except InputError:
            continue
        title = f"{recording.hand}, {recording.task}, {results.leading}"
        return view_of(title, motion)
    return None


def _schema(results: StudyResults) -> Markup | None:
    """The first hand with lengths as a schema, for where none can be shown in motion."""
    hands = [hand for hand in results.hands if results.bones_of.get((hand, results.leading))]
    return small_hand(results, hands[0], results.leading) if hands else None


def _card(results: StudyResults, who: SubjectSession) -> SubjectCard:
    page, model, hands = results.paths.report, results.leading, results.hands_of(*who)[::-1]
    rows = [row for hand in hands for row in results.joints_of.get((hand, model), [])]
    return SubjectCard(
        link(who.label, page, results.paths.subject_page(*who)),
        tuple(small_hand(results, hand, model) for hand in hands),
        believed_text(rows),
        any(hand in results.suspect for hand in hands),
        recording_links(results, page, who),
    )


def study_files(results: StudyResults) -> list[tuple[str, list[Link]]]:
    """Return links to what stands beside the page: figures for print, tables, configuration."""
    paths = results.paths
    page, tables = paths.report, (*STUDY_TABLES, *MODEL_COMPARISONS, *MOVEMENT_COMPARISONS)
    figures = [
        (name, [link(kind, page, paths.figures / f"{name}.{kind}") for kind in FIGURE_KINDS])
        for name in STUDY_FIGURES
    ]
    return [
        *figures,
        ("tables", [link(name, page, paths.study_table(name)) for name in tables]),
        ("configuration", [link(paths.resolved.name, page, paths.resolved)]),
    ]


def exported_files(results: StudyResults) -> dict[str, list[Link]]:
    """Return links to the files in the folder of exports, by what their names end in."""
    exported: dict[str, list[Link]] = {}
    for file in sorted(results.paths.exports.glob("[!.]*")):  # what begins with a dot is Snakemake's
        if not file.name.endswith(".failed.txt"):
            kind = "/" if file.is_dir() else file.suffix.removeprefix(".")
            exported.setdefault(kind, []).append(link(file.name, results.paths.report, file))
    return exported


def render_failure(message: str) -> str:
    """Return a page that says only why there is no report."""
    return render(
        "base.html.j2",
        title=tr("No report"),
        message=translated(message),
    )
