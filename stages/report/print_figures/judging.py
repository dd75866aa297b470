"""What skeletons are judged by in a study's figures: it depends on what is known (docs/evaluation.md).

Where the truth is known: how far the fingertip and the joints are from it. Else fitted hands by the distal
receivers that were left out, and, apart from that and for what it is, the tip error of the replay.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stages.report.comparison.answers import Answer, answer
from stages.report.comparison.comparisons import Missing, missing_text
from stages.report.comparison.questions import JOINT_ERROR, LEFT_OUT, REPLAY, TRUE, TRUE_TIP, Question
from stages.report.study_results import StudyResults
from stages.report.table_cells import counted, listed

if TYPE_CHECKING:
    import pandas as pd

MOST_NAMED = 4

_AXES = {
    TRUE_TIP: "Fingertip error [mm]",
    JOINT_ERROR: "Joint error [mm]",
    LEFT_OUT: "Left-out error [mm]",
    REPLAY: "Replay's tip error [mm]",
}


@dataclass(frozen=True)
class Judgement:
    """One answer that judges skeletons in print: its axis, and what the number is, in a sentence's words."""

    answer: Answer
    axis: str
    text: str

    @property
    def references(self) -> tuple[str, ...]:
        """References to draw; a true skeleton is no reference to beat."""
        names = self.answer.names
        return tuple(name for name in self.answer.question.references if name in names and name != TRUE)

    @property
    def kind(self) -> str:
        """Which data the skeletons were made from."""
        return kind_text(self.answer.held_out)

    @property
    def gaps(self) -> str:
        """Which numbers of the models are not there and why; empty where all are."""
        return gap_text(self.answer.seen, self.answer.models)


def judgements(results: StudyResults, baseline: str = "") -> list[Judgement]:
    """What this study's skeletons are judged by; empty where no model has a score."""
    known = _answered(results, (TRUE_TIP, JOINT_ERROR), baseline)
    return known or _answered(results, (LEFT_OUT, REPLAY), baseline)


def _answered(results: StudyResults, questions: Iterable[Question], baseline: str) -> list[Judgement]:
    answers = [own for question in questions if (own := answer(results, question, baseline)) is not None]
    return [Judgement(own, _AXES[own.question], _text(results, own.question)) for own in answers]


def kind_text(held_out: bool) -> str:
    """Which data skeletons were made from."""
    if held_out:
        return "Held out: the skeletons were made without the task that they are judged on."
    return "In-sample: the skeletons were made with the task that they are judged on, none without it."


def gap_text(seen: pd.DataFrame, models: Iterable[str]) -> str:
    """Which numbers of these models are not there and why; empty where all are."""
    rows = seen[seen["value"].isna() & seen["model"].isin(list(models))]
    missing: dict[str, list[Missing]] = defaultdict(list)
    for row in rows.itertuples():
        missing[row.subject].append(Missing(row.model, row.digit, row.place, row.reason))
    parts = [f"{subject} ({missing_text(own)})" for subject, own in missing.items()]
    if len(parts) > MOST_NAMED:
        parts = [*parts[:MOST_NAMED], counted(len(parts) - MOST_NAMED, "more subject")]
    return f"Without a number: {listed(parts)}." if parts else ""


def _text(results: StudyResults, question: Question) -> str:
    if question is JOINT_ERROR:
        return (
            "distance of the joint centres to the true ones in the child receiver's frame, mean over joints"
        )
    if question is LEFT_OUT:
        return (
            "fitted hands posed without the positions of the distal receivers, distance from where the hand "
            "says that these are to where they are, mean over frames"
        )
    if question is REPLAY:
        return (
            "tip error of the receiver-driven replay, least-squares binding, mean over frames; it says how "
            "well the joints close and not where they are"
        )
    blind = [model for model in results.models if model not in results.fitted]
    text = "distance from the stated fingertip to the true end of the distal bone, mean over frames"
    if blind:
        verb = "knows" if len(blind) == 1 else "know"
        text += f"; {listed(blind)} {verb} no fingertip but the distal receiver's origin"
    return text
