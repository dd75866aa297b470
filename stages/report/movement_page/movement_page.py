"""The page that answers what a study asks of its subjects' movement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from stages.report.links import link
from stages.report.methods_text import movement_paragraph
from stages.report.models_compared.sections import Panels
from stages.report.movement_page.movement_numbers import (
    dependence_table,
    difference_tables,
    range_table,
    reliability_tables,
)
from stages.report.movement_page.movement_panels import (
    Drawn,
    Strips,
    agreement_plots,
    curve_difference_plots,
    curve_plots,
    difference_strips,
    range_strips,
)
from stages.report.movement_page.movement_results import Movement
from stages.report.movement_page.movement_text import (
    groups_differ,
    model_matters,
    moved_most,
    repeats,
)
from stages.report.pictures.scale import Scale
from stages.report.pictures.subject_dots import Panel, Strip, difference_scale, draw_panels, value_scale
from stages.report.pictures.xy_plot import Array, shared_scale, xy_picture
from stages.report.study_results import StudyResults
from stages.report.table_cells import capital
from stages.report.templates import render
from stages.report.wording import say, word


def render_movement(results: StudyResults, movement: Movement) -> str:
    """Give the movement page; the same results give the same text."""
    digits = list(dict.fromkeys(digit for layout in results.layouts.values() for digit in layout.digits))
    page = results.paths.movement_page
    return render(
        "movement_page/movement_page.html.j2",
        study=results.name,
        model=movement.model,
        to_study=link(results.name, page, results.paths.report),
        moved=moved_most(movement),
        differ=groups_differ(movement),
        repeats=repeats(movement),
        matters=model_matters(movement),
        ranges=_range_panels(movement, digits),
        range_table=range_table(movement) if len(movement.ranges) else None,
        contrasts=_difference_panels(movement, digits),
        difference_tables=difference_tables(movement),
        curves=_plots(curve_plots(movement, digits)),
        curve_differences=_plots(curve_difference_plots(movement)),
        agreement=_plots(agreement_plots(movement)),
        reliability_tables=reliability_tables(movement),
        dependence=dependence_table(movement) if len(movement.dependence) else None,
        methods=movement_paragraph(movement),
    )


def _range_panels(movement: Movement, digits: Sequence[str]) -> Panels | None:
    """Every subject's range of motion."""
    found = range_strips(movement, digits)
    if not found:
        return None
    n_subjects = movement.ranges["subject"].nunique()
    caption = say(
        "A dot is a subject: the range from the 2.5th to the 97.5th percentile of the angle, "
        "mean over trials and sessions, in the colour of the joint's digit."
    )
    return _drawn(found, caption, value_scale, n_subjects, say("range of motion"), ("", ""))


def _difference_panels(movement: Movement, digits: Sequence[str]) -> list[dict[str, Any]]:
    """Each contrast with its panels."""
    made = []
    for contrast in difference_strips(movement, digits):
        _, level, other = contrast.levels
        sides = (say("{other} more ←", other=other), say("→ {level} more", level=level))
        panels = _drawn(contrast.panels, "", difference_scale, 0, f"difference, {contrast.words}", sides)
        made.append({"words": contrast.words, "panels": panels})
    return made


def _drawn(
    found: Sequence[Strips],
    caption: str,
    scale_of: Callable[[Array], Scale],
    n_subjects: int,
    what: str,
    sides: tuple[str, str],
) -> Panels:
    """The panels, those of one angle on one scale: a rotation is a tenth of a flexion."""
    drawn: list[tuple[str, Markup]] = []
    for angle in dict.fromkeys(each.angle for each in found):
        own = [each for each in found if each.angle == angle]
        scale = scale_of(
            np.array([value for each in own for strip in each.strips for value in _drawn_of(strip)])
        )
        unit = {"log": say("deg, log scale"), "asinh": say("deg, even about 0, squeezed outward")}.get(
            scale.kind, "deg"
        )
        names = [f"{capital(word(angle))}, {each.place}" for each in own]
        panels = [
            Panel(name, say("{name}: {what} by joint.", name=name, what=what), each.strips)
            for name, each in zip(names, own, strict=True)
        ]
        drawn += zip(names, draw_panels(panels, scale, unit, n_subjects, sides).pictures, strict=True)
    return Panels(caption, tuple(drawn), ())


def _drawn_of(strip: Strip) -> list[float]:
    """What of a row its scale must hold."""
    mean = [] if strip.mean is None else [strip.mean]
    return [*strip.numbers.values(), *mean, *(strip.interval or ())]


def _plots(found: Sequence[Drawn]) -> list[tuple[str, Any]]:
    """Headings and pictures, all of one vertical scale."""
    if not found:
        return []
    scale = shared_scale([each.plot for each in found])
    return [(each.heading, xy_picture(each.plot, scale)) for each in found]
