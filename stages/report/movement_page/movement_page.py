"""The page that answers what a study asks of its subjects' movement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from shukotsu.stages.report.links import link
from shukotsu.stages.report.methods_text import movement_paragraph
from shukotsu.stages.report.movement_page.movement_numbers import (
    difference_tables,
    range_table,
    reliability_tables,
)
from shukotsu.stages.report.movement_page.movement_panels import (
    MOST_CONTRASTS,
    contrasts,
    range_panels,
)
from shukotsu.stages.report.movement_page.movement_results import Movement
from shukotsu.stages.report.movement_page.movement_text import (
    PAIR,
    groups_differ,
    moved_most,
    repeats,
    why_nothing,
)
from shukotsu.stages.report.plots.page_pictures import page_picture
from shukotsu.stages.report.plots.panels import Panel
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.templates import render


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
        ranges=_drawn(range_panels(movement, digits)),
        why_nothing=why_nothing(movement),
        range_table=range_table(movement) if len(movement.ranges) else None,
        contrasts=_contrasts(movement, digits),
        undrawn=max(0, len(movement.differences.drop_duplicates(PAIR)) - MOST_CONTRASTS),
        difference_tables=difference_tables(movement),
        reliability_tables=reliability_tables(movement),
        methods=movement_paragraph(movement),
    )


def _contrasts(movement: Movement, digits: Sequence[str]) -> list[dict[str, Any]]:
    """Draw each contrast with its panels."""
    return [{"words": own.words, "pictures": _drawn(own.panels)} for own in contrasts(movement, digits)]


def _drawn(panels: Sequence[Panel]) -> list[tuple[str, Markup]]:
    """Give headings and pictures."""
    return [(panel.heading, page_picture(panel)) for panel in panels]
