"""A study's figures of movement: ranges by joint, differences of levels, curves, agreement of sessions."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stages.report.movement_page.movement_panels import (
    Drawn,
    Strips,
    agreement_plots,
    curve_difference_plots,
    curve_plots,
    difference_strips,
    range_strips,
)
from stages.report.movement_page.movement_results import RANGE, Movement
from stages.report.palette import RULE
from stages.report.pictures.subject_dots import Strip
from stages.report.pictures.xy_plot import XYPlot
from stages.report.print_figures.drawing import NoDataError, count_range, study_text
from stages.report.print_figures.style import (
    TWO_COLUMNS_MM,
    dots,
    headings,
    label,
    new_figure,
    scattered,
)
from stages.report.study_results import StudyResults
from stages.report.wording import say, told, word

_ACROSS = 3
_ROW_MM, _FOOT_MM, _PLOT_MM = 4.2, 16.0, 46.0


def ranges_of_motion(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw a panel a hand, task and angle. Raises NoDataError without joint angles."""
    panels = range_strips(movement, _digits(results))
    if not panels:
        raise NoDataError(say("no recording of this study has joint angles"))
    figure = _rows_of_joints(panels, _range_row)
    figure.supxlabel(say("Range of motion [deg]"), fontsize="medium")
    n = count_range(len(strip.numbers) for panel in panels for strip in panel.strips)
    return figure, (
        say(
            (
                "Range of motion (2.5th to 97.5th percentile of the angle) of every joint angle [deg]. "
                "{study_text} Model {model}. A dot is a subject (n = {n}), the mean over trials and "
                "sessions; mark: median; bar: quartiles. Colour: the joint's digit. Hands with a suspect "
                "finding are left out."
            ),
            study_text=study_text(results),
            model=movement.model,
            n=n,
        )
    )


def group_differences(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw the first factor's first two levels. Raises NoDataError where nothing is compared."""
    contrasts = difference_strips(movement, _digits(results))
    if not contrasts:
        raise NoDataError(say("the study names no factor with two levels, so nothing is compared"))
    first = contrasts[0]
    figure = _rows_of_joints(first.panels, _difference_row)
    figure.supxlabel(
        label(say("Difference in range of motion, {words} [deg]", words=first.words)), fontsize="medium"
    )
    rows = movement.differences
    rows = rows[(rows["quantity"] == RANGE) & (rows["factor"] == first.levels[0])]
    rows = rows[(rows["level"] == first.levels[1]) & (rows["other_level"] == first.levels[2])]
    tests = ", ".join(sorted(told(test) for test in rows["test"].unique() if test)) or say(
        "none, for want of subjects"
    )
    others = "; ".join(each.words for each in contrasts[1:])
    return figure, (
        say(
            (
                "Difference in range of motion, {words}, by joint [deg]. {study_text} Model {model}. "
                "Mark: mean difference, filled where it is shown at 5 % over all joint angles "
                "(max-t permutation); bar: 95 % interval. Test: {tests}. n = {n} and {n_other} subjects; "
                "left out: {left_out}."
            ),
            words=first.words,
            study_text=study_text(results),
            model=movement.model,
            tests=tests,
            n=count_range(rows["n"].astype(int)),
            n_other=count_range(rows["n_other"].astype(int)),
            left_out=count_range(rows["left_out"].astype(int)),
        )
        + (say(" Not drawn: {others}; see the movement page.", others=others) if others else "")
    )


def movement_curves(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw mean curves, then differences. Raises NoDataError without cycles."""
    means, differences = curve_plots(movement, _digits(results)), curve_difference_plots(movement)
    if not means and not differences:
        raise NoDataError(say("no movement was cut into cycles, for the study has no events"))
    figure = _plots([*means, *differences])
    return figure, (
        say(
            (
                "Course of joint angles over a cycle. {study_text} Model {model}. First {n_means} "
                "panels: mean over subjects of those joints that moved most, shade one standard "
                "deviation between subjects. {curve_differences_text}{list}"
            ),
            study_text=study_text(results),
            model=movement.model,
            n_means=len(means),
            curve_differences_text=_curve_differences_text(len(differences)),
            list=_list(means + differences),
        )
    )


def agreement(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw Bland-Altman plots. Raises NoDataError where no hand was recorded in two sessions."""
    drawn = agreement_plots(movement)
    if not drawn:
        raise NoDataError(say("no range of motion was measured in two sessions by enough subjects"))
    return _plots(drawn), (
        say(
            (
                "Agreement of sessions in range of motion (Bland-Altman) [deg]. {study_text} Model "
                "{model}. A dot is a subject's difference between a session and the next, over their "
                "mean; line: mean difference; dashed: 95 % limits of agreement. {list}"
            ),
            study_text=study_text(results),
            model=movement.model,
            list=_list(drawn),
        )
    )


def _curve_differences_text(count: int) -> str:
    if not count:
        return ""
    return say(
        (
            "Last {count}: difference between two levels, shade its pointwise 95 % interval; bar at "
            "the foot: where it is shown at 5 % for this curve alone, by permutation of the largest "
            "|t|; p: corrected over all joint angles (Holm). "
        ),
        count=count,
    )


def _list(drawn: Sequence[Drawn]) -> str:
    return say("Panels, row by row: ") + say("{parts}.", parts="; ".join(each.heading for each in drawn))


def _digits(results: StudyResults) -> list[str]:
    return list(dict.fromkeys(digit for layout in results.layouts.values() for digit in layout.digits))


def _rows_of_joints(panels: Sequence[Strips], draw: Callable[[Axes, int, Strip], None]) -> Figure:
    """Panels with a row a joint, the first on top, three panels side by side."""
    down = -(-len(panels) // _ACROSS)
    most = max(len(panel.strips) for panel in panels)
    figure = new_figure(TWO_COLUMNS_MM, 8.0 + down * (_FOOT_MM + _ROW_MM * most))
    axes = list(figure.subplots(down, _ACROSS, squeeze=False).ravel())
    for spare in axes[len(panels) :]:
        spare.set_visible(False)
    for own, panel in zip(axes, panels, strict=False):
        for row, strip in enumerate(panel.strips):
            draw(own, row, strip)
        own.set_yticks(range(len(panel.strips)), [label(word(strip.model)) for strip in panel.strips])
        own.set_ylim(len(panel.strips) - 0.4, -0.6)
        own.tick_params(axis="y", length=0)
        own.grid(axis="x")
    headings(
        axes[: len(panels)],
        [
            say("{angle},\n{place}", angle=label(word(panel.angle)), place=label(panel.place))
            for panel in panels
        ],
    )
    return figure


def _range_row(axes: Axes, row: int, strip: Strip) -> None:
    values = np.array(list(strip.numbers.values()))
    dots(axes, values, row + scattered(len(values), 0.6), strip.look.colour)
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    axes.plot([low, high], [row, row], color="black", linewidth=1.2, solid_capstyle="butt")
    axes.plot([middle], [row], "|", color="black", markersize=6.0, markeredgewidth=1.2)
    axes.set_xlim(
        0.0, max(axes.get_xlim()[1], 1.06 * float(values.max())) if row else 1.06 * float(values.max())
    )


def _difference_row(axes: Axes, row: int, strip: Strip) -> None:
    axes.axvline(0.0, color="black", linewidth=0.6, zorder=1)
    if strip.interval is not None:
        axes.plot(strip.interval, [row, row], color=strip.look.colour, linewidth=1.2, solid_capstyle="butt")
    axes.plot(
        [strip.mean or 0.0], [row], "o", color=strip.look.colour, markersize=3.6, linestyle="none",
        markerfacecolor=strip.look.colour if strip.baseline else "white", markeredgewidth=0.8,
    )  # fmt: skip


def _plots(drawn: Sequence[Drawn]) -> Figure:
    """Plots, three side by side."""
    down = -(-len(drawn) // _ACROSS)
    figure = new_figure(TWO_COLUMNS_MM, 4.0 + _PLOT_MM * down)
    axes = list(figure.subplots(down, _ACROSS, squeeze=False).ravel())
    for spare in axes[len(drawn) :]:
        spare.set_visible(False)
    for own, each in zip(axes, drawn, strict=False):
        _plot(own, each.plot)
    headings(axes[: len(drawn)], [label(each.heading.partition(", ")[0]) for each in drawn])
    return figure


def _plot(axes: Axes, plot: XYPlot) -> None:
    if plot.band is not None:
        axes.fill_between(*plot.band, color=RULE, linewidth=0)
    for height, dashed in plot.levels:
        axes.axhline(height, color="black", linewidth=0.8, linestyle="--" if dashed else "-")
    for x, y, colour in plot.lines:
        axes.plot(x, y, color=colour, linewidth=1.2)
    if plot.points is not None:
        dots(axes, *plot.points, plot.colour)
    for start, end in plot.marked:
        axes.axvspan(start, end, ymax=0.03, color="black")
    axes.set_xlabel(plot.words[0][:1].upper() + plot.words[0][1:])
    axes.set_ylabel(plot.words[1][:1].upper() + plot.words[1][1:])
