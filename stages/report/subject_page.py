"""The page of one subject: what its skeletons are worth, and every number behind them."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.study import Hand
from stages.report import provenance
from stages.report.data_table import DataTable, Folded
from stages.report.figures import FigureRow, skeleton_pictures
from stages.report.finding import used_in_words
from stages.report.links import link, recording_links
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
from stages.report.templates import render
from stages.report.trust import trust_table
from stages.report.truth_tables import joint_error_tables, truth_table


@dataclass(frozen=True)
class TablePair:
    """The study's table under one model and, where there is one, the paper's beside it."""

    title: str
    own: DataTable
    printed: DataTable | None


@dataclass(frozen=True)
class TrialPart:
    """One evaluated task: its tables; scores is None where nothing was scored."""

    title: str
    scores: DataTable | None
    digits: list[Folded]
    pairs: list[TablePair]
    least_squares: DataTable


@dataclass(frozen=True)
class TrustPart:
    """One hand: its joints in words, of the leading model and, folded, of the others."""

    hand: str
    leading: DataTable
    others: list[Folded]


@dataclass(frozen=True)
class SubjectPart:
    """Everything about one subject; truth is None where there is none to compare with."""

    name: str
    trust: list[TrustPart]
    truth: DataTable | None
    joint_errors: list[Folded]
    next_recording: list[NextRecording]
    trials: list[TrialPart]
    skeletons: list[FigureRow]
    joints: list[Folded]
    bones: list[DataTable]
    receivers: list[Folded]


def render_subject(results: StudyResults) -> str:
    """Give the page of the one subject that `results` is of; the same results give the same text.

    Its only link to other subjects is that to the study's page: were they named here, one subject more
    would make the others' pages anew.
    """
    (subject,) = results.subjects
    page = results.paths.subject_page(subject)
    return render(
        "subject.html.j2",
        study=results.study.name,
        to_study=link(results.study.name, page, results.paths.report),
        recordings=recording_links(results.study, results.paths, page, subject),
        used=used_in_words(results),
        problems=provenance.problems_table(results, f"as the study asked: subject {subject}"),
        part=_subject_part(results, subject),
        model=results.leading,
        fitted=results.fitted,
        simulated=results.study.simulation is not None,
        slips=SLIPS,
        sheet=provenance.recordings_table(results, f"of subject {subject}"),
        inputs=provenance.inputs_table(results, f"of subject {subject}"),
    )


def _subject_part(results: StudyResults, subject: str) -> SubjectPart:
    hands = results.hands(subject)
    return SubjectPart(
        subject,
        [_trust_part(results, hand) for hand in hands],
        truth_table(results, subject),
        joint_error_tables(results, subject),
        [next_recording(results, hand) for hand in hands],
        [_trial_part(results, trial) for trial in results.trials(subject)],
        skeleton_pictures(results, subject),
        [folded for hand in hands for folded in joint_tables(results, hand)],
        [bone_table(results, hand) for hand in hands],
        [folded for hand in hands for folded in receiver_tables(results, hand)],
    )


def _trust_part(results: StudyResults, hand: Hand) -> TrustPart:
    others = [name for name in results.models if name != results.leading]
    return TrustPart(
        f"{hand.hand.capitalize()} hand",
        trust_table(results, hand, results.leading),
        [Folded(name, trust_table(results, hand, name)) for name in others],
    )


def _trial_part(results: StudyResults, trial: Trial) -> TrialPart:
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
    )
