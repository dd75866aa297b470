"""The pages of a report, rendered from the study-wide tables of a made-up study."""

from __future__ import annotations

from dataclasses import fields, replace

from stages.report.study_page import render_study
from stages.report.study_results import StudyResults
from stages.report.subject_page import render_subject

OF_A_SUBJECT = [field.name for field in fields(StudyResults) if field.type == "list[Row]"]


def of_subject(results: StudyResults, subject: str) -> StudyResults:
    """The same results, of one subject; problems name no subject and stay with the study."""
    rows = {
        name: [row for row in getattr(results, name) if row["subject"] == subject]
        for name in OF_A_SUBJECT
        if name != "problems"
    }
    return replace(results, study=results.study.of_subject(subject), problems=[], **rows)


def subject_page(results: StudyResults, subject: str) -> str:
    """The page of one subject."""
    return render_subject(of_subject(results, subject))


def whole_report(results: StudyResults) -> str:
    """The study's page and every subject's, one after the other."""
    return "".join([render_study(results), *(subject_page(results, name) for name in results.subjects)])
