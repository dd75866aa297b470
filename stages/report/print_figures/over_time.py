"""One recording's tip errors and joint angles over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import pose_blocks
from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import N_, listed, tr, word
from shukotsu.stages.report.hand_motion import view_base
from shukotsu.stages.report.palette import HUES, INK, SOFT, Look, Mark, model_looks
from shukotsu.stages.report.plots.description import (
    Band,
    CurvesPanel,
    Key,
    Line,
    Plot,
    Scale,
    even_scale,
    in_rows,
)
from shukotsu.stages.report.plots.style import TWO_COLUMNS_MM
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, recording_text
from shukotsu.stages.report.print_figures.traces import Trace, error_scale, thin, trace_band, trace_line
from shukotsu.stages.report.recording_results import ANGLES, Array, read_angles, read_tip_errors
from shukotsu.stages.report.score_tables import mean
from shukotsu.stages.report.study_results import LEAST_SQUARES, StudyResults, recording_key, row_key
from shukotsu.stages.report.table_cells import alike, number, title

Traces = Mapping[str, Mapping[str, Trace]]
"""By digit, then by model."""

_STRIP_MM, _ANGLE_MM = 20.0, 18.0


def tip_error(results: StudyResults, recording: Recording) -> tuple[Plot, str]:
    """Describe a strip a digit. Raises NoDataError where no model replayed the recording."""
    traces = _traces(results, recording)
    everything = [trace for of in traces.values() for trace in of.values()]
    if not everything:
        raise NoDataError(tr("no model has a tip error in this recording"))
    looks, scale, last = model_looks(list(results.models)), error_scale(everything), list(traces)[-1]
    panels = [
        CurvesPanel(
            title(digit),
            title(digit),
            _time_words(everything[0]) if digit == last else "",
            tr("Tip error [mm]"),
            _time_scale(everything),
            scale,
            _STRIP_MM,
            tuple(
                _error_line(trace, looks[model], place / len(of))
                for place, (model, trace) in enumerate(of.items())
            ),
            tuple(Band(*trace_band(trace), looks[model].colour, 0.12) for model, trace in of.items()),
            words="" if of else tr("no tip error"),
        )
        for digit, of in traces.items()
    ]
    models = [model for model in results.models if any(model in of for of in traces.values())]
    legend = tuple(
        Key(name, Mark(looks[name].marker, looks[name].colour, looks[name].colour), (looks[name].colour, "-"))
        for name in models
    )
    caption = _error_caption(results, recording, traces, models)
    return Plot(in_rows(panels, 1), TWO_COLUMNS_MM, legend), caption


def _error_line(trace: Trace, look: Look, phase: float) -> Line:
    x, _, high = trace_band(trace)
    return Line(x, high, look.colour, width=0.6, marker=look.marker, phase=phase)


def _time_words(trace: Trace) -> str:
    return tr("Device time [s]") if trace.in_seconds else tr("Frame")


def _time_scale(traces: Sequence[Trace]) -> Scale:
    """The recording's span, gaps included."""
    first, last = (of(trace.span[end] for trace in traces) for end, of in ((0, min), (1, max)))
    pad = 0.01 * (last - first) or 1.0
    return Scale(first - pad, last + pad)


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


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Plot, str]:
    """Describe a panel a joint, digits in rows. Raises NoDataError where the hand was not posed."""
    try:
        traces, n_frames = _angle_traces(results, recording, model)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
    if not traces:
        raise NoDataError(tr("{model} has no joint angles of this recording", model=model))
    every = [trace for of in traces.values() for trace in of]
    scales = _time_scale(every), even_scale([own for trace in every for own in (trace.low_mm, trace.high_mm)])
    joints = _in_rows(results.layouts[recording.hand], traces)
    rows = tuple(
        tuple(
            CurvesPanel(
                word(joint),
                word(joint),
                _time_words(every[0]) if line is joints[-1] else "",
                "" if place else tr("Angle [deg]"),
                *scales,
                _ANGLE_MM,
                tuple(
                    Line(*trace_line(trace), colour, style, 0.7)
                    for (_, colour, style), trace in zip(_LINES, traces[joint], strict=True)
                ),
                levels=(0.0,),
            )
            for place, joint in enumerate(line)
        )
        for line in joints
    )
    legend = tuple(Key(tr(name), line=(colour, style)) for name, colour, style in _LINES)
    return Plot(rows, TWO_COLUMNS_MM, legend), (
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
