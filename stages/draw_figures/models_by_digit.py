"""The error of every model, digit by digit: each subject a dot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.judging import Judge, Means, gaps_in_words, judges, seen_by, subject_means
from stages.draw_figures.marks import (
    FEWEST_FOR_QUARTILES,
    Array,
    dots,
    error_axis,
    model_handles,
    scattered,
    summary,
)
from stages.draw_figures.style import (
    GREY,
    TWO_COLUMNS_MM,
    headings,
    label,
    lettered,
    looks,
    new_figure,
    stacked,
)
from stages.draw_figures.words import capital, n_in_words, whose
from stages.report.data_table import listed
from stages.report.study_results import StudyResults

_PANEL_MM, _LEGEND_MM = 52.0, 12.0
_GROUP, _WIDEST = 0.84, 0.2
_REFERENCE_LINES = ((0, (4, 1.5)), (0, (1, 1)))


def models_by_digit(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel for each thing that skeletons are judged by. Raises NoDataError without a score."""
    seen = [(judge, seen_by(results, judge)) for judge in judges(results)]
    if not seen:
        raise NoDataError("no model of this study has a score; see skeleton_scores and problems")
    figure = new_figure(TWO_COLUMNS_MM, _LEGEND_MM + _PANEL_MM * len(seen))
    panels = stacked(figure, len(seen))
    sentences: list[str] = []
    counts: list[str] = []
    for (judge, observations), axes in zip(seen, panels, strict=True):
        counts.append(_panel(axes, results, judge, subject_means(observations)))
        lacking = gaps_in_words(observations, judge.models)
        sentences.append(f"{capital(judge.words)} [mm]; n = {counts[-1]} subjects. {lacking}".strip())
    headings(panels, [f"n = {n} subjects" for n in counts])
    models = [name for name in results.models if any(name in judge.models for judge, _ in seen)]
    handles = model_handles(looks(list(results.models)), models)
    references = dict.fromkeys(name for judge, _ in seen for name in judge.references)
    handles += [
        Line2D([], [], color=GREY, linestyle=style, label=name)
        for name, style in zip(references, _REFERENCE_LINES, strict=False)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    caption = (
        f"Error of skeleton models by digit. {whose(results)} A dot is a subject, the mean over hands and "
        f"recordings; mark: median; bar: quartiles, from {FEWEST_FOR_QUARTILES} subjects on. "
        + (f"Grey lines: median of {listed(references)}, for reference. " if references else "")
        + f"{seen[0][0].kind} {lettered(sentences)}"
    )
    return figure, caption


def _panel(axes: Axes, results: StudyResults, judge: Judge, means: Means) -> str:
    """One panel; gives the number of subjects in words."""
    digits = list(dict.fromkeys(digit for _, digit in means))
    look, order = looks(list(results.models)), {name: i for i, name in enumerate(results.subjects)}
    aside = scattered(len(order), min(0.6 * _GROUP / len(judge.models), _WIDEST))
    drawn, counts = [], []
    for place, digit in enumerate(digits):
        for index, model in enumerate(judge.models):
            of_subject = means.get((model, digit), {})
            if not of_subject:
                continue
            x = place + ((index + 0.5) / len(judge.models) - 0.5) * _GROUP
            values = np.array(list(of_subject.values()))
            dots(axes, x + aside[[order[name] for name in of_subject]], values, look[model].colour)
            summary(axes, x, values, look[model], look[model].size)
            drawn.append(values)
            counts.append(len(values))
        drawn += _references(axes, judge.references, means, place, digit)
    _digit_axis(axes, digits)
    error_axis(axes, drawn)
    axes.set_ylabel(judge.axis)
    return n_in_words(counts)


def _references(axes: Axes, references: Sequence[str], means: Means, place: int, digit: str) -> list[Array]:
    """Medians of the references across the digit's group; gives what was drawn."""
    drawn = []
    for name, style in zip(references, _REFERENCE_LINES, strict=False):
        of_subject = means.get((name, digit), {})
        if of_subject:
            median = np.median(list(of_subject.values()))
            ends = [place - _GROUP / 2, place + _GROUP / 2]
            axes.plot(ends, [median, median], color=GREY, linestyle=style, zorder=1.5)
            drawn.append(np.atleast_1d(median))
    return drawn


def _digit_axis(axes: Axes, digits: Sequence[str]) -> None:
    axes.set_xlim(-0.5, len(digits) - 0.5)
    axes.set_xticks(range(len(digits)), [label(capital(digit)) for digit in digits])
    axes.tick_params(axis="x", length=0)
    for edge in range(1, len(digits)):
        axes.axvline(edge - 0.5, color="0.88", linewidth=0.5, zorder=0)
