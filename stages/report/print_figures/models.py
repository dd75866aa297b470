"""The study's figure of its models: a dot a subject, a line through one subject's dots, the mean."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shukotsu.sentences.translation import listed, tr
from shukotsu.stages.report.judged_models import (
    LEFT_OUT,
    PRIOR,
    REPLAY,
    TRUTH,
    JudgedModels,
    judged_models,
)
from shukotsu.stages.report.palette import RULE, SOFT, Look, model_looks
from shukotsu.stages.report.plots.panels import Panel, in_rows, lettered, print_figure
from shukotsu.stages.report.plots.rows import FOOT_MM, Group, Row, Scale, draw_rows, scattered, value_scale
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, study_text
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import heading
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS, paired_difference

_ROW_MM = 6.0
"""High enough that a line through a subject's dots can be followed."""


def model_panels(results: StudyResults) -> list[Panel]:
    """Return a panel for each number that models are held against each other by: seen, then the truth."""
    found = {each.metric: each for each in judged_models(results)}
    metrics = [REPLAY, *([TRUTH, "true_tip_mean_mm"] if TRUTH in found else [LEFT_OUT])]
    return [_panel(results, found[metric]) for metric in metrics if metric in found]


def _panel(results: StudyResults, judged: JudgedModels) -> Panel:
    looks = model_looks(list(results.models)) | {PRIOR: Look(SOFT, "o")}
    rows = []
    for name in (name for name in (*results.models, PRIOR) if name in judged.values):
        numbers = judged.values[name]
        values = np.array(list(numbers.values()))
        interval = paired_difference(values).interval
        rows.append(Row(name, looks[name], numbers, float(values.mean()), interval))
    scale = value_scale([value for row in rows for value in row.values()])
    axis = heading(judged.metric) + (tr(", log scale") if scale.kind == "log" else "")
    title = tr("{quantity}, every subject under {names}.", quantity=heading(judged.metric),
               names=listed(row.name for row in rows))  # fmt: skip
    draw = partial(_draw, rows=rows, axis=axis, scale=scale, of_all=len(results.subjects))
    n = count_range(len(row.numbers) for row in rows)
    kind = (
        tr("n = {n} subjects, held out", n=n) if judged.held_out else tr("n = {n} subjects, in-sample", n=n)
    )
    return Panel(kind, title, _ROW_MM * (len(rows) + 1), FOOT_MM, draw)


def _draw(axes: Axes, rows: Sequence[Row], axis: str, scale: Scale, of_all: int) -> None:
    """Draw rows of dots, and a line through the dots of every subject."""
    draw_rows(axes, axis, scale, [Group("", tuple(rows))], of_all=of_all)
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    x = [[row.numbers.get(name, np.nan) for row in rows] + [np.nan] for name in names]
    y = [[*(aside + np.arange(len(rows))), np.nan] for aside in scattered(len(names))]
    floor = scale.low if scale.kind == "log" else -np.inf
    axes.plot(np.maximum(np.ravel(x), floor), np.ravel(y), color=RULE, linewidth=0.5, zorder=1.5)


def models(results: StudyResults) -> tuple[Figure, str]:
    """Draw the panels side by side. Raises NoDataError without a score."""
    panels = model_panels(results)
    if not panels:
        raise NoDataError(tr("no model of this study has a score; see skeleton_scores and problems"))
    headings = lettered([f"{panel.title.rstrip('.')}, {panel.heading}." for panel in panels])
    return print_figure(in_rows(panels, 2)), tr(
        "Skeleton models held against each other. {study_text} A dot is a subject, the mean over hands, "
        "recordings and digits, and a line goes through one subject's dots; mark: mean; bar: its 95 % "
        "interval, from {n} subjects on. The replay's error says how well joints close and not where they "
        "are. {headings}",
        study_text=study_text(results),
        n=FEWEST_SUBJECTS,
        headings=headings,
    )
