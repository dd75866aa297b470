"""The page: gathers every section's tables and figures and hands them to the template."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jinja2

from schemas import VERSION
from schemas.catalogue import TIPS
from stages.report import provenance
from stages.report.data_table import DataTable, Folded
from stages.report.figures import FigureRow, error_charts, skeleton_pictures
from stages.report.finding import finding, used_in_words
from stages.report.next_recording import NextRecording, next_recording
from stages.report.score_tables import digit_tables, score_table
from stages.report.skeleton_tables import bone_table, joint_tables, receiver_tables
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
from stages.report.truth_tables import joint_error_tables, truth_table


@dataclass(frozen=True)
class TablePair:
    """The study's table under one model and, where there is one, the paper's beside it."""

    title: str
    own: DataTable
    printed: DataTable | None


@dataclass(frozen=True)
class TrialPart:
    """One evaluated task: its tables and its charts; scores is None where nothing was scored."""

    title: str
    scores: DataTable | None
    digits: list[Folded]
    pairs: list[TablePair]
    least_squares: DataTable
    charts: list[FigureRow]


@dataclass(frozen=True)
class SubjectPart:
    """Everything about one subject; truth is None where there is none to compare with."""

    name: str
    truth: DataTable | None
    joint_errors: list[Folded]
    next_recording: list[NextRecording]
    trials: list[TrialPart]
    skeletons: list[FigureRow]
    joints: list[Folded]
    bones: list[DataTable]
    receivers: list[Folded]


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
            fitted=results.fitted,
            simulated=results.study.simulation is not None,
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
        truth_table(results, subject),
        joint_error_tables(results, subject),
        [next_recording(results, hand) for hand in hands],
        [_trial_part(results, trial, traces) for trial in results.trials(subject)],
        skeleton_pictures(results, subject),
        [folded for hand in hands for folded in joint_tables(results, hand)],
        [bone_table(results, hand) for hand in hands],
        [folded for hand in hands for folded in receiver_tables(results, hand)],
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
        score_table(results, trial),
        digit_tables(results, trial),
        pairs,
        least_squares_table(results, trial),
        error_charts(results, traces, trial),
    )
