"""A study's figures of movement: ranges by joint, differences of levels."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from shukotsu.sentences.translation import tr
from shukotsu.stages.report.movement_page.movement_panels import (
    agreement_plots,
    contrasts,
    curve_plots,
    range_panels,
)
from shukotsu.stages.report.movement_page.movement_results import PLACE, RANGE, Movement
from shukotsu.stages.report.movement_page.movement_text import why_nothing
from shukotsu.stages.report.plots.panels import Panel, in_rows, print_figure
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, study_text
from shukotsu.stages.report.study_results import StudyResults

_ACROSS = 3


def ranges_of_motion(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw a panel an angle. Raises NoDataError without joint angles."""
    panels = range_panels(movement, _digits(results))
    if not panels:
        raise NoDataError(why_nothing(movement))
    n = count_range(movement.subject_means.groupby([*PLACE, "joint", "angle"]).size())
    return print_figure(in_rows(panels, _ACROSS)), (
        tr(
            "Range of motion (2.5th to 97.5th percentile of the angle) of every joint angle [deg]. "
            "{study_text} Model {model}. A dot is a subject (n = {n}), the mean over trials and "
            "sessions; mark: median; bar: quartiles. Colour: the joint's digit. Hands with a suspect "
            "finding are left out.",
            study_text=study_text(results),
            model=movement.model,
            n=n,
        )
    )


def group_differences(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw the first factor's first two levels. Raises NoDataError where nothing is compared."""
    found = contrasts(movement, _digits(results))
    if not found:
        raise NoDataError(tr("no two levels of a factor are compared; the movement page says why"))
    first = found[0]
    rows = movement.differences
    rows = rows[(rows["quantity"] == RANGE) & (rows["factor"] == first.levels[0])]
    rows = rows[(rows["level"] == first.levels[1]) & (rows["other_level"] == first.levels[2])]
    others = "; ".join(each.words for each in found[1:])
    return print_figure(in_rows(first.panels, _ACROSS)), (
        tr(
            "Difference in range of motion, {words}, by joint [deg]. {study_text} Model {model}. "
            "Mark: mean difference, filled where it is shown at 5 % over every number of these levels; "
            "bar: 95 % interval. n = {n} and {n_other} subjects; "
            "left out: {left_out}.",
            words=first.words,
            study_text=study_text(results),
            model=movement.model,
            n=count_range(rows["n"].astype(int)),
            n_other=count_range(rows["n_other"].astype(int)),
            left_out=count_range(rows["left_out"].astype(int)),
        )
        + (tr(" Not drawn: {others}; see the movement page.", others=others) if others else "")
    )


def _digits(results: StudyResults) -> list[str]:
    return list(dict.fromkeys(digit for layout in results.layouts.values() for digit in layout.digits))
