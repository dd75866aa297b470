"""A study's figures of models: what judges them, their errors by digit, and their differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from schemas.errors import InputError
from stages.report.comparison.answers import Answer, answer
from stages.report.comparison.comparison_text import Tested, missing_sentences, p_text, with_statistics
from stages.report.comparison.comparisons import ALL_DIGITS, Comparison
from stages.report.comparison.questions import JOINT_ERROR, LEFT_OUT, REPLAY, TRUE, TRUE_TIP, Question
from stages.report.palette import SOFT, model_looks
from stages.report.print_figures.drawing import NoDataError, count_range, study_text
from stages.report.print_figures.style import (
    FEWEST_FOR_QUARTILES,
    ONE_COLUMN_MM,
    TWO_COLUMNS_MM,
    Array,
    dots,
    error_axis,
    headings,
    label,
    lettered,
    model_handles,
    new_figure,
    scattered,
    stacked,
    summary,
)
from stages.report.study_results import StudyResults
from stages.report.table_cells import listed, number, title
from stages.report.wording import say
from subject_statistics.paired_statistics import FEWEST_SUBJECTS, Paired

if TYPE_CHECKING:
    pass


def judgements(results: StudyResults, baseline: str = "") -> list[Answer]:
    """What this study's skeletons are judged by; empty where no model has a score."""
    for questions in ((TRUE_TIP, JOINT_ERROR), (LEFT_OUT, REPLAY)):
        found = [own for each in questions if (own := answer(results, each, baseline)) is not None]
        if found:
            return found
    return []


def missing_text_of(own: Answer) -> str:
    """Which numbers of the models are not there and why; empty where all are."""
    sentences = missing_sentences(own.overall)
    return say("Without a number: {sentences}", sentences=" ".join(sentences)) if sentences else ""


def references_of(own: Answer) -> tuple[str, ...]:
    """References to draw; a true skeleton is no reference to beat."""
    return tuple(name for name in own.question.references if name in own.names and name != TRUE)


def _text(results: StudyResults, question: Question) -> str:
    """What the number is, in a sentence's words."""
    blind = [model for model in results.models if model not in results.fitted]
    if question is not TRUE_TIP or not blind:
        return say(question.caption)
    verb = "knows" if len(blind) == 1 else "know"
    return say(
        "{caption}; {blind} {verb} no fingertip but the distal receiver's origin",
        caption=say(question.caption),
        blind=listed(blind),
        verb=verb,
    )


_PANEL_MM, _LEGEND_MM = 52.0, 12.0
_GROUP, _WIDEST = 0.84, 0.2
_REFERENCE_LINES = ((0, (4, 1.5)), (0, (1, 1)))


def models_by_digit(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel for each thing that skeletons are judged by. Raises NoDataError without a score."""
    judged = judgements(results)
    if not judged:
        raise NoDataError(say("no model of this study has a score; see skeleton_scores and problems"))
    figure = new_figure(TWO_COLUMNS_MM, _LEGEND_MM + _PANEL_MM * len(judged))
    panels = stacked(figure, len(judged))
    sentences: list[str] = []
    counts: list[str] = []
    for each, axes in zip(judged, panels, strict=True):
        counts.append(_digit_panel(axes, results, each))
        text = say(
            "{text} [mm]; n = {counts} subjects.",
            text=title(_text(results, each.question)),
            counts=counts[-1],
        )
        sentences.append(f"{text} {missing_text_of(each)}".strip())
    headings(panels, [say("n = {n} subjects", n=n) for n in counts])
    models = [name for name in results.models if any(name in each.models for each in judged)]
    handles = model_handles(model_looks(list(results.models)), models)
    references = dict.fromkeys(name for each in judged for name in references_of(each))
    handles += [
        Line2D([], [], color=SOFT, linestyle=style, label=name)
        for name, style in zip(references, _REFERENCE_LINES, strict=False)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    caption = (
        say(
            (
                "Error of skeleton models by digit. {study_text} A dot is a subject, the mean over hands "
                "and recordings; mark: median; bar: quartiles, from {FEWEST_FOR_QUARTILES} subjects on. "
            ),
            study_text=study_text(results),
            FEWEST_FOR_QUARTILES=FEWEST_FOR_QUARTILES,
        )
        + (
            say("Grey lines: median of {references}, for reference. ", references=listed(references))
            if references
            else ""
        )
        + f"{judged[0].kind} {lettered(sentences)}"
    )
    return figure, caption


def _digit_panel(axes: Axes, results: StudyResults, own: Answer) -> str:
    """One panel; gives the number of subjects as text."""
    models = own.models
    means = {digit: of for digit, of in own.by_digit.items() if digit != ALL_DIGITS}
    look, order = model_looks(list(results.models)), {name: i for i, name in enumerate(results.subjects)}
    aside = scattered(len(order), min(0.6 * _GROUP / len(models), _WIDEST))
    drawn, counts = [], []
    for place, of_model in enumerate(means.values()):
        for index, model in enumerate(models):
            of_subject = of_model.get(model, {})
            if not of_subject:
                continue
            x = place + ((index + 0.5) / len(models) - 0.5) * _GROUP
            values = np.array(list(of_subject.values()))
            dots(axes, x + aside[[order[name] for name in of_subject]], values, look[model].colour)
            summary(axes, x, values, look[model], look[model].size)
            drawn.append(values)
            counts.append(len(values))
        drawn += _references(axes, references_of(own), of_model, place)
    _digit_axis(axes, list(means))
    error_axis(axes, drawn)
    axes.set_ylabel(say(own.question.axis))
    return count_range(counts)


def _references(
    axes: Axes, references: Sequence[str], of_model: Mapping[str, Mapping[str, float]], place: int
) -> list[Array]:
    """Medians of the references across the digit's group; gives what was drawn."""
    drawn = []
    for name, style in zip(references, _REFERENCE_LINES, strict=False):
        of_subject = of_model.get(name, {})
        if of_subject:
            median = np.median(list(of_subject.values()))
            ends = [place - _GROUP / 2, place + _GROUP / 2]
            axes.plot(ends, [median, median], color=SOFT, linestyle=style, zorder=1.5)
            drawn.append(np.atleast_1d(median))
    return drawn


def _digit_axis(axes: Axes, digits: Sequence[str]) -> None:
    axes.set_xlim(-0.5, len(digits) - 0.5)
    axes.set_xticks(range(len(digits)), [label(title(digit)) for digit in digits])
    axes.tick_params(axis="x", length=0)
    for edge in range(1, len(digits)):
        axes.axvline(edge - 0.5, color="0.88", linewidth=0.5, zorder=0)


_ROW_MM, _FOOT_MM = 6.0, 17.0


_Panel = tuple[Answer, list[Tested]]
"""One axis of differences: what is judged, and the comparisons that have a number."""


def paired_differences(results: StudyResults, base: str = "") -> tuple[Figure, str]:
    """Draw every model less `base`: unless named the paper's skeleton, or else the study's first model.

    Where the truth is not known, fitted hands' left-out errors are held against the reference prior-only:
    a replay's are another test. Raises NoDataError where no two models have numbers of one subject, and
    InputError where the study has no such model.
    """
    if base and base not in results.models:
        raise InputError(f"--against {base}: no such model; expected one of {', '.join(results.models)}")
    judged = [(each, with_statistics(each.overall)) for each in judgements(results, base)]
    panels = [(each, compared) for each, compared in judged if compared]
    if not panels:
        raise NoDataError(say("no subject has numbers of two models that can be compared"))
    rows = [len(compared) for _, compared in panels]
    figure = new_figure(ONE_COLUMN_MM, sum(_FOOT_MM + _ROW_MM * n for n in rows))
    drawn = stacked(figure, len(panels), height_ratios=rows)
    for panel, axes in zip(panels, drawn, strict=True):
        _draw_differences(axes, results, panel)
    counts = [count_range(own.n for _, own in compared) for _, compared in panels]
    headings(drawn, [say("n = {n} subjects", n=n) for n in counts])
    return figure, _differences_caption(results, panels)


def _draw_differences(axes: Axes, results: StudyResults, panel: _Panel) -> None:
    """A row a model, the first on top."""
    judge, compared = panel
    look, order = model_looks(list(results.models)), {name: i for i, name in enumerate(results.subjects)}
    aside = scattered(len(order), 0.5)
    for row, (comparison, statistics) in enumerate(compared):
        own = look[comparison.model]
        differences = _differences(comparison)
        y = row + aside[[order[pair.subject] for pair in comparison.compared]]
        dots(axes, differences, y, own.colour)
        if statistics.interval is not None:
            axes.plot(
                statistics.interval, [row, row], color="black", linewidth=1.2, solid_capstyle="butt", zorder=3
            )
        axes.plot(
            [statistics.mean], [row], own.marker, color=own.colour, markersize=own.size,
            markeredgecolor="black", markeredgewidth=0.6, linestyle="none", zorder=4,
        )  # fmt: skip
    axes.axvline(0.0, color="black", linewidth=0.6, zorder=1)
    everything = np.concatenate([_differences(comparison) for comparison, _ in compared])
    low, high = min(0.0, float(everything.min())), max(0.0, float(everything.max()))
    pad = 0.06 * (high - low or 1.0)
    axes.set_xlim(low - pad, high + pad)
    axes.set_ylim(len(compared) - 0.5, -0.5)
    axes.set_yticks(range(len(compared)), [label(comparison.model) for comparison, _ in compared])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")
    axes.set_xlabel(
        say(
            "{axis} less that of\n{baseline} [mm]",
            axis=say(judge.question.axis).removesuffix(" [mm]"),
            baseline=label(judge.baseline),
        )
    )


def _differences(comparison: Comparison) -> Array:
    return np.array([pair.difference for pair in comparison.compared], float)


def _differences_caption(results: StudyResults, panels: list[_Panel]) -> str:
    few = any(statistics.interval is None for _, compared in panels for _, statistics in compared)
    parts = [
        say(
            "Differences between skeleton models, subject by subject. {study_text}",
            study_text=study_text(results),
        )
    ]
    parts.append(
        say(
            "A dot is a subject: the mean over the places (a digit in a recording, or a joint) in "
            "which both models have a number. Below 0 the model named at the left does better. Mark: "
            "mean; bar: 95 % interval of the mean, expanded percentile bootstrap over subjects"
        )
        + (
            say(" (none is drawn of fewer than {FEWEST_SUBJECTS} subjects).", FEWEST_SUBJECTS=FEWEST_SUBJECTS)
            if few
            else "."
        )
    )
    parts.append(say("p: two-sided sign-flip test, corrected by Holm within a panel."))
    parts.append(panels[0][0].kind)
    parts.append(lettered([_panel_text(results, panel) for panel in panels]))
    return " ".join(parts)


def _panel_text(results: StudyResults, panel: _Panel) -> str:
    judge, compared = panel
    parts = "; ".join(_difference(comparison, statistics) for comparison, statistics in compared)
    text = say(
        "{text}; less that of {baseline}: {parts}.",
        text=title(_text(results, judge.question)),
        baseline=judge.baseline,
        parts=parts,
    )
    return " ".join(filter(None, [text, missing_text_of(judge)]))


def _difference(comparison: Comparison, statistics: Paired) -> str:
    amount = say("{model} {mean} mm", model=comparison.model, mean=number(statistics.mean))
    if statistics.interval is None:
        return say("{amount} (n = {n})", amount=amount, n=statistics.n)
    low, high = statistics.interval
    p = "" if comparison.p_holm is None else f", {p_text(comparison.p_holm)}"
    return say(
        "{amount} ({low} to {high}, n = {n}{p})",
        amount=amount,
        low=number(low),
        high=number(high),
        n=statistics.n,
        p=p,
    )
