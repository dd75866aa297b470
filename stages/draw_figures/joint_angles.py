"""One recording's joint angles with a fitted hand, over time."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from schemas.catalogue import JOINT_ANGLES, POSES
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.study import Recording
from schemas.tables import column_array
from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.marks import Array, columns_for, trace_line
from stages.draw_figures.recording_tables import rows_where
from stages.draw_figures.style import COLOURS, TWO_COLUMNS_MM, headings, label, new_figure
from stages.draw_figures.words import of_recording, whose_recording
from stages.report.posed_skeleton import view_base
from stages.report.study_results import StudyResults
from stages.report.tip_traces import Trace, thin

_ROW_MM, _FOOT_MM = 28.0, 16.0
ANGLES: dict[str, tuple[str, str, Literal["-", "--", ":"]]] = {
    "flexion_deg": ("Flexion", COLOURS[0], "-"),
    "abduction_deg": ("Abduction or deviation", COLOURS[1], "--"),
    "rotation_deg": ("Axial rotation", COLOURS[2], ":"),
}


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Figure, str]:
    """Draw a panel a joint, digits in rows. Raises NoDataError where the hand was not posed."""
    traces = _traces(results, recording, model)
    if not traces:
        raise NoDataError(f"{model} has no joint angles of this recording")
    rows = _in_rows(results.layouts[recording.hand], traces)
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _ROW_MM * len(rows))
    grid = figure.subplots(len(rows), max(map(len, rows)), squeeze=False, sharex=True, sharey=True)
    for line, joints in zip(grid, rows, strict=True):
        for axes in line[len(joints) :]:
            axes.set_visible(False)
        for axes, joint in zip(line, joints, strict=False):
            _panel(axes, traces[joint])
    panels = [axes for line, joints in zip(grid, rows, strict=True) for axes in line[: len(joints)]]
    headings(panels, [label(joint) for joints in rows for joint in joints])
    in_seconds = next(trace for of in traces.values() for trace in of.values()).in_seconds
    figure.supxlabel("Device time [s]" if in_seconds else "Frame", fontsize="medium")
    figure.supylabel("Angle [deg]", fontsize="medium")
    handles = [
        Line2D([], [], color=colour, linestyle=line, label=words) for words, colour, line in ANGLES.values()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    n = len(_frames(results, recording)[0])
    return figure, (
        f"Joint angles of {whose_recording(recording)}, model {model}; n = {n} frames. Joint coordinate "
        "system of Grood and Suntay, named and signed as the International Society of Biomechanics "
        "recommends for the hand; flexion, ulnar deviation and pronation are positive [deg]. Zero is the "
        "straight finger, and for bones that stand otherwise their rest. Each line passes through the "
        "smallest and the largest value of every stretch of time that print can resolve, and is broken "
        "where frames are missing."
    )


def _traces(results: StudyResults, recording: Recording, model: str) -> dict[str, dict[str, Trace]]:
    path = results.paths.hand_table(model, recording.hand, "joint_angles")
    try:
        data = rows_where(path, JOINT_ANGLES, {**of_recording(recording), "model": model},
                          ["joint", "frame", *ANGLES])  # fmt: skip
        known_frames, known_times = _frames(results, recording)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
    joint_of = data.column("joint").to_numpy()
    frame = column_array(data, "frame")
    time_s = _times(frame, known_frames, known_times)
    joints = list(dict.fromkeys(joint_of.tolist()))
    columns = columns_for(len(joints) * len(ANGLES))
    found: dict[str, dict[str, Trace]] = {}
    for joint in joints:
        own = joint_of == joint
        for name in ANGLES:
            trace = thin(frame[own].astype(float), time_s[own], column_array(data, name)[own], columns)
            if trace is not None:
                found.setdefault(joint, {})[name] = trace
    return found


def _frames(results: StudyResults, recording: Recording) -> tuple[Array, Array]:
    """The recording's frame numbers and times, each (n,)."""
    base = view_base(results.layouts[recording.hand])
    data = rows_where(results.paths.poses(recording), POSES, {"segment": base}, ["frame", "time_s"])
    return column_array(data, "frame"), column_array(data, "time_s")


def _times(frame: Array, known_frames: Array, known_times: Array) -> Array:
    """The time of each frame, NaN where it has none."""
    if not len(known_frames):
        return np.full(len(frame), np.nan)
    place = np.minimum(np.searchsorted(known_frames, frame), len(known_frames) - 1)
    return np.where(known_frames[place] == frame, known_times[place], np.nan)


def _in_rows(layout: Layout, traces: dict[str, dict[str, Trace]]) -> list[list[str]]:
    """Joints digit by digit from the base outward, those of no digit in a row of their own."""
    of_digits = [[joint for joint in digit.joints if joint in traces] for digit in layout.digits.values()]
    rows = []
    for digit, joints in zip(layout.digits.values(), of_digits, strict=True):
        own = [joint for joint in traces if joint not in joints and _leads_to(layout, joint, digit.segments)]
        rows.append([*own, *joints])
    told = {joint for row in rows for joint in row}
    return [row for row in [*rows, [joint for joint in traces if joint not in told]] if row]


def _leads_to(layout: Layout, joint: str, segments: tuple[str, ...]) -> bool:
    return joint in layout.joints and layout.joints[joint].child in segments


def _panel(axes: Axes, traces: dict[str, Trace]) -> None:
    axes.axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
    for name, trace in traces.items():
        _, colour, line = ANGLES[name]
        axes.plot(*trace_line(trace), color=colour, linestyle=line, linewidth=0.7)
    axes.margins(x=0.01)
