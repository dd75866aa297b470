"""The error of every model, digit by digit: each subject a dot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stages.report.comparison.comparisons import ALL_DIGITS
from stages.report.palette import SOFT, model_looks
from stages.report.print_figures.caption_text import capital, count_range, study_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.judging import Judgement, judgements
from stages.report.print_figures.marks import (
    FEWEST_FOR_QUARTILES,
    Array,
    dots,
    error_axis,
    model_handles,
    scattered,
    summary,
)
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, lettered, new_figure, stacked
from stages.report.study_results import StudyResults
from stages.report.table_cells import listed

_PANEL_MM, _LEGEND_MM = 52.0, 12.0
_GROUP, _WIDEST = 0.84, 0.2
_REFERENCE_LINES = ((0, (4, 1.5)), (0, (1, 1)))


def models_by_digit(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel for each thing that skeletons are judged by. Raises NoDataError without a score."""
    judged = judgements(results)
    if not judged:
        raise NoDataError("no model of this study has a score; see skeleton_scores and problems")
    figure = new_figure(TWO_COLUMNS_MM, _LEGEND_MM + _PANEL_MM * len(judged))
    panels = stacked(figure, len(judged))
    sentences: list[str] = []
    counts: list[str] = []
    for each, axes in zip(judged, panels, strict=True):
        counts.append(_panel(axes, results, each))
        sentences.append(f"{capital(each.text)} [mm]; n = {counts[-1]} subjects. {each.gaps}".strip())
    headings(panels, [f"n = {n} subjects" for n in counts])
    models = [name for name in results.models if any(name in each.answer.models for each in judged)]
    handles = model_handles(model_looks(list(results.models)), models)
    references = dict.fromkeys(name for each in judged for name in each.references)
    handles += [
        Line2D([], [], color=SOFT, linestyle=style, label=name)
        for name, style in zip(references, _REFERENCE_LINES, strict=False)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    caption = (
        f"Error of skeleton models by digit. {study_text(results)} A dot is a subject, the mean "
        f"over hands and "
        f"recordings; mark: median; bar: quartiles, from {FEWEST_FOR_QUARTILES} subjects on. "
        + (f"Grey lines: median of {listed(references)}, for reference. " if references else "")
        + f"{judged[0].kind} {lettered(sentences)}"
    )
    return figure, caption


def _panel(axes: Axes, results: StudyResults, judgement: Judgement) -> str:
    """One panel; gives the number of subjects as text."""
    models = judgement.answer.models
    means = {digit: own for digit, own in judgement.answer.by_digit.items() if digit != ALL_DIGITS}
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
        drawn += _references(axes, judgement.references, of_model, place)
    _digit_axis(axes, list(means))
    error_axis(axes, drawn)
    axes.set_ylabel(judgement.axis)
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
    axes.set_xticks(range(len(digits)), [label(capital(digit)) for digit in digits])
    axes.tick_params(axis="x", length=0)
    for edge in range(1, len(digits)):
        axes.axvline(edge - 0.5, color="0.88", linewidth=0.5, zorder=0)
