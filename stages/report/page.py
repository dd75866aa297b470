"""The page: gathers every section's tables and figures and hands them to the template."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jinja2

from schemas import VERSION
from schemas.catalogue import TIPS
from stages.report import provenance
from stages.report.data_table import DataTable
from stages.report.figures import FigureRow, error_charts, skeleton_pictures
from stages.report.finding import finding, used_in_words
from stages.report.skeleton_tables import Folded, bone_table, joint_tables
from stages.report.study_results import StudyResults, Trial
from stages.report.tables_1_to_4 import (
    SLIPS,
    is_the_papers_hand,
    least_squares_table,
    own_table,
    printed_table,
    table_title,
)
from stages.report.tip_traces import Trace, read_traces


@dataclass(frozen=True)
class TablePair:
    """The study's table under one model and, where there is one, the paper's beside it."""

    title: str
    own: DataTable
    printed: DataTable | None


@dataclass(frozen=True)
class TrialPart:
    """One evaluated task: its tables and its charts."""

    title: str
    pairs: list[TablePair]
    least_squares: DataTable
    charts: list[FigureRow]


@dataclass(frozen=True)
class SubjectPart:
    """Everything about one subject."""

    name: str
    trials: list[TrialPart]
    skeletons: list[FigureRow]
    joints: list[Folded]
    bones: list[DataTable]


def render_page(results: StudyResults) -> str:
    """Give the report as one HTML page; the same results give the same text."""
    traces = read_traces(results.paths.study_table(TIPS.name))
    subjects = [_subject_part(results, subject, traces) for subject in results.subjects]
    return (
        _environment()
        .get_template("template.html.j2")
        .render(
            study=results.study.name,
            version=VERSION,
            finding=finding(results),
            used=used_in_words(results),
            problems=provenance.problems_table(results),
            exports=results.study.exports,
            subjects=subjects,
            slips=SLIPS,
            recordings=provenance.recordings_table(results),
            models=provenance.models_table(results),
            versions=provenance.versions_table(),
            inputs=provenance.inputs_table(results),
            config=provenance.config_text(results),
        )
        + "\n"
    )


def render_failure(message: str) -> str:
    """Give a page that says only why there is no report."""
    return _environment().get_template("failure.html.j2").render(message=message) + "\n"


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _subject_part(results: StudyResults, subject: str, traces: dict[tuple[str, ...], Trace]) -> SubjectPart:
    hands = results.hands(subject)
    return SubjectPart(
        subject,
        [_trial_part(results, trial, traces) for trial in results.trials(subject)],
        skeleton_pictures(results, subject),
        [folded for hand in hands for folded in joint_tables(results, hand)],
        [bone_table(results, hand) for hand in hands],
    )


def _trial_part(results: StudyResults, trial: Trial, traces: dict[tuple[str, ...], Trace]) -> TrialPart:
    beside = is_the_papers_hand(results, trial)
    pairs = [
        TablePair(
            table_title(model),
            own_table(results, trial, model),
            printed_table(model.paper_table) if beside and model.paper_table else None,
        )
        for model in results.models.values()
    ]
    return TrialPart(
        trial.title,
        pairs,
        least_squares_table(results, trial),
        error_charts(results, traces, trial),
    )
