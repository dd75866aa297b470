"""One recording's tip error over time: a strip a digit, a line a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from schemas.errors import InputError
from schemas.poses import read_poses
from schemas.study import Recording
from stages.report.hand_motion import view_base
from stages.report.palette import Look, model_looks
from stages.report.pictures.tip_error_strips import (
    Traces,
    hidden_lines,
    thinned_traces,
    time_label,
)
from stages.report.pictures.traces import Trace, error_scale, trace_band
from stages.report.print_figures.caption_text import capital, count_range, recording_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.marks import columns_for, logarithmic, plain_numbers
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, new_figure, stacked
from stages.report.recording_results import Array, read_tip_errors
from stages.report.score_tables import mean
from stages.report.study_results import LEAST_SQUARES, StudyResults, recording_key
from stages.report.table_cells import listed, number

_STRIP_MM, _FOOT_MM = 26.0, 22.0


def tip_error(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the strips. Raises NoDataError where no model replayed the recording."""
    traces = _traces(results, recording)
    if not any(traces.values()):
        raise NoDataError("no model has a tip error in this recording")
    looks = model_looks(list(results.models))
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _STRIP_MM * len(traces))
    strips = stacked(figure, len(traces), sharex=True, sharey=True)
    _draw_strips(strips, traces, looks)
    headings(strips, [label(capital(digit)) for digit in traces])
    strips[-1].set_xlabel(capital(time_label(traces)))
    figure.supylabel("Tip error [mm]", fontsize="medium")
    models = [model for model in results.models if any(model in of for of in traces.values())]
    figure.legend(handles=_model_lines(looks, models), loc="outside upper center", ncols=4)
    return figure, _caption(results, recording, traces, models)


def _draw_strips(strips: Sequence[Axes], traces: Traces, looks: Mapping[str, Look]) -> None:
    """Draw every digit's traces into its own axes, which share one scale."""
    everything = [trace for of in traces.values() for trace in of.values()]
    scale = error_scale(everything)
    for of, axes in zip(traces.values(), strips, strict=True):
        for index, (model, trace) in enumerate(of.items()):
            _draw_trace(axes, trace, looks[model], index / len(of), index)
        if not of:
            axes.text(0.02, 0.5, "no tip error", transform=axes.transAxes, va="center")
        axes.margins(x=0.01)
        axes.grid(axis="y", clip_on=False)
        if scale.kind == "log":
            logarithmic(axes.yaxis, scale.low, scale.high)
        else:
            axes.set_ylim(0.0, scale.high)
            axes.yaxis.set_major_locator(MaxNLocator(3))
            plain_numbers(axes.yaxis)


def _draw_trace(axes: Axes, trace: Trace, look: Look, phase: float, order: int) -> None:
    x, low, high = trace_band(trace)
    axes.fill_between(x, low, high, color=look.colour, alpha=0.12, linewidth=0)
    step = max(1, len(x) // 8)
    axes.plot(
        x, high, color=look.colour, linewidth=0.6, marker=look.marker,
        markersize=3.0, markevery=(int(phase * step), step), markeredgecolor="white",
        markeredgewidth=0.3, zorder=2.5 + order / 100,
    )  # fmt: skip


def _model_lines(looks: Mapping[str, Look], models: Sequence[str]) -> list[Line2D]:
    """Entries of a legend: a line with its mark a model."""
    return [
        Line2D([], [], color=looks[name].colour, marker=looks[name].marker, markersize=4.0, label=label(name))
        for name in models
    ]


def _traces(results: StudyResults, recording: Recording) -> dict[str, dict[str, Trace]]:
    layout = results.layouts[recording.hand]
    of_model: dict[str, dict[str, Array]] = {}
    for model in results.models:
        with suppress(InputError):  # the caption names models without a tip error
            of_model[model] = read_tip_errors(results, recording, model)
    if not of_model:
        return {}
    poses = read_poses(results.poses(recording), [view_base(layout)])
    errors = {
        digit: {model: own[digit] for model, own in of_model.items() if digit in own}
        for digit in layout.digits
    }
    columns = columns_for(len(layout.digits) * len(results.models))
    return thinned_traces(poses.frame, poses.time_s, errors, columns)


def _caption(results: StudyResults, recording: Recording, traces: Traces, models: list[str]) -> str:
    rows = [
        row
        for row in results.tip_errors
        if row["binding"] == LEAST_SQUARES
        and row["mean_mm"] is not None
        and (row["subject"], row["hand"], row["task"], row["trial"]) == recording_key(recording)
    ]
    means = [
        f"{model} {number(mean(row['mean_mm'] for row in rows if row['model'] == model))} mm"
        for model in models
    ]
    n = count_range([row["n_frames"] for row in rows] or [0])
    hidden = hidden_lines(traces, models)
    without = [
        f"{digit} ({listed([model for model in models if model not in of])})"
        for digit, of in traces.items()
        if any(model not in of for model in models)
    ]
    return (
        f"Tip error over time of {recording_text(recording)}. Distance from the fingertip, replayed from "
        f"the receivers with the least-squares binding, to the distal receiver [mm]; n = {n} frames a "
        "digit. Line: the largest value of every stretch of time that print can resolve; shade: down to the "
        "smallest; both broken where frames are missing. Marks tell lines apart and are no samples. Mean "
        f"over digits: {'; '.join(means)}. The tip error says how well the joints close and not where they "
        f"are.{f' {hidden}' if hidden else ''}"
        + (f" Without a tip error: {listed(without)}." if without else "")
    )
