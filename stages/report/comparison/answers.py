"""A study's numbers on one question: every subject's under every model, and the comparisons made of them.

They are those of the tables that the stage compare_models writes.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from shukotsu.sentences.translation import N_, listed, tr, translated
from shukotsu.stages.report.comparison.questions import Question
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.statistics.multiple_comparisons import LEVEL

ALL_DIGITS = ""

REASONS = (
    N_("not scored"),
    N_("no such number"),
    N_("made from this task too, not held out"),
    N_("made without this task, not in-sample"),
)
"""Why compare_models has no number, beside the messages of scores and recordings."""


class Missing(NamedTuple):
    """Places in which a model has no number of a subject, for one reason."""

    model: str
    reason: str
    n_places: int


@dataclass(frozen=True)
class Comparison:
    """Two models over the subjects, in one digit or over ALL_DIGITS; differences are model - other.

    differences : by subject. mean, other_mean : of the two models over those subjects. The rest is as in the
    table model_differences; p_holm is corrected for n_comparisons.
    """

    question: Question
    digit: str
    model: str
    other: str
    differences: dict[str, float]
    n_subjects: int
    mean: float
    other_mean: float
    mean_difference: float
    median_difference: float
    interval: tuple[float, float] | None
    p: float
    p_holm: float
    smallest_p: float
    smallest_p_holm: float
    n_comparisons: int
    effect_size: float | None
    n_better: int
    n_equal: int

    @property
    def n(self) -> int:
        """Number of subjects with both models."""
        return len(self.differences)

    @property
    def significant(self) -> bool:
        """Say whether a difference is shown at LEVEL, corrected for all comparisons."""
        return self.p_holm <= LEVEL

    @property
    def testable(self) -> bool:
        """Say whether so many subjects can show a difference at all."""
        return self.smallest_p_holm <= LEVEL

    @property
    def equal(self) -> bool:
        """Say whether the models have the same number in every subject."""
        return self.n_equal == self.n


@dataclass(frozen=True)
class Answer:
    """One question with the study's numbers.

    names : models, then references. by_digit : numbers by digit, ALL_DIGITS first, then model, then subject.
    overall, digits : each model against the baseline over all digits, and digit by digit, where any subject
    has both; either are corrected together. missing : by subject, over all digits. fitted_only : whether only
    models that pose a fitted hand are asked.
    """

    question: Question
    held_out: bool
    n_subjects: int
    models: tuple[str, ...]
    references: tuple[str, ...]
    baseline: str
    by_digit: dict[str, dict[str, dict[str, float]]]
    overall: tuple[Comparison, ...]
    digits: tuple[Comparison, ...]
    missing: dict[str, tuple[Missing, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """The models, then the references."""
        return (*self.models, *self.references)

    @property
    def kind(self) -> str:
        """Say which data the skeletons were made from."""
        if self.held_out:
            return tr("Held out: skeletons made without the recordings that they are scored on.")
        return tr(
            "In-sample: nothing is held out, so a skeleton may have learnt the recording that it is "
            "scored on and not the hand."
        )

    @property
    def judges(self) -> bool:
        """Say whether the answer judges a skeleton: by a truth, or a hand that did not see the recording."""
        return bool(self.question.judged_by) and (self.held_out or not self.question.fitted_only)


def answer(results: StudyResults, question: Question, baseline: str = "") -> Answer | None:
    """Give the study's answer to a question; None where it has no number of any model.

    baseline : the model that the others are compared with; unless given, or where the question has no such
    comparison, the one that the tables name.
    """
    values = [row for row in results.model_values if row["metric"] == question.metric]
    if not values:
        return None
    by_digit: dict[str, dict[str, dict[str, float]]] = {}
    for row in values:
        of_model = by_digit.setdefault(row["digit"], {}).setdefault(row["model"], {})
        if row["value"] is not None:
            of_model[row["subject"]] = row["value"]
    by_digit = {digit: of for digit, of in by_digit.items() if any(of.values())}
    references = dict.fromkeys(row["model"] for row in values if row["reference"])
    models = dict.fromkeys(row["model"] for row in values if not row["reference"])
    differences = [row for row in results.model_differences if row["metric"] == question.metric]
    others = {row["other"]: row["baseline"] for row in differences}
    if baseline not in others:
        baseline = next((other for other, is_baseline in others.items() if is_baseline), next(iter(models)))
    compared = _comparisons(results, question, [row for row in differences if row["other"] == baseline])
    return Answer(
        question=question,
        held_out=values[0]["held_out"],
        n_subjects=len(results.subjects),
        models=tuple(models),
        references=tuple(references),
        baseline=baseline,
        by_digit=by_digit,
        overall=tuple(each for each in compared if each.digit == ALL_DIGITS),
        digits=tuple(each for each in compared if each.digit != ALL_DIGITS),
        missing=_missing(values),
    )


def _comparisons(results: StudyResults, question: Question, rows: Sequence[Row]) -> list[Comparison]:
    """Give the comparisons of those rows of model_differences that some subject has both models for."""
    differences: dict[tuple[str, ...], dict[str, float]] = defaultdict(dict)
    for row in results.model_pairs:
        if row["metric"] == question.metric:
            differences[row["digit"], row["model"], row["other"]][row["subject"]] = row["difference"]
    alike = (
        "digit", "model", "other", "n_subjects", "mean", "other_mean", "mean_difference", "median_difference",
        "p", "p_holm", "smallest_p", "smallest_p_holm", "n_comparisons", "effect_size", "n_better", "n_equal",
    )  # fmt: skip
    return [
        Comparison(
            question=question,
            differences=differences[row["digit"], row["model"], row["other"]],
            interval=None
            if row["interval_95_low"] is None
            else (row["interval_95_low"], row["interval_95_high"]),
            **{name: row[name] for name in alike},
        )
        for row in rows
        if row["n_compared_subjects"]
    ]


def _missing(values: Iterable[Row]) -> dict[str, tuple[Missing, ...]]:
    found: dict[str, tuple[Missing, ...]] = {}
    for row in values:
        if row["digit"] == ALL_DIGITS and row["missing"]:
            own = json.loads(row["missing"]).items()
            found[row["subject"]] = (
                *found.get(row["subject"], ()),
                *(Missing(row["model"], reason, count) for reason, count in own),
            )
    return found


def missing_text(missing: Iterable[Missing]) -> str:
    """Each reason once, with its models and the number of places; empty where nothing is missing."""
    models_of: dict[tuple[str, int], list[str]] = defaultdict(list)
    for each in missing:
        models_of[each.reason, each.n_places].append(each.model)
    return "; ".join(
        f"{listed(models)}: {translated(reason)}" + (tr(", {count} places", count=count) if count > 1 else "")
        for (reason, count), models in models_of.items()
    )
