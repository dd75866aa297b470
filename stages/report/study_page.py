"""The page of the study: what it found, model against model, and where everything else is."""

from __future__ import annotations

from dataclasses import dataclass

from stages.report import provenance
from stages.report.downloads import downloads
from stages.report.figures import FigureRow, skeleton_pictures
from stages.report.finding import finding, used_in_words
from stages.report.held_out_table import held_out_table
from stages.report.links import Link, recording_links
from stages.report.methods_text import REFERENCES, methods_text
from stages.report.models_compared.sections import models_compared
from stages.report.study_results import StudyResults
from stages.report.subjects_table import subjects_table
from stages.report.templates import render
from stages.report.trust import study_trust_table


def render_study(results: StudyResults) -> str:
    """Give the study's page; the same results give the same text."""
    compared = models_compared(results)
    return render(
        "study.html.j2",
        study=results.study.name,
        finding=finding(results),
        used=used_in_words(results),
        front=_front(results),
        problems=provenance.problems_table(results),
        exports=results.study.exports,
        export_models=results.study.export_settings["models"],
        compared=compared,
        downloads=downloads(results, compared.comparisons),
        subjects=subjects_table(results),
        trust=study_trust_table(results, results.leading),
        model=results.leading,
        held_out=held_out_table(results),
        recordings=provenance.recordings_table(results),
        models=provenance.models_table(results),
        methods=methods_text(results),
        references=REFERENCES,
        versions=provenance.versions_table(),
        inputs=provenance.inputs_table(results),
        config=provenance.config_text(results),
    )


@dataclass(frozen=True)
class Front:
    """The hands that the page opens with: whose, what they look like, and where they move."""

    subject: str
    row: FigureRow
    links: list[Link]


def _front(results: StudyResults) -> Front | None:
    """The first subject of whom there is a picture; None where there is none."""
    for subject in results.subjects:
        (row,) = skeleton_pictures(results, subject, [results.leading])
        if row.figures:
            page = results.paths.report
            return Front(subject, row, recording_links(results.study, results.paths, page, subject))
    return None


def render_failure(message: str) -> str:
    """Give a page that says only why there is no report."""
    return render("failure.html.j2", message=message)
