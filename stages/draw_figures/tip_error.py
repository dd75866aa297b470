"""One recording's tip error over time: a strip a digit, a line a model."""

from __future__ import annotations

import pyarrow.compute as pc
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from schemas.catalogue import TIPS
from schemas.study import Recording
from schemas.tables import column_array
from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.marks import columns_for, logarithmic, trace_band
from stages.draw_figures.recording_tables import rows_where
from stages.draw_figures.style import (
    SMALL_PT,
    TWO_COLUMNS_MM,
    Look,
    headings,
    label,
    looks,
    new_figure,
    stacked,
)
from stages.draw_figures.words import capital, n_in_words, of_recording, whose_recording
from stages.report.data_table import listed, number
from stages.report.error_chart import error_scale
from stages.report.score_tables import mean
from stages.report.study_results import LEAST_SQUARES, StudyResults
from stages.report.tip_traces import Trace, thin

_STRIP_MM, _FOOT_MM = 26.0, 22.0
_Traces = dict[str, dict[str, Trace]]
"""By digit, then by model."""


def tip_error(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the strips. Raises NoDataError where no model replayed the recording."""
    traces = _traces(results, recording)
    if not any(traces.values()):
        raise NoDataError("no model has a tip error in this recording")
    look = looks(list(results.models))
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _STRIP_MM * len(traces))
    strips = stacked(figure, len(traces), sharex=True, sharey=True)
    everything = [trace for of in traces.values() for trace in of.values()]
    scale = error_scale(everything)
    if scale.logarithmic:
        logarithmic(strips[0], scale.low_mm, scale.high_mm)
    else:
        strips[0].set_ylim(0.0, scale.high_mm)
    for of, axes in zip(traces.values(), strips, strict=True):
        _strip(axes, of, look)
    headings(strips, [label(capital(digit)) for digit in traces])
    strips[-1].set_xlabel("Device time [s]" if everything[0].in_seconds else "Frame")
    figure.supylabel("Tip error [mm]", fontsize="medium")
    models = [model for model in results.models if any(model in of for of in traces.values())]
    figure.legend(
        handles=[_handle(model, look[model]) for model in models], loc="outside upper center", ncols=4
    )
    return figure, _caption(results, recording, traces, models)


def _traces(results: StudyResults, recording: Recording) -> _Traces:
    digits, models = list(results.layouts[recording.hand].digits), list(results.models)
    columns = columns_for(len(digits) * len(models))
    key = of_recording(recording)
    found: _Traces = {digit: {} for digit in digits}
    data = rows_where(
        results.paths.study_table("tips"), TIPS, key, ["model", "digit", "frame", "time_s", "error_mm"]
    )
    frame, time_s, error_mm = (column_array(data, name) for name in ("frame", "time_s", "error_mm"))
    of_model = {model: pc.equal(data.column("model"), model).to_numpy() for model in models}
    for digit in digits:
        of_digit = pc.equal(data.column("digit"), digit).to_numpy()
        for model in models:
            own = of_digit & of_model[model]
            trace = thin(frame[own].astype(float), time_s[own], error_mm[own], columns) if own.any() else None
            if trace is not None:
                found[digit][model] = trace
    return found


def _strip(axes: Axes, traces: dict[str, Trace], look: dict[str, Look]) -> None:
    for index, (model, trace) in enumerate(traces.items()):
        x, low, y = trace_band(trace)
        axes.fill_between(x, low, y, color=look[model].colour, alpha=0.12, linewidth=0)
        step = max(1, len(x) // 8)
        axes.plot(
            x, y, color=look[model].colour, linewidth=0.6, marker=look[model].marker, markersize=3.0,
            markevery=(index * step // len(traces), step), markeredgecolor="white", markeredgewidth=0.3,
            zorder=2.5 + index / 100,
        )  # fmt: skip
    if not traces:
        axes.text(0.02, 0.5, "no tip error", transform=axes.transAxes, fontsize=SMALL_PT)
    axes.margins(x=0.01)
    axes.grid(axis="y")


def _handle(model: str, look: Look) -> Line2D:
    return Line2D([], [], color=look.colour, marker=look.marker, markersize=3.0, label=label(model))


def _caption(results: StudyResults, recording: Recording, traces: _Traces, models: list[str]) -> str:
    rows = [row for row in results.tip_errors if _is_of(row, recording) and row["mean_mm"] is not None]
    means = [
        f"{model} {number(mean(row['mean_mm'] for row in rows if row['model'] == model))} mm"
        for model in models
    ]
    n = n_in_words([row["n_frames"] for row in rows] or [0])
    hidden = _hidden(traces, models)
    without = [
        f"{digit} ({listed([model for model in models if model not in of])})"
        for digit, of in traces.items()
        if any(model not in of for model in models)
    ]
    return (
        f"Tip error over time of {whose_recording(recording)}. Distance from the fingertip, replayed from "
        f"the receivers with the least-squares binding, to the distal receiver [mm]; n = {n} frames a "
        "digit. Line: the largest value of every stretch of time that print can resolve; shade: down to the "
        "smallest; both broken where frames are missing. Marks tell lines apart and are no samples. Mean "
        f"over digits: {'; '.join(means)}. The tip error says how well the joints close and not where they "
        "are."
        + (f" Equal, so that the last hides the others: {'; '.join(hidden)}." if hidden else "")
        + (f" Without a tip error: {listed(without)}." if without else "")
    )


def _hidden(traces: _Traces, models: list[str]) -> list[str]:
    """Models whose lines are the same in every digit, in words."""
    groups: dict[tuple[bytes, ...], list[str]] = {}
    for model in models:
        lines = tuple(of[model].high_mm.tobytes() if model in of else b"" for of in traces.values())
        groups.setdefault(lines, []).append(model)
    return [listed(group) for group in groups.values() if len(group) > 1]


def _is_of(row: dict[str, object], recording: Recording) -> bool:
    return row["binding"] == LEAST_SQUARES and all(
        row[name] == value for name, value in of_recording(recording).items()
    )
