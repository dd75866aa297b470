"""The page of the study: what it found, model against model, and where everything else is."""

from __future__ import annotations

from typing import Any

from schemas.study import Study
from stages.report import provenance
from stages.report.downloads import downloads
from stages.report.headline import headline, used_text
from stages.report.links import recording_links
from stages.report.methods_text import REFERENCES, methods_text
from stages.report.models_compared.sections import models_compared
from stages.report.score_tables import held_out_table
from stages.report.skeleton_stills import skeleton_pictures
from stages.report.study_results import StudyResults
from stages.report.subjects_table import subjects_table
from stages.report.templates import render
from stages.report.trust import study_trust_table


def render_study(results: StudyResults, study: Study) -> str:
    """Give the study's page; the same results give the same text."""
    compared = models_compared(results)
    return render(
        "study.html.j2",
        study=results.name,
        headline=headline(results),
        used=used_text(results),
        front=_front(results),
        problems=provenance.problems_table(results),
        exports=study.exports,
        export_models=study.export_settings["models"],
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
        config=provenance.config_text(study),
    )


def _front(results: StudyResults) -> dict[str, Any] | None:
    """The first subject of whom there is a picture, with links to where it moves, or None."""
    for subject in results.subjects:
        (row,) = skeleton_pictures(results, subject, [results.leading])
        if row.figures:
            links = recording_links(results.shown, results.paths, results.paths.report, subject)
            return {"subject": subject, "row": row, "links": links}
    return None


def render_failure(message: str) -> str:
    """Give a page that says only why there is no report."""
    return render("failure.html.j2", title="No report", message=f"The report could not be made: {message}")
