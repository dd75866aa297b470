"""A study's numbers on one question: every subject's under every model, and the comparisons made of them.

The baseline is the paper's: of the models that reproduce one of its tables uncorrected the last, for the
first of them leaves metacarpals at rest, and everything beats it by centimetres; without any of the paper's
the study's first model. Fitted hands, where only they are asked, are held against anatomy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.model import the_papers
from stages.report.comparison.comparisons import ALL_DIGITS, Comparison, compare
from stages.report.comparison.observations import observations
from stages.report.comparison.questions import PRIOR, Question
from stages.report.study_results import StudyResults

if TYPE_CHECKING:
    import pandas as pd

ByDigit = dict[str, dict[str, dict[str, float]]]
"""Numbers by digit, ALL_DIGITS first, then model, then subject."""


@dataclass(frozen=True)
class Answer:
    """One question with the study's numbers.

    seen : the observations of models and references. names : models, then references. overall, digits : each
    model against the baseline over all digits, and digit by digit; the comparisons of either are corrected
    together.
    """

    question: Question
    held_out: bool
    n_subjects: int
    seen: pd.DataFrame
    names: tuple[str, ...]
    baseline: str
    by_digit: ByDigit
    overall: tuple[Comparison, ...]
    digits: tuple[Comparison, ...]

    @property
    def models(self) -> tuple[str, ...]:
        """The models without the references."""
        return tuple(name for name in self.names if name not in self.question.references)

    @property
    def judges(self) -> bool:
        """Whether the answer judges a skeleton: by a truth, or by a hand that did not see the recording."""
        return bool(self.question.judged_by) and (self.held_out or not self.question.fitted_only)


def answer(results: StudyResults, question: Question, baseline: str = "") -> Answer | None:
    """Ask the study, of held-out numbers if there are any; None where it has no number of any model.

    baseline : the model that the others are held against; unless given the paper's.
    """
    models = [name for name in results.models if not question.fitted_only or name in results.fitted]
    for held_out in (True, False):
        seen = observations(results, question, [*models, *question.references], held_out=held_out)
        present = set(seen.loc[seen["value"].notna(), "model"])
        if present.intersection(models):
            break
    else:
        return None
    baseline = baseline or the_papers(results.models.values()) or next(iter(results.models))
    if question.fitted_only or len(models) == 1:
        baseline = PRIOR if PRIOR in present else models[0]
    pairs = [(name, baseline) for name in models if name != baseline]
    overall, digits = (
        compare(seen, question, pairs, held_out=held_out, subjects=results.subjects, digits=scopes)
        for scopes in ({ALL_DIGITS}, set(seen["digit"]))
    )
    return Answer(
        question=question,
        held_out=held_out,
        n_subjects=len(results.subjects),
        seen=seen,
        names=(*models, *(name for name in question.references if name in present)),
        baseline=baseline,
        by_digit=_means(results, seen),
        overall=overall,
        digits=digits,
    )


def _means(results: StudyResults, seen: pd.DataFrame) -> ByDigit:
    """Each subject's mean over the places in which a model has a number.

    All digits first, then those with numbers as the layouts name them, then what else has.
    """
    known = seen.dropna(subset="value")
    of_layouts = [digit for layout in results.layouts.values() for digit in layout.digits]
    present = set(known["digit"])
    digits = [d for d in dict.fromkeys([*of_layouts, *sorted(present)]) if d in present]
    means: ByDigit = {}
    for digit in (ALL_DIGITS, *digits):
        own = known if digit == ALL_DIGITS else known[known["digit"] == digit]
        means[digit] = {
            str(model): {str(subject): float(value) for (_, subject), value in of_model.items()}
            for model, of_model in own.groupby(["model", "subject"])["value"].mean().groupby(level=0)
        }
    return means
