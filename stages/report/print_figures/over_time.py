"""One recording's tip errors and joint angles over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import pose_blocks
from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import N_, listed, tr, word
from shukotsu.stages.report.hand_motion import view_base
from shukotsu.stages.report.palette import HUES, INK, PAPER, RULE, SOFT, Look, model_looks
from shukotsu.stages.report.plots.panels import Panel, in_rows, print_figure
from shukotsu.stages.report.plots.rows import PLAIN, Scale, locator
from shukotsu.stages.report.plots.style import SMALL_PT
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, recording_text
from shukotsu.stages.report.print_figures.traces import Trace, error_scale, thin, trace_band, trace_line
from shukotsu.stages.report.recording_results import ANGLES, Array, read_angles, read_tip_errors
from shukotsu.stages.report.score_tables import mean
from shukotsu.stages.report.study_results import LEAST_SQUARES, StudyResults, recording_key, row_key
from shukotsu.stages.report.table_cells import alike, number, title

Traces = Mapping[str, Mapping[str, Trace]]
"""By digit, then by model."""

_STRIP_MM, _ANGLE_MM, _FOOT_MM, _MARKS = 20.0, 18.0, 9.0, 8
"""Heights, and about how many marks tell a line apart from others; they are no samples."""


def tip_error(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw a strip a digit. Raises NoDataError where no model replayed the recording."""
    traces = _traces(results, recording)
    everything = [trace for of in traces.values() for trace in of.values()]
    if not everything:
        raise NoDataError(tr("no model has a tip error in this recording"))
    looks, span = model_looks(list(results.models)), _span(everything)
    scale, last = error_scale(everything), list(traces)[-1]
    panels = [
        Panel(
            title(digit),
            title(digit),
            _STRIP_MM,
            _FOOT_MM if digit == last else 1.0,
            partial(
                _draw_errors,
                traces=of,
                looks=looks,
                scale=scale,
                span=span,
                time_words=_time_words(everything[0]) if digit == last else "",
            ),
        )
        for digit, of in traces.items()
    ]
    models = [model for model in results.models if any(model in of for of in traces.values())]
    handles = [
        Line2D([], [], color=looks[name].colour, marker=looks[name].marker, label=name) for name in models
    ]
    caption = _error_caption(results, recording, traces, models)
    return print_figure(in_rows(panels, 1), handles), caption


def _draw_errors(
    axes: Axes,
    traces: Mapping[str, Trace],
    looks: Mapping[str, Look],
    scale: Scale,
    span: tuple[float, float],
    time_words: str,
) -> None:
    """Draw a digit's strip: a line a model at the largest errors, a shade down to the smallest."""
    axes.set(yscale=scale.kind, ylim=(scale.low, scale.high), ylabel=tr("Tip error [mm]"))
    axes.yaxis.set_major_locator(locator(scale))
    _time_axes(axes, span, time_words)
    for place, (model, trace) in enumerate(traces.items()):
        x, least, most = trace_band(trace)
        step = max(1, len(x) // _MARKS)
        axes.fill_between(x, least, most, color=looks[model].colour, alpha=0.12, linewidth=0)
        axes.plot(
            x, most, color=looks[model].colour, linewidth=0.6, marker=looks[model].marker, markersize=3.0,
            markevery=(int(step * place / len(traces)), step), markeredgecolor=PAPER, markeredgewidth=0.3,
        )  # fmt: skip
    if not traces:
        words = tr("no tip error")
        axes.text(0.02, 0.5, words, transform=axes.transAxes, va="center", fontsize=SMALL_PT, color=SOFT)


def _time_axes(axes: Axes, span: tuple[float, float], time_words: str) -> None:
    """Put the recording's span on the horizontal axis, with numbers if it has words."""
    axes.set(xlim=span, xlabel=time_words)
    axes.xaxis.set_major_formatter(PLAIN)
    axes.yaxis.set_major_formatter(PLAIN)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.tick_params(labelbottom=bool(time_words))
    axes.grid(axis="y", clip_on=False)


def _time_words(trace: Trace) -> str:
    return tr("Device time [s]") if trace.in_seconds else tr("Frame")


def _span(traces: Sequence[Trace]) -> tuple[float, float]:
    """The recording's span, gaps included."""
    first, last = (of(trace.span[end] for trace in traces) for end, of in ((0, min), (1, max)))
    pad = 0.01 * (last - first) or 1.0
    return first - pad, last + pad


def _hidden_lines(traces: Traces, models: Sequence[str]) -> str:
    """Name models whose lines are the same in every digit, so that the last hides the others."""
    lines = {
        model: [of[model].high_mm.tobytes() if model in of else b"" for of in traces.values()]
        for model in models
    }
    hidden = [listed(group) for group in alike(lines) if len(group) > 1]
    return (
        tr("Equal, so that the last hides the others: {hidden}.", hidden="; ".join(hidden)) if hidden else ""
    )


def _columns_for(n_lines: int) -> int:
    """Pixel columns that each of so many lines may take, so that the file stays small."""
    return max(90, min(420, 5500 // max(1, n_lines)))


def _traces(results: StudyResults, recording: Recording) -> dict[str, dict[str, Trace]]:
    layout = results.layouts[recording.hand]
    columns, times = _columns_for(len(layout.digits) * len(results.models)), _times(results, recording)
    made: dict[str, dict[str, Trace]] = {digit: {} for digit in layout.digits}
    replayed = False
    for model in results.models:
        with suppress(InputError):  # the caption names models without a tip error
            for digit, read in read_tip_errors(results, recording, model).items():
                replayed, trace = True, thin(*times, read()[:, 0], columns)
                if trace is not None and digit in made:
                    made[digit][model] = trace
    return made if replayed else {}


def _times(results: StudyResults, recording: Recording) -> tuple[Array, Array]:
    """Numbers and times (T,) of the frames."""
    base = view_base(results.layouts[recording.hand])
    blocks = [(poses.frame, poses.time_s) for poses in pose_blocks(results.poses(recording), [base])]
    frame, time_s = map(np.concatenate, zip(*blocks, strict=True))
    return frame.astype(float), time_s


def _error_caption(results: StudyResults, recording: Recording, traces: Traces, models: list[str]) -> str:
    rows = [
        row
        for row in results.tip_errors
        if row["binding"] == LEAST_SQUARES
        and row["mean_mm"] is not None
        and row_key(row) == recording_key(recording)
    ]
    means = [
        tr(
            "{model} {mean} mm",
            model=model,
            mean=number(mean(row["mean_mm"] for row in rows if row["model"] == model)),
        )
        for model in models
    ]
    n = count_range([row["n_frames"] for row in rows] or [0])
    hidden = _hidden_lines(traces, models)
    without = [
        f"{word(digit)} ({listed([model for model in models if model not in of])})"
        for digit, of in traces.items()
        if any(model not in of for model in models)
    ]
    return tr(
        "Tip error over time of {recording_text}. Distance from the fingertip, replayed from the "
        "receivers with the least-squares binding, to the distal receiver [mm]; n = {n} frames a "
        "digit. Line: the largest value of every stretch of time that print can resolve; shade: "
        "down to the smallest; both broken where frames are missing. Marks tell lines apart and "
        "are no samples. Mean over digits: {means}. The tip error says how well the joints close "
        "and not where they are.{value}",
        recording_text=recording_text(recording),
        n=n,
        means="; ".join(means),
        value=f" {hidden}" if hidden else "",
    ) + (tr(" Without a tip error: {without}.", without=listed(without)) if without else "")


_LINES: tuple[tuple[str, str, str], ...] = (
    (N_("Flexion"), INK, "-"),
    (N_("Abduction or deviation"), SOFT, "--"),
    (N_("Axial rotation"), HUES["plain"][0], ":"),
)
"""Name, colour and dashes of each of ANGLES."""


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Figure, str]:
    """Draw a panel a joint, digits in rows. Raises NoDataError where the hand was not posed."""
    try:
        traces, n_frames = _angle_traces(results, recording, model)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
    if not traces:
        raise NoDataError(tr("{model} has no joint angles of this recording", model=model))
    every = [trace for of in traces.values() for trace in of]
    ends = min(trace.low_mm.min() for trace in every), max(trace.high_mm.max() for trace in every)
    pad = 0.06 * (ends[1] - ends[0]) or 1.0
    joints = _in_rows(results.layouts[recording.hand], traces)
    rows = [
        [
            Panel(
                word(joint),
                word(joint),
                _ANGLE_MM,
                _FOOT_MM if line is joints[-1] else 1.0,
                partial(
                    _draw_angles,
                    traces=traces[joint],
                    span=_span(every),
                    limits=(ends[0] - pad, ends[1] + pad),
                    words=tr("Angle [deg]") if joint == line[0] else "",
                    time_words=_time_words(every[0]) if line is joints[-1] else "",
                ),
                levels=(0.0,),
            )
            for joint in line
        ]
        for line in joints
    ]
    handles = [
        Line2D([], [], color=colour, ls=cast(Any, style), label=tr(name)) for name, colour, style in _LINES
    ]
    return print_figure(rows, handles), (
        tr(
            "Joint angles of {recording_text}, model {model}; n = {n_frames} frames. Joint "
            "coordinate system of Grood and Suntay, named and signed as the International Society of "
            "Biomechanics recommends for the hand; flexion, ulnar deviation and pronation are "
            "positive [deg]. Zero is the straight finger, and for bones that stand otherwise their "
            "rest. Each line passes through the smallest and the largest value of every stretch of "
            "time that print can resolve, and is broken where frames are missing.",
            recording_text=recording_text(recording),
            model=model,
            n_frames=n_frames,
        )
    )


def _draw_angles(
    axes: Axes,
    traces: Sequence[Trace],
    span: tuple[float, float],
    limits: tuple[float, float],
    words: str,
    time_words: str,
) -> None:
    axes.set(ylim=limits, ylabel=words)
    _time_axes(axes, span, time_words)
    axes.axhline(0.0, color=RULE, linewidth=0.8)
    for (_, colour, style), trace in zip(_LINES, traces, strict=True):
        axes.plot(*trace_line(trace), color=colour, linestyle=style, linewidth=0.7)


def _angle_traces(
    results: StudyResults, recording: Recording, model: str
) -> tuple[dict[str, list[Trace]], int]:
    """The traces of every joint that has all angles, in the order of ANGLES, and the number of frames."""
    times, readers = _times(results, recording), read_angles(results, recording, model)
    columns = _columns_for(len(readers) * len(ANGLES))
    found = {}
    for joint, read in readers.items():
        own = [thin(*times, values, columns) for values in read().T]
        known = [trace for trace in own if trace is not None]
        if len(known) == len(ANGLES):
            found[joint] = known
    return found, len(times[0])


def _in_rows(layout: Layout, traces: dict[str, list[Trace]]) -> list[list[str]]:
    """Joints digit by digit from the base outward, those of no digit in a row of their own."""
    rows = []
    for digit in layout.digits.values():
        joints = [joint for joint in digit.joints if joint in traces]
        own = [joint for joint in traces if joint not in joints and _leads_to(layout, joint, digit.segments)]
        rows.append([*own, *joints])
    placed = {joint for row in rows for joint in row}
    return [row for row in [*rows, [joint for joint in traces if joint not in placed]] if row]


def _leads_to(layout: Layout, joint: str, segments: tuple[str, ...]) -> bool:
    return joint in layout.joints and layout.joints[joint].child in segments
