"""A recording's figures: tip errors and joint angles over time, and joint angles over the cycle.

Curves over the cycle follow the convention of movement science: a panel for each joint, with a line for the
mean and a shade of one standard deviation to each side. For a recording, there is one line per angle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.hand.known_digits import root_of
from shukotsu.movement.cycles import PERCENT
from shukotsu.report import palette, score_tables
from shukotsu.report.figures import drawing
from shukotsu.report.figures.drawing import FOOT_MM, PLAIN, Drawing, NoDataError, Panel
from shukotsu.report.figures.style import SMALL_PT
from shukotsu.report.movement_results import Curve, recording_curves, why_no_curves
from shukotsu.report.palette import HUES, INK, PAPER, RULE, SOFT
from shukotsu.report.recording_results import ANGLE_COLUMNS, ANGLES, reader_of
from shukotsu.report.study_results import LEAST_SQUARES, StudyResults, recording_key, row_key
from shukotsu.report.table_cells import number, title
from shukotsu.study.layout import Layout
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import JOINT_ANGLES, TIPS
from shukotsu.tables.poses import pose_blocks
from shukotsu.tables.subjects import path_token
from shukotsu.translation import N_, tr, word

_STRIP_MM, _ANGLE_MM, _CURVE_MM, _MARKS = 20.0, 18.0, 28.0, 8
"""Heights, and the approximate number of markers on a line, which distinguish lines and are not samples."""
_GAP_STEPS = 1.9
"""A step between valid samples above this multiple of the median is a gap; one missing frame gives 2."""


class CurveLook(NamedTuple):
    """Label, colour and dash style of a line."""

    label: str
    colour: str
    style: str = "-"


ANGLE_LOOKS = {
    "flexion": CurveLook(N_("Flexion"), INK),
    "abduction": CurveLook(N_("Abduction or deviation"), HUES["sky"][0], "--"),
    "rotation": CurveLook(N_("Axial rotation"), HUES["vermilion"][0], ":"),
}


def angle_looks() -> dict[str, CurveLook]:
    """Return the look of each of ANGLES, in the language in use."""
    return {angle: look._replace(label=tr(look.label)) for angle, look in ANGLE_LOOKS.items()}


def of_recording(results: StudyResults, recording: Recording) -> Iterator[Drawing]:
    """Draw a recording's figures: tip-error, and joint-angles and cycle-curves under every fitted model."""
    yield drawing.draw_figure("tip-error", partial(tip_error, results, recording))
    for model in results.fitted:
        name = f"joint-angles_{path_token(model)}"
        yield drawing.draw_figure(name, partial(joint_angles, results, recording, model))
    if not results.fitted:
        reason = tr("joint angles need a model that fits the whole hand, and this study has none")
        yield drawing.not_drawn("joint-angles", reason)
    for model in results.fitted or [results.leading]:
        for event in recording_curves(results, recording, model) or [""]:
            name = "_".join(["cycle-curves", path_token(model), *([path_token(event)] if event else [])])
            yield drawing.draw_figure(name, partial(recording_cycles, results, recording, model, event))


def find_recording(results: StudyResults, subject: str, hand: str, name: str) -> Recording:
    """Return the recording of a subject and hand; name : the task, followed by `_` and the trial if any.

    Raises InputError with a list of the recordings if there is no match.
    """
    of_side = [recording for recording in results.recordings if recording.hand.hand == hand]
    of_hand = [each for each in of_side if subject in (each.hand.who.label, each.hand.who.token)]
    for recording in of_hand:
        plain = recording.task + (f"_{recording.trial}" if recording.trial else "")
        if name in (recording.name, plain):
            return recording
    if of_hand:
        choices = "this hand has " + ", ".join(recording.name for recording in of_hand)
    else:
        choices = "hands are " + ", ".join(f"{h.who.token} {h.hand}" for h in results.hands[:12])
    raise InputError(f"--recording {subject} {hand} {name}: no such recording; {choices}")


def recording_text(recording: Recording) -> str:
    """Return a recording's hand, task and trial in words."""
    trial = tr(", trial {trial}", trial=recording.trial) if recording.trial else ""
    return tr("{hand}, {task}{trial}", hand=recording.hand, task=recording.task, trial=trial)


class Trace(NamedTuple):
    """A series over time, thinned to C columns: x, and smallest and largest value (C,), NaN in gaps."""

    x: Array
    low: Array
    high: Array


def thin(x: Array, values: Array, columns: int) -> Trace | None:
    """Thin values (T,), NaN in gaps, to the given number of columns of x; return None if all are NaN."""
    valid = np.isfinite(values)
    if not valid.any():
        return None
    width = (x[-1] - x[0]) / columns or 1.0
    usual = float(np.median(np.diff(x))) if len(x) > 1 else 0.0
    kept_x, kept = x[valid], values[valid]
    first = np.flatnonzero(np.diff(np.minimum((kept_x - x[0]) // width, columns - 1), prepend=-1))
    step = np.diff(kept_x, prepend=kept_x[0])[first]
    gaps = np.flatnonzero(step > max(_GAP_STEPS * usual, 1.5 * width if len(kept) > columns else 0.0))
    low, high = np.minimum.reduceat(kept, first), np.maximum.reduceat(kept, first)
    return Trace(*(np.insert(part, gaps, np.nan) for part in (kept_x[first], low, high)))


def _times(results: StudyResults, recording: Recording) -> tuple[Array, str]:
    """Return the frames' times, s, or their numbers if there are no device times, and the axis label."""
    base = root_of(results.layouts[recording.hand])
    blocks = [(poses.frame, poses.time_s) for poses in pose_blocks(results.poses(recording), [base])]
    frame, time_s = map(np.concatenate, zip(*blocks, strict=True))
    if np.isfinite(time_s).all():
        return time_s, tr("Device time [s]")
    return frame.astype(float), tr("Frame")


def _columns_for(n_lines: int) -> int:
    """Return the number of columns of each of n_lines lines that keeps the file small."""
    return max(90, min(420, 5500 // max(1, n_lines)))


def _time_axes(axes: Axes, x: Array, time_words: str) -> None:
    """Set the horizontal axis to the recording's span; numbers are shown only if it has a label."""
    pad = 0.01 * (x[-1] - x[0]) or 1.0
    axes.set(xlim=(x[0] - pad, x[-1] + pad), xlabel=time_words)
    axes.xaxis.set_major_formatter(PLAIN)
    axes.yaxis.set_major_formatter(PLAIN)
    axes.tick_params(labelbottom=bool(time_words), which="both")
    axes.minorticks_off()
    axes.grid(axis="y", clip_on=False)


def tip_error(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the tip errors, a strip for each digit. Raises NoDataError if no model replayed the recording."""
    digits, traces = list(results.layouts[recording.hand].digits), {}
    x, time_words = _times(results, recording)
    for model in results.models:
        with suppress(InputError):
            errors = reader_of(results, recording, model).series(TIPS, ["error_mm"])
            for digit, read in errors.items():
                trace = thin(x, read()[:, 0], _columns_for(len(digits) * len(results.models)))
                if trace is not None and digit in digits:
                    traces[model, digit] = trace
    if not traces:
        raise NoDataError(tr("no model has a tip error in this recording"))
    highest = np.concatenate([trace.high[np.isfinite(trace.high)] for trace in traces.values()])
    scale = drawing.value_scale(highest)
    looks = palette.looks(list(results.models), palette.MODELS)

    def draw(axes: Axes, digit: str) -> None:
        """Draw, for each model, a line at the largest error in each column, shaded down to the smallest."""
        axes.set(yscale=scale.kind, ylim=(scale.low, scale.high), ylabel=tr("Tip error [mm]"))
        axes.yaxis.set_major_locator(drawing.locator(scale))
        _time_axes(axes, x, time_words if digit == digits[-1] else "")
        models = [model for model, of_digit in traces if of_digit == digit]
        for index, model in enumerate(models):
            at, low, high = traces[model, digit]
            step, look = max(1, len(at) // _MARKS), looks[model]
            axes.fill_between(at, low, high, color=look.colour, alpha=0.12, linewidth=0)
            axes.plot(
                at, high, color=look.colour, linewidth=0.6, marker=look.marker, markersize=3.0,
                markevery=(step * index // len(models), step), markeredgecolor=PAPER, markeredgewidth=0.3,
            )  # fmt: skip
        if not models:
            words = tr("no tip error")
            axes.text(0.02, 0.5, words, transform=axes.transAxes, va="center", fontsize=SMALL_PT, color=SOFT)

    panels = []
    for digit in digits:
        foot_mm = FOOT_MM if digit == digits[-1] else 1.0
        panels.append(Panel(title(digit), title(digit), _STRIP_MM, foot_mm, partial(draw, digit=digit)))
    models = [name for name in results.models if any(model == name for model, _ in traces)]
    handles = [
        Line2D([], [], color=looks[name].colour, marker=looks[name].marker, label=name) for name in models
    ]
    key = LEAST_SQUARES, recording_key(recording)
    bound = [row for row in results.rows.tip_errors if (row["binding"], row_key(row)) == key]
    rows = [row for row in bound if row["mean_mm"] is not None]
    means = [
        f"{model} {number(score_tables.mean(row['mean_mm'] for row in rows if row['model'] == model))} mm"
        for model in models
    ]
    return drawing.print_figure(drawing.in_rows(panels, 1), handles), tr(
        "Tip error over time of {recording_text}: distance from the replayed fingertip to the distal "
        "receiver, least-squares binding [mm]; n = {n} frames per digit. Line: largest value in each "
        "interval that print can resolve; shaded: down to the smallest; interrupted at missing frames. Mean "
        "over digits: {means}. It shows how well the two sides of each joint agree, not where the joint is.",
        recording_text=recording_text(recording),
        n=drawing.count_range([row["n_frames"] for row in rows] or [0]),
        means="; ".join(means),
    )


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Figure, str]:
    """Draw joint angles over time, a panel for each joint. Raises NoDataError if the hand was not posed."""
    x, time_words = _times(results, recording)
    try:
        read = reader_of(results, recording, model).series(JOINT_ANGLES, ANGLE_COLUMNS)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
    traces = _angle_traces(x, read)
    if not traces:
        raise NoDataError(tr("{model} has no joint angles of this recording", model=model))
    every = [trace for of_joint in traces.values() for of_angle in of_joint for trace in of_angle if trace]
    low, high = min(np.nanmin(trace.low) for trace in every), max(np.nanmax(trace.high) for trace in every)
    pad = 0.06 * (high - low) or 1.0
    lines = digit_rows(results.layouts[recording.hand], traces)

    def draw(axes: Axes, joint: str, first: bool, last: bool) -> None:
        axes.set(ylim=(low - pad, high + pad), ylabel=tr("Angle [deg]") if first else "")
        _time_axes(axes, x, time_words if last else "")
        axes.axhline(0.0, color=RULE, linewidth=0.8)
        for look, (trace, below, above) in zip(ANGLE_LOOKS.values(), traces[joint], strict=True):
            if below is not None and above is not None:
                axes.fill_between(below.x, below.low, above.high, color=look.colour, alpha=0.15, linewidth=0)
            axes.fill_between(trace.x, trace.low, trace.high, color=look.colour, alpha=0.3, linewidth=0)
            axes.plot(trace.x, trace.high, color=look.colour, linewidth=0.7)

    rows = []
    for line in lines:
        last, row = line is lines[-1], []
        for joint in line:
            drawn = partial(draw, joint=joint, first=joint == line[0], last=last)
            row.append(Panel(word(joint), word(joint), _ANGLE_MM, FOOT_MM if last else 1.0, drawn))
        rows.append(row)
    handles = [Line2D([], [], color=look.colour, label=look.label) for look in angle_looks().values()]
    return drawing.print_figure(rows, handles), tr(
        "Joint angles of {recording_text}, model {model}; n = {n_frames} frames. Joint coordinate system of "
        "Grood and Suntay, with the signs that the International Society of Biomechanics recommends for the "
        "hand: flexion, ulnar deviation and pronation are positive [deg]. Line: largest value in each "
        "interval of time that print can resolve; shaded: down to the smallest value; lighter shading: ± the "
        "stated 1-sigma error; interrupted if frames are missing.",
        recording_text=recording_text(recording),
        model=model,
        n_frames=len(x),
    )


_WithError = tuple[Trace, Trace | None, Trace | None]
"""An angle, the angle minus its 1-sigma error, and plus it; the last two are None if no error is stated."""


def _angle_traces(x: Array, read: Mapping[str, Callable[[], Array]]) -> dict[str, list[_WithError]]:
    """Return the traces of each joint that has all three angles."""
    columns, traces = _columns_for(len(read) * len(ANGLES)), {}
    for joint, angles in read.items():
        numbers = angles()
        thinned = [
            (trace, thin(x, angle - sd, columns), thin(x, angle + sd, columns))
            for angle, sd in zip(numbers[:, : len(ANGLES)].T, numbers[:, len(ANGLES) :].T, strict=True)
            if (trace := thin(x, angle, columns)) is not None
        ]
        if len(thinned) == len(ANGLES):
            traces[joint] = thinned
    return traces


def legend_handles(looks: Iterable[CurveLook]) -> list[Line2D]:
    """Return the handles of a legend."""
    return [Line2D([], [], color=c, linestyle=cast(Any, style), label=name) for name, c, style in looks]


def curve_panels(
    title: str, joints: Mapping[str, Mapping[str, Curve]], looks: Mapping[str, CurveLook]
) -> dict[str, Panel]:
    """Return a panel for each joint, with a common scale; headings state the number of cycles or subjects.

    joints : curves by joint and then by the names in `looks`.
    """
    every = [curve for curves in joints.values() for curve in curves.values()]
    low = np.nanmin([curve.mean_deg - np.nan_to_num(curve.sd_deg) for curve in every])
    high = np.nanmax([curve.mean_deg + np.nan_to_num(curve.sd_deg) for curve in every])
    pad = 0.06 * (high - low) or 1.0
    panels = {}
    for joint, curves in joints.items():
        shown = {name: curves[name] for name in looks if name in curves}
        counts = list(dict.fromkeys(drawing.count_range(curve.n.astype(int)) for curve in shown.values()))
        draw = partial(_draw_curves, curves=shown, looks=looks, limits_deg=(low - pad, high + pad))
        heading = tr("{joint}, n = {n}", joint=word(joint), n=tr(", ").join(counts))
        panels[joint] = Panel(heading, f"{title}: {heading}", _CURVE_MM, FOOT_MM, draw)
    return panels


def _draw_curves(
    axes: Axes, curves: Mapping[str, Curve], looks: Mapping[str, CurveLook], limits_deg: tuple[float, float]
) -> None:
    """Draw means over the cycle, with a shade of one standard deviation to each side."""
    axes.set(xlim=(0, 100), ylim=limits_deg, xlabel=tr("Cycle [%]"), ylabel=tr("Angle [deg]"))
    axes.xaxis.set_major_locator(MultipleLocator(25))
    axes.yaxis.set_major_formatter(PLAIN)
    axes.grid(axis="y")
    axes.axhline(0.0, color=RULE, linewidth=0.8)
    for name, curve in curves.items():
        label, colour, style = looks[name]
        below_deg, above_deg = curve.mean_deg - curve.sd_deg, curve.mean_deg + curve.sd_deg
        axes.fill_between(PERCENT, below_deg, above_deg, color=colour, alpha=0.2, linewidth=0)
        axes.plot(PERCENT, curve.mean_deg, color=colour, linestyle=style, linewidth=1.2, label=label)


def digit_rows(layout: Layout, joints: Iterable[str]) -> list[list[str]]:
    """Return the joints in rows, one for each digit and a last one for the others."""
    names, children = list(joints), {name: joint.child for name, joint in layout.joints.items()}
    rows = [
        [joint for joint in names if joint in digit.joints or children.get(joint) in digit.segments]
        for digit in layout.digits.values()
    ]
    others = [joint for joint in names if not any(joint in row for row in rows)]
    return [row for row in (*rows, others) if row]


def recording_cycles(
    results: StudyResults, recording: Recording, model: str, event: str = ""
) -> tuple[Figure, str]:
    """Draw mean angles over the cycles that begin at an event (default: the first), a panel for each joint.

    Raises NoDataError if no angle is averaged.
    """
    curves = recording_curves(results, recording, model)
    if not curves:
        raise NoDataError(why_no_curves(results, recording, model))
    event, words = event or next(iter(curves)), recording_text(recording)
    panels = curve_panels(words, curves[event], angle_looks())
    rows = [
        [panels[joint] for joint in row] for row in digit_rows(results.layouts[recording.hand], curves[event])
    ]
    return drawing.print_figure(rows, legend_handles(angle_looks().values())), tr(
        "Joint angles over the cycle of {recording_text}, model {model}: means over n cycles, each from one "
        "event “{event}” to the next event or to the end of the same event, at each percent of its duration "
        "[deg]. Shaded: ± one standard deviation over cycles. Flexion, ulnar deviation and pronation are "
        "positive. A cycle with gaps is included where it was measured.",
        recording_text=words,
        model=model,
        event=event,
    )
