"""One recording's tip errors and joint angles over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.poses import read_poses
from schemas.study import Recording
from stages.report.hand_motion import view_base
from stages.report.palette import HUES, INK, RULE, SOFT, Look, model_looks
from stages.report.pictures.tip_error_strips import Traces, hidden_lines, thinned_traces, time_label
from stages.report.pictures.traces import Trace, error_scale, thin, trace_band, trace_line
from stages.report.print_figures.drawing import NoDataError, count_range, recording_text
from stages.report.print_figures.style import (
    TWO_COLUMNS_MM,
    columns_for,
    headings,
    label,
    new_figure,
    stacked,
    vertical_axis,
)
from stages.report.recording_results import ANGLES, Array, read_angles, read_tip_errors
from stages.report.score_tables import mean
from stages.report.study_results import LEAST_SQUARES, StudyResults, recording_key, row_key
from stages.report.table_cells import listed, number, title
from stages.report.wording import mark, say, word

_STRIP_MM, _FOOT_MM = 26.0, 22.0


def tip_error(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the strips. Raises NoDataError where no model replayed the recording."""
    traces = _traces(results, recording)
    if not any(traces.values()):
        raise NoDataError(say("no model has a tip error in this recording"))
    looks = model_looks(list(results.models))
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _STRIP_MM * len(traces))
    strips = stacked(figure, len(traces), sharex=True, sharey=True)
    _draw_strips(strips, traces, looks)
    headings(strips, [label(title(digit)) for digit in traces])
    strips[-1].set_xlabel(title(time_label(traces)))
    figure.supylabel(say("Tip error [mm]"), fontsize="medium")
    models = [model for model in results.models if any(model in of for of in traces.values())]
    figure.legend(handles=_model_lines(looks, models), loc="outside upper center", ncols=4)
    return figure, _error_caption(results, recording, traces, models)


def _draw_strips(strips: Sequence[Axes], traces: Traces, looks: Mapping[str, Look]) -> None:
    """Draw every digit's traces into its own axes, which share one scale."""
    everything = [trace for of in traces.values() for trace in of.values()]
    scale = error_scale(everything)
    for of, axes in zip(traces.values(), strips, strict=True):
        for index, (model, trace) in enumerate(of.items()):
            _draw_trace(axes, trace, looks[model], index / len(of), index)
        if not of:
            axes.text(0.02, 0.5, say("no tip error"), transform=axes.transAxes, va="center")
        axes.margins(x=0.01)
        vertical_axis(axes, scale, 3)


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


def _error_caption(results: StudyResults, recording: Recording, traces: Traces, models: list[str]) -> str:
    rows = [
        row
        for row in results.tip_errors
        if row["binding"] == LEAST_SQUARES
        and row["mean_mm"] is not None
        and row_key(row) == recording_key(recording)
    ]
    means = [
        say(
            "{model} {mean} mm",
            model=model,
            mean=number(mean(row["mean_mm"] for row in rows if row["model"] == model)),
        )
        for model in models
    ]
    n = count_range([row["n_frames"] for row in rows] or [0])
    hidden = hidden_lines(traces, models)
    without = [
        f"{word(digit)} ({listed([model for model in models if model not in of])})"
        for digit, of in traces.items()
        if any(model not in of for model in models)
    ]
    return say(
        (
            "Tip error over time of {recording_text}. Distance from the fingertip, replayed from the "
            "receivers with the least-squares binding, to the distal receiver [mm]; n = {n} frames a "
            "digit. Line: the largest value of every stretch of time that print can resolve; shade: "
            "down to the smallest; both broken where frames are missing. Marks tell lines apart and "
            "are no samples. Mean over digits: {means}. The tip error says how well the joints close "
            "and not where they are.{value}"
        ),
        recording_text=recording_text(recording),
        n=n,
        means="; ".join(means),
        value=f" {hidden}" if hidden else "",
    ) + (say(" Without a tip error: {without}.", without=listed(without)) if without else "")


_ROW_MM, _ANGLES_FOOT_MM = 28.0, 16.0
_LINES: tuple[tuple[str, str, Literal["-", "--", ":"]], ...] = (
    (mark("Flexion"), INK, "-"),
    (mark("Abduction or deviation"), SOFT, "--"),
    (mark("Axial rotation"), HUES["plain"][0], ":"),
)
"""Name, colour and dashes of each of ANGLES."""


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Figure, str]:
    """Draw a panel a joint, digits in rows. Raises NoDataError where the hand was not posed."""
    try:
        traces, n_frames = _angle_traces(results, recording, model)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
    if not traces:
        raise NoDataError(say("{model} has no joint angles of this recording", model=model))
    rows = _in_rows(results.layouts[recording.hand], traces)
    figure = new_figure(TWO_COLUMNS_MM, _ANGLES_FOOT_MM + _ROW_MM * len(rows))
    grid = figure.subplots(len(rows), max(map(len, rows)), squeeze=False, sharex=True, sharey=True)
    for line, joints in zip(grid, rows, strict=True):
        for axes in line[len(joints) :]:
            axes.set_visible(False)
        for axes, joint in zip(line, joints, strict=False):
            _angle_panel(axes, traces[joint])
    panels = [axes for line, joints in zip(grid, rows, strict=True) for axes in line[: len(joints)]]
    headings(panels, [label(word(joint)) for joints in rows for joint in joints])
    in_seconds = next(trace for of in traces.values() for trace in of).in_seconds
    figure.supxlabel(say("Device time [s]") if in_seconds else say("Frame"), fontsize="medium")
    figure.supylabel(say("Angle [deg]"), fontsize="medium")
    handles = [Line2D([], [], color=colour, linestyle=line, label=say(name)) for name, colour, line in _LINES]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure, (
        say(
            (
                "Joint angles of {recording_text}, model {model}; n = {n_frames} frames. Joint "
                "coordinate system of Grood and Suntay, named and signed as the International Society of "
                "Biomechanics recommends for the hand; flexion, ulnar deviation and pronation are "
                "positive [deg]. Zero is the straight finger, and for bones that stand otherwise their "
                "rest. Each line passes through the smallest and the largest value of every stretch of "
                "time that print can resolve, and is broken where frames are missing."
            ),
            recording_text=recording_text(recording),
            model=model,
            n_frames=n_frames,
        )
    )


def _angle_traces(
    results: StudyResults, recording: Recording, model: str
) -> tuple[dict[str, list[Trace]], int]:
    """The traces of every joint that has all angles, in the order of ANGLES, and the number of frames."""
    poses = read_poses(results.poses(recording), [view_base(results.layouts[recording.hand])])
    angles = read_angles(results, recording, model, poses)
    columns = columns_for(len(angles.joints) * len(ANGLES))
    found = {}
    for j, joint in enumerate(angles.joints):
        series = angles.angle_deg[:, j].T
        own = [thin(poses.frame.astype(float), poses.time_s, values, columns) for values in series]
        known = [trace for trace in own if trace is not None]
        if len(known) == len(ANGLES):
            found[joint] = known
    return found, len(poses.frame)


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


def _angle_panel(axes: Axes, traces: list[Trace]) -> None:
    axes.axhline(0.0, color=RULE, linewidth=0.5, zorder=0)
    for (_, colour, line), trace in zip(_LINES, traces, strict=True):
        axes.plot(*trace_line(trace), color=colour, linestyle=line, linewidth=0.7)
    axes.margins(x=0.01)
