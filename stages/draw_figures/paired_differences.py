"""Each model less one of them, subject by subject: mean and 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from schemas.errors import InputError
from schemas.model import the_papers
from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.judging import PRIOR, Judge, judges
from stages.draw_figures.marks import Array, dots, scattered
from stages.draw_figures.style import ONE_COLUMN_MM, headings, label, lettered, looks, new_figure, stacked
from stages.draw_figures.words import capital, n_in_words, whose
from stages.report.comparison import (
    ALL_DIGITS,
    FEWEST_SUBJECTS,
    Comparison,
    Paired,
    missing_in_words,
    study_comparisons,
)
from stages.report.comparison_words import p_in_words
from stages.report.data_table import number
from stages.report.study_results import StudyResults

_ROW_MM, _FOOT_MM = 6.0, 17.0
MOST_TOLD = 4


@dataclass(frozen=True)
class _Panel:
    """One axis of differences: what from, and the comparisons that have a number."""

    judge: Judge
    base: str
    found: tuple[tuple[Comparison, Paired], ...]


def paired_differences(results: StudyResults, base: str = "") -> tuple[Figure, str]:
    """Draw every model less `base`: unless named the paper's skeleton, or else the study's first model.

    Where the truth is not known, fitted hands' left-out errors are held against the reference prior-only:
    a replay's are another test. Raises NoDataError where no two models have numbers of one subject, and
    InputError where the study has no such model.
    """
    if base and base not in results.models:
        raise InputError(f"--against {base}: no such model; expected one of {', '.join(results.models)}")
    panels = [panel for judge in judges(results) if (panel := _compared(results, judge, base)).found]
    if not panels:
        raise NoDataError("no subject has numbers of two models that can be compared")
    rows = [len(panel.found) for panel in panels]
    figure = new_figure(ONE_COLUMN_MM, sum(_FOOT_MM + _ROW_MM * n for n in rows))
    drawn = stacked(figure, len(panels), height_ratios=rows)
    for panel, axes in zip(panels, drawn, strict=True):
        _draw(axes, results, panel)
    counts = [n_in_words(found.n for _, found in panel.found) for panel in panels]
    headings(drawn, [f"n = {n} subjects" for n in counts])
    return figure, _caption(results, panels)


def _compared(results: StudyResults, judge: Judge, base: str) -> _Panel:
    left_out = judge.metric.name == "left_out_mean_mm"
    base = PRIOR if left_out else base or the_papers(results.models.values()) or next(iter(results.models))
    pairs = [(model, base) for model in judge.models if model != base]
    made = study_comparisons(results, judge.metric, held_out=judge.held_out, pairs=pairs, digits={ALL_DIGITS})
    return _Panel(judge, base, tuple((each, each.found) for each in made if each.found is not None))


def _draw(axes: Axes, results: StudyResults, panel: _Panel) -> None:
    """A row a model, the first on top."""
    look, order = looks(list(results.models)), {name: i for i, name in enumerate(results.subjects)}
    aside = scattered(len(order), 0.5)
    for row, (comparison, found) in enumerate(panel.found):
        own = look[comparison.model]
        differences = _differences(comparison)
        y = row + aside[[order[pair.subject] for pair in comparison.compared]]
        dots(axes, differences, y, own.colour)
        if found.interval is not None:
            axes.plot(
                found.interval, [row, row], color="black", linewidth=1.2, solid_capstyle="butt", zorder=3
            )
        axes.plot(
            [found.mean], [row], own.marker, color=own.colour, markersize=own.size, markeredgecolor="black",
            markeredgewidth=0.6, linestyle="none", zorder=4,
        )  # fmt: skip
    axes.axvline(0.0, color="black", linewidth=0.6, zorder=1)
    everything = np.concatenate([_differences(comparison) for comparison, _ in panel.found])
    low, high = min(0.0, float(everything.min())), max(0.0, float(everything.max()))
    pad = 0.06 * (high - low or 1.0)
    axes.set_xlim(low - pad, high + pad)
    axes.set_ylim(len(panel.found) - 0.5, -0.5)
    axes.set_yticks(range(len(panel.found)), [label(comparison.model) for comparison, _ in panel.found])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")
    axes.set_xlabel(f"{panel.judge.axis.removesuffix(' [mm]')} less that of\n{label(panel.base)} [mm]")


def _differences(comparison: Comparison) -> Array:
    return np.array([pair.difference for pair in comparison.compared], float)


def _caption(results: StudyResults, panels: list[_Panel]) -> str:
    few = any(found.interval is None for panel in panels for _, found in panel.found)
    parts = [f"Differences between skeleton models, subject by subject. {whose(results)}"]
    parts.append(
        "A dot is a subject: the mean over the places (a digit in a recording, or a joint) in which both "
        "models have a number. Below 0 the model named at the left does better. Mark: mean; bar: 95 % "
        "interval of the mean, expanded percentile bootstrap over subjects"
        + (f" (none is drawn of fewer than {FEWEST_SUBJECTS} subjects)." if few else ".")
    )
    parts.append("p: two-sided sign-flip test, corrected by Holm within a panel.")
    parts.append(panels[0].judge.kind)
    parts.append(lettered([_panel_in_words(panel) for panel in panels]))
    return " ".join(parts)


def _panel_in_words(panel: _Panel) -> str:
    told = "; ".join(_told(comparison, found) for comparison, found in panel.found)
    words = f"{capital(panel.judge.words)}; less that of {panel.base}: {told}."
    return " ".join([words, *_not_compared(panel)])


def _told(comparison: Comparison, found: Paired) -> str:
    amount = f"{comparison.model} {number(found.mean)} mm"
    if found.interval is None:
        return f"{amount} (n = {found.n})"
    low, high = found.interval
    p = "" if comparison.p_holm is None else f", {p_in_words(comparison.p_holm)}"
    return f"{amount} ({number(low)} to {number(high)}, n = {found.n}{p})"


def _not_compared(panel: _Panel) -> list[str]:
    """Who is not in it and why, once for all models; then in how many places the others were compared."""
    gone: dict[str, str] = {}
    for comparison, _ in panel.found:
        for pair in comparison.subjects:
            if pair.difference is None:
                gone.setdefault(pair.subject, missing_in_words(pair.missing))
    told = [f"{subject} ({reason})" for subject, reason in list(gone.items())[:MOST_TOLD]]
    told += [f"{len(gone) - MOST_TOLD} more"] if len(gone) > MOST_TOLD else []
    return [f"Not compared: {', '.join(told)}."] if told else []
