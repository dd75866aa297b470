"""Joint angles over the cycle, as movement scientists draw them: a panel a joint, means with their spread.

Of a recording the mean over its cycles, a line an angle; of a study the mean over subjects of flexion, a line
a group. Shade: one standard deviation to either side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from shukotsu.movement.cycle_curves import PERCENT
from shukotsu.report.figures.drawings import NoDataError, count_range, study_text
from shukotsu.report.figures.panels import FOOT_MM, PLAIN, Panel, in_rows, print_figure
from shukotsu.report.movement_results import Curve, StudyMovement, recording_curves, why_no_curves
from shukotsu.report.palette import HUES, INK, RULE, level_looks
from shukotsu.report.study_results import StudyResults
from shukotsu.study.layout import Layout
from shukotsu.study.study import Recording
from shukotsu.translation import N_, tr, word

_PANEL_MM, _ACROSS = 24.0, 4


class CurveLook(NamedTuple):
    """Name of a line, its colour, and its dashes."""

    label: str
    colour: str
    style: str = "-"


ANGLE_LOOKS = {
    "flexion": CurveLook(N_("Flexion"), INK),
    "abduction": CurveLook(N_("Abduction or deviation"), HUES["sky"][0], "--"),
    "rotation": CurveLook(N_("Axial rotation"), HUES["vermilion"][0], ":"),
}
_STYLES = ("-", "--", ":", "-.")


def angle_looks() -> dict[str, CurveLook]:
    """Return the look of each of ANGLES, in the language in use."""
    return {angle: look._replace(label=tr(look.label)) for angle, look in ANGLE_LOOKS.items()}


def group_looks(levels: Iterable[str]) -> dict[str, CurveLook]:
    """Return the look of each level of a factor; of all subjects alike where they have the one level ''."""
    if (names := list(levels)) == [""]:
        return {"": CurveLook(tr("all subjects"), INK)}
    colours = level_looks(names)
    return {
        name: CurveLook(word(name), colours[name].colour, _STYLES[index % len(_STYLES)])
        for index, name in enumerate(names)
    }


def legend_handles(looks: Iterable[CurveLook]) -> list[Line2D]:
    """Return what a legend shows."""
    return [Line2D([], [], color=c, linestyle=cast(Any, style), label=name) for name, c, style in looks]


def curve_panels(
    title: str, joints: Mapping[str, Mapping[str, Curve]], looks: Mapping[str, CurveLook]
) -> dict[str, Panel]:
    """Return a panel a joint, all to one scale; its heading says of how many cycles or subjects it is.

    joints : by joint, curves by the names of `looks`.
    """
    ends = [
        curve.mean_deg + side * np.nan_to_num(curve.sd_deg)
        for curves in joints.values()
        for curve in curves.values()
        for side in (-1.0, 1.0)
    ]
    low, high = np.nanmin(ends), np.nanmax(ends)
    pad = 0.06 * (high - low) or 1.0
    panels = {}
    for joint, curves in joints.items():
        shown = {name: curves[name] for name in looks if name in curves}
        counts = list(dict.fromkeys(count_range(curve.n.astype(int)) for curve in shown.values()))
        draw = partial(_draw_curves, curves=shown, looks=looks, limits_deg=(low - pad, high + pad))
        heading = tr("{joint}, n = {n}", joint=word(joint), n=tr(", ").join(counts))
        panels[joint] = Panel(heading, f"{title}: {heading}.", _PANEL_MM, FOOT_MM, draw)
    return panels


def _draw_curves(
    axes: Axes,
    curves: Mapping[str, Curve],
    looks: Mapping[str, CurveLook],
    limits_deg: tuple[float, float],
) -> None:
    """Draw each mean over the percents of the cycle, and one standard deviation to either side."""
    axes.set(xlim=(0, 100), ylim=limits_deg, xlabel=tr("Cycle [%]"), ylabel=tr("Angle [deg]"))
    axes.xaxis.set_major_locator(MultipleLocator(25))
    axes.yaxis.set_major_formatter(PLAIN)
    axes.grid(axis="y")
    axes.axhline(0.0, color=RULE, linewidth=0.8)
    for name, (mean, sd, _) in ((name, (c.mean_deg, c.sd_deg, c.n)) for name, c in curves.items()):
        label, colour, style = looks[name]
        axes.fill_between(PERCENT, mean - sd, mean + sd, color=colour, alpha=0.2, linewidth=0)
        axes.plot(PERCENT, mean, color=colour, linestyle=style, linewidth=1.2, label=label)


def digit_rows(layout: Layout, joints: Iterable[str]) -> list[list[str]]:
    """Return the joints in rows: of each digit, then the others."""
    names, children = list(joints), {name: joint.child for name, joint in layout.joints.items()}
    rows = [
        [joint for joint in names if joint in digit.joints or children.get(joint) in digit.segments]
        for digit in layout.digits.values()
    ]
    others = [joint for joint in names if not any(joint in row for row in rows)]
    return [row for row in (*rows, others) if row]


def recording_cycles(
    results: StudyResults, recording: Recording, model: str, event: str, words: str
) -> tuple[Figure, str]:
    """Draw a panel a joint, digits in rows: means over the cycles that begin at an event, or at the first.

    words : the recording's. Raises NoDataError where no angle is averaged.
    """
    curves = recording_curves(results, recording, model)
    if not curves:
        raise NoDataError(why_no_curves(results, recording, model))
    event = event or next(iter(curves))
    panels = curve_panels(words, curves[event], angle_looks())
    rows = [
        [panels[joint] for joint in row] for row in digit_rows(results.layouts[recording.hand], curves[event])
    ]
    return print_figure(rows, legend_handles(angle_looks().values())), tr(
        "Joint angles over the cycle of {recording_text}, model {model}: means over n cycles, each from one "
        "event “{event}” to the next or to its own end, at every percent of its duration [deg]. Shade: one "
        "standard deviation over cycles to either side. Flexion, ulnar deviation and pronation are "
        "positive. A cycle with a gap counts where it is measured.",
        recording_text=words,
        model=model,
        event=event,
    )


def study_panels(movement: StudyMovement, groups: Mapping[str, str]) -> dict[str, list[Panel]]:
    """Return by each task and event, in words, a panel a joint: flexion over subjects, a line a group."""
    looks, of_tasks = group_looks(dict.fromkeys(groups.values())), {}
    for (task, event), joints in movement.level_curves(groups).items():
        words = tr("{task}, cycles from “{event}”", task=task, event=event)
        of_tasks[words] = list(curve_panels(words, joints, looks).values())
    return of_tasks


def study_cycles(
    results: StudyResults, movement: StudyMovement, groups: Mapping[str, str]
) -> tuple[Figure, str]:
    """Draw a panel a joint, task by task. Raises NoDataError where no recording has cycles.

    groups : each subject's level of the factor that is drawn.
    """
    of_tasks = study_panels(movement, groups)
    if not of_tasks:
        raise NoDataError(tr(NO_CYCLES))
    rows: list[Sequence[Panel]] = [row for panels in of_tasks.values() for row in in_rows(panels, _ACROSS)]
    looks = group_looks(dict.fromkeys(groups.values()))
    return print_figure(rows, legend_handles(looks.values())), tr(
        "Flexion over the cycle, task by task ({tasks}): mean over subjects of each subject’s own mean cycle "
        "[deg], at every percent of the cycle; n subjects of every line, in the legend’s order. Shade: one "
        "standard deviation over subjects to either side. {study_text} Model {model}. Hands with a suspect "
        "finding are left out.",
        tasks="; ".join(of_tasks),
        study_text=study_text(results),
        model=movement.model,
    )


NO_CYCLES = N_(
    "no angle is averaged over cycles, for no recording of a task has cycles that can be used; they begin at "
    "events, which the study’s sheet of events lists"
)
