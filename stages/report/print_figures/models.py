"""A study's figures of models: what judges them, their errors by digit, and their differences."""

from __future__ import annotations

from dataclasses import replace

from matplotlib.figure import Figure

from shukotsu.errors import InputError
from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.comparison.answers import ALL_DIGITS, Answer, Comparison, answer
from shukotsu.stages.report.comparison.comparison_text import missing_sentences, p_text
from shukotsu.stages.report.comparison.questions import (
    JOINT_ERROR,
    LEFT_OUT,
    REPLAY,
    TRUE,
    TRUE_TIP,
    Question,
)
from shukotsu.stages.report.models_compared.model_panels import difference_panel, looks_of, value_panel
from shukotsu.stages.report.plots.panels import Panel, in_rows, lettered, print_figure
from shukotsu.stages.report.plots.rows import FEWEST_FOR_QUARTILES
from shukotsu.stages.report.plots.style import ONE_COLUMN_MM
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, study_text
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import number, title
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS


def judgements(results: StudyResults, baseline: str = "") -> list[Answer]:
    """Return the numbers that judge this study's skeletons; empty where no model has a score."""
    for questions in ((TRUE_TIP, JOINT_ERROR), (LEFT_OUT, REPLAY)):
        found = [own for each in questions if (own := answer(results, each, baseline)) is not None]
        if found:
            return found
    return []


def missing_text_of(own: Answer) -> str:
    """Tell which numbers of the models are not there and why; empty where all are."""
    sentences = missing_sentences(own)
    return tr("Without a number: {sentences}", sentences=" ".join(sentences)) if sentences else ""


def _text(results: StudyResults, question: Question) -> str:
    """Describe the number in a sentence's words."""
    blind = [model for model in results.models if model not in results.fitted]
    if question is not TRUE_TIP or not blind:
        return tr(question.caption)
    return ngettext(
        "{caption}; {models} knows no fingertip but the distal receiver's origin",
        "{caption}; {models} know no fingertip but the distal receiver's origin",
        len(blind),
        caption=tr(question.caption),
        models=listed(blind),
    )


def models_by_digit(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel for each thing that skeletons are judged by. Raises NoDataError without a score."""
    judged = judgements(results)
    if not judged:
        raise NoDataError(tr("no model of this study has a score; see skeleton_scores and problems"))
    panels: list[Panel] = []
    sentences: list[str] = []
    for own in judged:
        each = replace(own, references=tuple(name for name in own.references if name != TRUE))
        digits = [digit for digit in each.by_digit if digit != ALL_DIGITS]
        panel = value_panel(each, looks_of(results, each), digits)
        counts = count_range(len(numbers) for digit in digits for numbers in each.by_digit[digit].values())
        panels.append(replace(panel, heading=tr("n = {n} subjects", n=counts)))
        text = tr(
            "{text} [mm]; n = {counts} subjects.",
            text=title(_text(results, each.question)),
            counts=counts,
        )
        sentences.append(f"{text} {missing_text_of(each)}".strip())
    references = dict.fromkeys(name for each in judged for name in each.references if name != TRUE)
    caption = (
        tr(
            "Error of skeleton models by digit. {study_text} A dot is a subject, the mean over hands "
            "and recordings; mark: median; bar: quartiles, from {FEWEST_FOR_QUARTILES} subjects on. ",
            study_text=study_text(results),
            FEWEST_FOR_QUARTILES=FEWEST_FOR_QUARTILES,
        )
        + (tr("In grey {references}, for reference. ", references=listed(references)) if references else "")
        + f"{judged[0].kind} {lettered(sentences)}"
    )
    return print_figure(in_rows(panels, 2)), caption


def paired_differences(results: StudyResults, base: str = "") -> tuple[Figure, str]:
    """Draw every model less `base`: unless named the paper's skeleton, or else the study's first model.

    Where the truth is not known, fitted hands' left-out errors are held against the reference prior-only:
    a replay's are another test. Raises NoDataError where no two models have numbers of one subject, and
    InputError where the study has no such model.
    """
    if base and base not in results.models:
        raise InputError(f"--against {base}: no such model; expected one of {', '.join(results.models)}")
    compared = [each for each in judgements(results, base) if each.overall]
    if not compared:
        raise NoDataError(tr("no subject has numbers of two models that can be compared"))
    panels: list[Panel] = []
    for each in compared:
        panel = difference_panel(each, looks_of(results, each), [ALL_DIGITS])
        assert panel is not None  # it has comparisons over all digits
        n = count_range(own.n for own in each.overall)
        panels.append(replace(panel, heading=tr("n = {n} subjects", n=n)))
    return print_figure(in_rows(panels, 1), figure_mm=ONE_COLUMN_MM), _differences_caption(results, compared)


def _differences_caption(results: StudyResults, panels: list[Answer]) -> str:
    few = any(own.interval is None for each in panels for own in each.overall)
    parts = [
        tr(
            "Differences between skeleton models, subject by subject. {study_text}",
            study_text=study_text(results),
        )
    ]
    parts.append(
        tr(
            "A dot is a subject: the mean over the places (a digit in a recording, or a joint) in "
            "which both models have a number. Below 0 the model named at the left does better. Mark: "
            "mean; bar: 95 % interval of the mean, expanded percentile bootstrap over subjects"
        )
        + (
            tr(" (none is drawn of fewer than {FEWEST_SUBJECTS} subjects).", FEWEST_SUBJECTS=FEWEST_SUBJECTS)
            if few
            else "."
        )
    )
    parts.append(tr("p: two-sided sign-flip test, corrected by Holm within a panel."))
    parts.append(panels[0].kind)
    parts.append(lettered([_panel_text(results, panel) for panel in panels]))
    return " ".join(parts)


def _panel_text(results: StudyResults, judge: Answer) -> str:
    parts = "; ".join(_difference(comparison) for comparison in judge.overall)
    text = tr(
        "{text}; less that of {baseline}: {parts}.",
        text=title(_text(results, judge.question)),
        baseline=judge.baseline,
        parts=parts,
    )
    return " ".join(filter(None, [text, missing_text_of(judge)]))


def _difference(own: Comparison) -> str:
    amount = tr("{model} {mean} mm", model=own.model, mean=number(own.mean_difference))
    if own.interval is None:
        return tr("{amount} (n = {n})", amount=amount, n=own.n)
    low, high = own.interval
    p = f", {p_text(own.p_holm)}"
    return tr(
        "{amount} ({low} to {high}, n = {n}{p})",
        amount=amount,
        low=number(low),
        high=number(high),
        n=own.n,
        p=p,
    )
