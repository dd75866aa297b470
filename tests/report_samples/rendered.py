"""The pages of a report, rendered from the study-wide tables of a made-up study."""

from __future__ import annotations

from dataclasses import fields, replace

from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import StudyResults
from shukotsu.report.subject_page import render_subject
from shukotsu.study.study import Study

ROWS = [
    field.name
    for field in fields(StudyResults)
    if field.type == "list[Row]" and not field.name.startswith("model_")
]


def of_subject(results: StudyResults, subject: str) -> StudyResults:
    """The same results, of one subject, without problems: those of the study are not the subject's."""
    rows = {name: [row for row in getattr(results, name) if row["subject"] == subject] for name in ROWS}
    recordings = tuple(recording for recording in results.recordings if recording.hand.subject == subject)
    return replace(results, recordings=recordings, **rows | {"problems": []})


def subject_page(results: StudyResults, subject: str) -> str:
    """The page of one subject."""
    return render_subject(of_subject(results, subject))


def whole_report(results: StudyResults, study: Study) -> str:
    """The study's page and every subject's, one after the other."""
    pages = [render_study(results, study), *(subject_page(results, name) for name in results.subjects)]
    return "".join(pages)
