"""A study's numbers on one question: every subject's under every model, and the comparisons made of them.

The baseline is the paper's: of the models that reproduce one of its tables uncorrected the last, for the
first of them leaves metacarpals at rest, and everything beats it by centimetres; without any of the paper's
the study's first model. Fitted hands, where only they are asked, are held against anatomy alone.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from schemas.model import the_papers
from stages.report.comparison import (
    ALL_DIGITS,
    METRICS,
    Comparison,
    Metric,
    Observation,
    compare,
    observed,
)
from stages.report.models_compared.questions import PRIOR, Question
from stages.report.study_results import StudyResults

ByDigit = dict[str, dict[str, dict[str, float]]]
"""Numbers by digit, ALL_DIGITS first, then model, then subject."""


@dataclass(frozen=True)
class Answer:
    """One question with the study's numbers.

    names : models, then references. overall, digits : each model against the baseline over all digits, and
    digit by digit; the comparisons of either are corrected together.
    """

    question: Question
    held_out: bool
    n_subjects: int
    names: tuple[str, ...]
    baseline: str
    by_digit: ByDigit
    overall: tuple[Comparison, ...]
    digits: tuple[Comparison, ...]

    @property
    def metric(self) -> Metric:
        """What is measured."""
        return METRICS[self.question.metric]

    @property
    def models(self) -> tuple[str, ...]:
        """The models without the references."""
        return tuple(name for name in self.names if name not in self.question.references)

    @property
    def judges(self) -> bool:
        """Whether the answer judges a skeleton: by a truth, or by a hand that did not see the recording."""
        return bool(self.question.judged_by) and (self.held_out or not self.question.fitted_only)


def answer(results: StudyResults, question: Question, baseline: str) -> Answer | None:
    """Ask the study, of held-out numbers if there are any; None where it has no number of any model."""
    metric = METRICS[question.metric]
    models = [name for name in results.models if not question.fitted_only or name in results.fitted]
    for held_out in (True, False):
        told = observed(results, metric, [*models, *question.references], held_out=held_out)
        present = {each.model for each in told if each.value is not None}
        if present.intersection(models):
            break
    else:
        return None
    if question.fitted_only or len(models) == 1:
        baseline = PRIOR if PRIOR in present else models[0]
    overall, digits = (
        compare(
            told,
            metric,
            [(name, baseline) for name in models if name != baseline],
            held_out=held_out,
            subjects=results.subjects,
            digits=scopes,
            fitted={*results.fitted, PRIOR},
        )
        for scopes in ({ALL_DIGITS}, {each.digit for each in told})
    )
    references = [name for name in question.references if name in present]
    return Answer(
        question=question,
        held_out=held_out,
        n_subjects=len(results.subjects),
        names=(*models, *references),
        baseline=baseline,
        by_digit=_means(told, _digits(results, told)),
        overall=overall,
        digits=digits,
    )


def baseline_of(results: StudyResults) -> str:
    """The last of the paper's models that nobody corrected by hand; the study's first where there is none."""
    return the_papers(results.models.values()) or next(iter(results.models))


def _digits(results: StudyResults, told: Sequence[Observation]) -> list[str]:
    """All digits first, then those with numbers as the layouts name them, then what else has."""
    of_layouts = [digit for layout in results.layouts.values() for digit in layout.digits]
    known = {each.digit for each in told if each.value is not None}
    return [ALL_DIGITS, *(d for d in dict.fromkeys([*of_layouts, *sorted(known)]) if d in known)]


def _means(told: Sequence[Observation], digits: Sequence[str]) -> ByDigit:
    """Each subject's mean over the places in which a model has a number."""
    values: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for each in told:
        if each.value is not None:
            values[each.digit, each.model, each.subject].append(each.value)
            values[ALL_DIGITS, each.model, each.subject].append(each.value)
    means: ByDigit = {digit: defaultdict(dict) for digit in digits}
    for (digit, model, subject), numbers in sorted(values.items()):
        means[digit][model][subject] = sum(numbers) / len(numbers)
    return means
