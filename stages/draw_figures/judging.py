"""What skeletons are judged by in a study's figures: it depends on what is known (docs/evaluation.md).

Where the truth is known: how far the fingertip and the joints are from it. Else fitted hands by the distal
receivers that were left out, and, apart from that and for what it is, the tip error of the replay.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from stages.report.comparison import METRICS, Metric, Missing, Observation, missing_in_words, observed
from stages.report.data_table import counted, listed
from stages.report.study_results import StudyResults

PRIOR, RECEIVER = "prior-only", "distal-receiver"
MOST_NAMED = 4

Means = dict[tuple[str, str], dict[str, float]]
"""By model and digit: each subject's mean."""


@dataclass(frozen=True)
class Judge:
    """One number that models are compared by: its axis, the models and references that have it, in words."""

    metric: Metric
    axis: str
    models: tuple[str, ...]
    references: tuple[str, ...]
    words: str
    held_out: bool

    @property
    def kind(self) -> str:
        """Which data the skeletons were made from, in words."""
        if self.held_out:
            return "Held out: the skeletons were made without the task that they are judged on."
        return "In-sample: the skeletons were made with the task that they are judged on, none without it."


def judges(results: StudyResults) -> tuple[Judge, ...]:
    """What this study's skeletons are judged by; empty where no model has a score."""
    models = tuple(results.models)
    rows = [row for row in results.scores if row["model"] in results.models]
    held_out = any(row["held_out"] for row in rows)

    def having(name: str) -> set[str]:
        return {row["model"] for row in rows if row[name] is not None}

    def made(name: str, axis: str, who: Iterable[str], references: tuple[str, ...], words: str) -> Judge:
        kept = tuple(model for model in models if model in set(who))
        return Judge(METRICS[name], axis, kept, references, words, held_out)

    with_joints = {row["model"] for row in results.joint_errors if row["error_mm"] is not None}
    known = []
    if having("true_tip_mean_mm"):
        known.append(
            made("true_tip_mean_mm", "Fingertip error [mm]", models, (PRIOR, RECEIVER), _true_tip(results))
        )
    if with_joints & set(models):
        known.append(made("error_mm", "Joint error [mm]", models, (PRIOR,), _TRUE_JOINT))
    if known:
        return tuple(known)
    fitted = [model for model in results.fitted if model in having("left_out_mean_mm")]
    if fitted:
        known.append(made("left_out_mean_mm", "Left-out error [mm]", fitted, (PRIOR,), _LEFT_OUT))
    if having("replay_mean_mm"):
        known.append(made("replay_mean_mm", "Replay's tip error [mm]", models, (), _REPLAY))
    return tuple(known)


def subject_means(observations: Iterable[Observation]) -> Means:
    """Each subject's mean over the places (recordings, joints) of a digit in which a model has a number."""
    values: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for each in observations:
        if each.value is not None:
            values[each.model, each.digit, each.subject].append(each.value)
    means: Means = defaultdict(dict)
    for (model, digit, subject), of_subject in values.items():
        means[model, digit][subject] = math.fsum(of_subject) / len(of_subject)
    return dict(means)


def seen_by(results: StudyResults, judge: Judge) -> list[Observation]:
    """The numbers of the judge's models and references in every place of the study."""
    return observed(results, judge.metric, (*judge.models, *judge.references), held_out=judge.held_out)


def gaps_in_words(observations: Iterable[Observation], models: Iterable[str]) -> str:
    """Which numbers of these models are not there and why; empty where all are."""
    wanted = set(models)
    gone: dict[str, list[Missing]] = defaultdict(list)
    for each in observations:
        if each.value is None and each.model in wanted:
            gone[each.subject].append(Missing(each.model, each.digit, each.place, each.reason))
    told = [f"{subject} ({missing_in_words(missing)})" for subject, missing in gone.items()]
    if len(told) > MOST_NAMED:
        told = [*told[:MOST_NAMED], counted(len(told) - MOST_NAMED, "more subject")]
    return f"Without a number: {listed(told)}." if told else ""


def _true_tip(results: StudyResults) -> str:
    blind = [model for model in results.models if model not in results.fitted]
    text = "distance from the stated fingertip to the true end of the distal bone, mean over frames"
    if blind:
        verb = "knows" if len(blind) == 1 else "know"
        text += f"; {listed(blind)} {verb} no fingertip but the distal receiver's origin"
    return text


_TRUE_JOINT = "distance of the joint centres to the true ones in the child receiver's frame, mean over joints"
_LEFT_OUT = (
    "fitted hands posed without the positions of the distal receivers, distance from where the hand says "
    "that these are to where they are, mean over frames"
)
_REPLAY = (
    "tip error of the receiver-driven replay, least-squares binding, mean over frames; it says how well the "
    "joints close and not where they are"
)
