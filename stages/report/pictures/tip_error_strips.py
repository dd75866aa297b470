"""Tip errors over time: a strip a digit above a common time axis, a line a model; for pages and for print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from stages.report.palette import Look
from stages.report.pictures.marks import logarithmic, plain_numbers, trace_band
from stages.report.pictures.page_picture import inline_svg, page_figure, page_style
from stages.report.pictures.style import label
from stages.report.pictures.traces import Trace, error_scale, thin
from stages.report.table_cells import listed

Array = npt.NDArray[np.float64]
Traces = Mapping[str, Mapping[str, Trace]]
"""By digit, then by model."""

_WIDTH, _LEFT, _RIGHT, _STRIP, _GAP, _FOOT, _LEGEND_ROW = 480.0, 36.0, 52.0, 46.0, 8.0, 36.0, 16.0
_PAGE_COLUMNS = 150


def thinned_traces(
    frame: npt.NDArray[np.int64],
    time_s: Array,
    errors: Mapping[str, Mapping[str, Array]],
    columns: int = _PAGE_COLUMNS,
) -> dict[str, dict[str, Trace]]:
    """Thin errors (T,) by digit and model, mm; what is never known is left out."""
    made = {
        digit: {model: thin(frame.astype(float), time_s, values, columns) for model, values in own.items()}
        for digit, own in errors.items()
    }
    return {
        digit: {model: trace for model, trace in own.items() if trace is not None}
        for digit, own in made.items()
    }


def draw_strips(strips: Sequence[Axes], traces: Traces, looks: Mapping[str, Look], *, shaded: bool) -> None:
    """Draw every digit's traces into its own axes, which share one scale; shaded : down to the smallest
    value.
    """
    everything = [trace for of in traces.values() for trace in of.values()]
    scale = error_scale(everything)
    for of, axes in zip(traces.values(), strips, strict=True):
        for index, (model, trace) in enumerate(of.items()):
            _draw_trace(axes, trace, looks[model], index / len(of), index, shaded=shaded)
        if not of:
            axes.text(0.02, 0.5, "no tip error", transform=axes.transAxes, va="center")
        axes.margins(x=0.01)
        axes.grid(axis="y", clip_on=False)
        if scale.logarithmic:
            logarithmic(axes.yaxis, scale.low_mm, scale.high_mm)
        else:
            axes.set_ylim(0.0, scale.high_mm)
            axes.yaxis.set_major_locator(MaxNLocator(3))
            plain_numbers(axes.yaxis)


def _draw_trace(axes: Axes, trace: Trace, look: Look, phase: float, order: int, *, shaded: bool) -> None:
    x, low, high = trace_band(trace)
    if shaded:
        axes.fill_between(x, low, high, color=look.colour, alpha=0.12, linewidth=0)
    step = max(1, len(x) // 8)
    axes.plot(
        x, high, color=look.colour, linewidth=0.6 if shaded else 1.1, marker=look.marker,
        markersize=3.0 if shaded else 4.5, markevery=(int(phase * step), step), markeredgecolor="white",
        markeredgewidth=0.3, zorder=2.5 + order / 100,
    )  # fmt: skip


def time_label(traces: Traces) -> str:
    """What stands under the time axis."""
    trace = next(trace for of in traces.values() for trace in of.values())
    return "device time [s]" if trace.in_seconds else "frame"


def model_lines(looks: Mapping[str, Look], models: Sequence[str]) -> list[Line2D]:
    """Entries of a legend: a line with its mark a model."""
    return [
        Line2D([], [], color=looks[name].colour, marker=looks[name].marker, markersize=4.0, label=label(name))
        for name in models
    ]


def hidden_lines(traces: Traces, models: Sequence[str]) -> str:
    """Models whose lines are the same in every digit, so that the last hides the others."""
    groups: dict[tuple[bytes, ...], list[str]] = {}
    for model in models:
        lines = tuple(of[model].high_mm.tobytes() if model in of else b"" for of in traces.values())
        groups.setdefault(lines, []).append(model)
    hidden = [listed(group) for group in groups.values() if len(group) > 1]
    return f"Equal, so that the last hides the others: {'; '.join(hidden)}." if hidden else ""


def tip_error_picture(title: str, traces: Traces, looks: Mapping[str, Look]) -> Markup:
    """The strips for a page; every strip's span is the recording's. `title` is the text alternative."""
    models = [model for model in looks if any(model in of for of in traces.values())]
    top = 18 + _LEGEND_ROW * -(-max(1, len(models)) // 3)
    height = top + len(traces) * (_STRIP + _GAP) + _FOOT
    spans = [trace.span for of in traces.values() for trace in of.values()]
    with page_style():
        figure = page_figure(_WIDTH, height)
        strips: list[Axes] = []
        for index, digit in enumerate(traces):
            foot = height - top - index * (_STRIP + _GAP) - _STRIP
            box = np.array((_LEFT, foot, _WIDTH - _LEFT - _RIGHT, _STRIP)) / (_WIDTH, height, _WIDTH, height)
            strips.append(figure.add_axes(tuple(box)))
            strips[-1].spines[:].set_visible(False)
            strips[-1].tick_params(axis="x", labelbottom=False)
            strips[-1].text(1.02, 0.5, digit, transform=strips[-1].transAxes, va="center")
        draw_strips(strips, traces, looks, shaded=False)
        logarithmic_note = ", log scale" if strips and strips[0].get_yscale() == "log" else ""
        figure.text(0, 1 - 12 / height, f"tip error [mm]{logarithmic_note}")
        for axes in strips:
            axes.set_xlim(min(span[0] for span in spans), max(span[1] for span in spans)) if spans else None
        if spans:
            strips[-1].tick_params(axis="x", labelbottom=True)
            strips[-1].spines["bottom"].set_visible(True)
            strips[-1].set_xlabel(time_label(traces))
            figure.legend(
                handles=model_lines(looks, models), loc="upper left", ncols=3, borderaxespad=0,
                bbox_to_anchor=(0, 1 - 18 / height),
            )  # fmt: skip
        return inline_svg(figure, title)
