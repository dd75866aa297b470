"""A figure: panels, each a function that draws into axes, in a grid for print or alone for a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from string import ascii_lowercase

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from shukotsu.sentences.translation import ENGLISH, language
from shukotsu.stages.report.plots.style import SMALL_PT, TWO_COLUMNS_MM, width_mm, wrapped

PAGE_MM = 106.0
"""How wide a page's picture is before the page gives it its width."""
_LINE_MM, _LEGEND_LINE_MM, _KEY_MM, _GAP_MM, _PAD_MM = 3.2, 4.2, 9.0, 2.0, 1.6


@dataclass(frozen=True)
class Panel:
    """A panel: heading, title for who cannot see it, heights of axes and words below, what draws it."""

    heading: str
    title: str
    height_mm: float
    foot_mm: float
    draw: Callable[[Axes], None]


def in_rows(panels: Sequence[Panel], across: int) -> list[Sequence[Panel]]:
    """Return the panels in rows of so many."""
    return [panels[start : start + across] for start in range(0, len(panels), across)]


def print_figure(
    rows: Sequence[Sequence[Panel]], handles: Sequence[Artist] = (), figure_mm: float = TWO_COLUMNS_MM
) -> Figure:
    """Return rows of panels, each with its letter and heading, below a legend."""
    across, names = max(map(len, rows)), iter(panel_names(sum(map(len, rows))))
    widest = max((width_mm(str(handle.get_label())) for handle in handles), default=0.0) + _KEY_MM
    columns = max(1, min(len(handles), int(figure_mm / widest)))
    letters = int((figure_mm / across - 12.0) / width_mm("m"))
    headings = [["\n".join(wrapped(panel.heading, letters)) for panel in row] for row in rows]
    heights = [max(panel.height_mm for panel in row) for row in rows]
    down = sum(heights) + _LEGEND_LINE_MM * -(-len(handles) // columns)
    for row, texts in zip(rows, headings, strict=True):
        down += max(panel.foot_mm for panel in row) + _GAP_MM
        down += _LINE_MM * (1 + max(text.count("\n") for text in texts))
    figure = _laid_out(figure_mm, down)
    grid = figure.add_gridspec(len(rows), across, height_ratios=heights)
    for place, row in enumerate(rows):
        drawn = [figure.add_subplot(grid[place, column]) for column in range(len(row))]
        for axes, panel, heading in zip(drawn, row, headings[place], strict=True):
            panel.draw(axes)
            weight = "bold" if language() == ENGLISH else "normal"
            axes.set_title(next(names), loc="left", fontweight=weight)
            axes.set_title(heading, loc="right", fontsize=SMALL_PT)
        lines = [[label.get_text() for label in axes.get_yticklabels()] for axes in drawn]
        for (before, after), axes in zip(pairwise(lines), drawn[1:], strict=True):
            axes.tick_params(labelleft=before != after)
    if handles:
        figure.legend(handles=handles, loc="outside upper center", ncols=columns)
    return figure


def page_figure(panel: Panel) -> Figure:
    """Return one panel for a page, whose own words stand for the heading."""
    figure = _laid_out(PAGE_MM, panel.height_mm + panel.foot_mm)
    figure.patch.set_visible(False)
    panel.draw(figure.add_subplot())
    return figure


def _laid_out(width: float, height: float) -> Figure:
    engine = ConstrainedLayoutEngine(w_pad=_PAD_MM / 25.4)
    return Figure(figsize=(width / 25.4, height / 25.4), layout=engine)


def panel_names(n: int) -> list[str]:
    """Return the names of n panels: a to z, then aa and on; one alone has no name."""
    names = [*ascii_lowercase, *(a + b for a in ascii_lowercase for b in ascii_lowercase)]
    return names[:n] if n > 1 else [""]


def lettered(sentences: Sequence[str]) -> str:
    """Return a caption's sentences about the panels, each after its panel's letter."""
    names = panel_names(len(sentences))
    return " ".join(f"({name}) {text}" if name else text for name, text in zip(names, sentences, strict=True))
