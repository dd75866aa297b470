"""One recording's joint angles with a fitted hand, over time."""

from __future__ import annotations

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.poses import read_poses
from schemas.study import Recording
from stages.report.hand_motion import view_base
from stages.report.palette import HUES, RULE
from stages.report.pictures.traces import Trace, thin, trace_line
from stages.report.print_figures.caption_text import recording_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.marks import columns_for
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, new_figure
from stages.report.recording_results import ANGLES, read_angles
from stages.report.study_results import StudyResults

_ROW_MM, _FOOT_MM = 28.0, 16.0
_LINES: tuple[tuple[str, str, Literal["-", "--", ":"]], ...] = (
    ("Flexion", HUES["blue"][0], "-"),
    ("Abduction or deviation", HUES["amber"][0], "--"),
    ("Axial rotation", HUES["green"][0], ":"),
)
"""Name, colour and dashes of each of ANGLES."""


def joint_angles(results: StudyResults, recording: Recording, model: str) -> tuple[Figure, str]:
    """Draw a panel a joint, digits in rows. Raises NoDataError where the hand was not posed."""
    try:
        traces, n_frames = _traces(results, recording, model)
    except InputError as error:
        raise NoDataError(f"{model}: {error}") from error
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
    in_seconds = next(trace for of in traces.values() for trace in of).in_seconds
    figure.supxlabel("Device time [s]" if in_seconds else "Frame", fontsize="medium")
    figure.supylabel("Angle [deg]", fontsize="medium")
    handles = [Line2D([], [], color=colour, linestyle=line, label=name) for name, colour, line in _LINES]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure, (
        f"Joint angles of {recording_text(recording)}, model {model}; n = {n_frames} frames. Joint "
        f"coordinate "
        "system of Grood and Suntay, named and signed as the International Society of Biomechanics "
        "recommends for the hand; flexion, ulnar deviation and pronation are positive [deg]. Zero is the "
        "straight finger, and for bones that stand otherwise their rest. Each line passes through the "
        "smallest and the largest value of every stretch of time that print can resolve, and is broken "
        "where frames are missing."
    )


def _traces(results: StudyResults, recording: Recording, model: str) -> tuple[dict[str, list[Trace]], int]:
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


def _panel(axes: Axes, traces: list[Trace]) -> None:
    axes.axhline(0.0, color=RULE, linewidth=0.5, zorder=0)
    for (_, colour, line), trace in zip(_LINES, traces, strict=True):
        axes.plot(*trace_line(trace), color=colour, linestyle=line, linewidth=0.7)
    axes.margins(x=0.01)
