"""Each model less one of them, subject by subject: mean and 95 % interval."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from schemas.errors import InputError
from stages.report.comparison.comparison_text import Tested, p_text, with_statistics
from stages.report.comparison.comparisons import Comparison, missing_text
from stages.report.comparison.paired_statistics import FEWEST_SUBJECTS, Paired
from stages.report.palette import model_looks
from stages.report.print_figures.caption_text import capital, count_range, study_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.judging import Judgement, judgements
from stages.report.print_figures.marks import Array, dots, scattered
from stages.report.print_figures.style import ONE_COLUMN_MM, headings, label, lettered, new_figure, stacked
from stages.report.study_results import StudyResults
from stages.report.table_cells import number

_ROW_MM, _FOOT_MM = 6.0, 17.0
MOST_NAMED = 4


_Panel = tuple[Judgement, list[Tested]]
"""One axis of differences: what is judged, and the comparisons that have a number."""


def paired_differences(results: StudyResults, base: str = "") -> tuple[Figure, str]:
    """Draw every model less `base`: unless named the paper's skeleton, or else the study's first model.

    Where the truth is not known, fitted hands' left-out errors are held against the reference prior-only:
    a replay's are another test. Raises NoDataError where no two models have numbers of one subject, and
    InputError where the study has no such model.
    """
    if base and base not in results.models:
        raise InputError(f"--against {base}: no such model; expected one of {', '.join(results.models)}")
    judged = [(each, with_statistics(each.answer.overall)) for each in judgements(results, base)]
    panels = [(each, compared) for each, compared in judged if compared]
    if not panels:
        raise NoDataError("no subject has numbers of two models that can be compared")
    rows = [len(compared) for _, compared in panels]
    figure = new_figure(ONE_COLUMN_MM, sum(_FOOT_MM + _ROW_MM * n for n in rows))
    drawn = stacked(figure, len(panels), height_ratios=rows)
    for panel, axes in zip(panels, drawn, strict=True):
        _draw(axes, results, panel)
    counts = [count_range(own.n for _, own in compared) for _, compared in panels]
    headings(drawn, [f"n = {n} subjects" for n in counts])
    return figure, _caption(results, panels)


def _draw(axes: Axes, results: StudyResults, panel: _Panel) -> None:
    """A row a model, the first on top."""
    judgement, compared = panel
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
        f"{judgement.axis.removesuffix(' [mm]')} less that of\n{label(judgement.answer.baseline)} [mm]"
    )


def _differences(comparison: Comparison) -> Array:
    return np.array([pair.difference for pair in comparison.compared], float)


def _caption(results: StudyResults, panels: list[_Panel]) -> str:
    few = any(statistics.interval is None for _, compared in panels for _, statistics in compared)
    parts = [f"Differences between skeleton models, subject by subject. {study_text(results)}"]
    parts.append(
        "A dot is a subject: the mean over the places (a digit in a recording, or a joint) in which both "
        "models have a number. Below 0 the model named at the left does better. Mark: mean; bar: 95 % "
        "interval of the mean, expanded percentile bootstrap over subjects"
        + (f" (none is drawn of fewer than {FEWEST_SUBJECTS} subjects)." if few else ".")
    )
    parts.append("p: two-sided sign-flip test, corrected by Holm within a panel.")
    parts.append(panels[0][0].kind)
    parts.append(lettered([_panel_text(panel) for panel in panels]))
    return " ".join(parts)


def _panel_text(panel: _Panel) -> str:
    judgement, compared = panel
    parts = "; ".join(_difference(comparison, statistics) for comparison, statistics in compared)
    text = f"{capital(judgement.text)}; less that of {judgement.answer.baseline}: {parts}."
    return " ".join(filter(None, [text, _not_compared(compared)]))


def _difference(comparison: Comparison, statistics: Paired) -> str:
    amount = f"{comparison.model} {number(statistics.mean)} mm"
    if statistics.interval is None:
        return f"{amount} (n = {statistics.n})"
    low, high = statistics.interval
    p = "" if comparison.p_holm is None else f", {p_text(comparison.p_holm)}"
    return f"{amount} ({number(low)} to {number(high)}, n = {statistics.n}{p})"


def _not_compared(compared: list[Tested]) -> str:
    """Who is not in it and why, once for all models; empty where all are."""
    left_out: dict[str, str] = {}
    for comparison, _ in compared:
        for pair in comparison.subjects:
            if pair.difference is None:
                left_out.setdefault(pair.subject, missing_text(pair.missing))
    named = [f"{subject} ({reason})" for subject, reason in left_out.items()]
    more = [f"{len(named) - MOST_NAMED} more"] if len(named) > MOST_NAMED else []
    return f"Not compared: {', '.join([*named[:MOST_NAMED], *more])}." if named else ""
