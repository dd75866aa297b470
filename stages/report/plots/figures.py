"""Draw a described plot with matplotlib: all panels for print, or one for a page.

Places are computed from the panels' own sizes, in mm: no layout is searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from string import ascii_lowercase
from typing import Any, cast

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from shukotsu.sentences.translation import ENGLISH, language
from shukotsu.stages.report.palette import INK
from shukotsu.stages.report.plots import curves_panel, hand_panel, rows_panel
from shukotsu.stages.report.plots.description import (
    CurvesPanel,
    HandPanel,
    Key,
    Panel,
    Plot,
    RowsPanel,
)
from shukotsu.stages.report.plots.style import LARGE_PT, SMALL_PT, Margins, Place, Sheet, width_mm, wrapped

PAGE_MM = 106.0
"""How wide a page's picture is before the page gives it its width."""
_LINE_MM, _LEGEND_LINE_MM, _KEY_MM, _GAP_MM = 3.2, 4.2, 8.0, 1.5
_PAINTERS: dict[type, Any] = {RowsPanel: rows_panel, CurvesPanel: curves_panel, HandPanel: hand_panel}


def draw(plot: Plot) -> Figure:
    """Draw a plot for print."""
    sheet, names = Sheet(on_page=False), iter(panel_names(len(plot.panels)))
    boxes: list[tuple[Panel, str, Margins, tuple[float, float, float, float]]] = []
    most, down = max(map(len, plot.rows)), _legend_mm(plot)
    for row in plot.rows:
        margins = [_margins(panel, row[:place]) for place, panel in enumerate(row)]
        taken = sum(own.left + own.right for own in margins) + (most - len(row)) * (
            margins[-1].left + margins[-1].right
        )
        width = (plot.width_mm - taken) / most
        headings = [wrapped(panel.heading, int(width / width_mm("m")) - 3) for panel in row]
        down += _GAP_MM + _LINE_MM * max(map(len, headings)) + max(own.top for own in margins)
        heights = [_height(panel, width) for panel in row]
        across = 0.0
        for panel, own, lines, height in zip(row, margins, headings, heights, strict=True):
            boxes.append((panel, "\n".join(lines), own, (across + own.left, down, width, height)))
            across += own.left + width + own.right
        down += max(height + own.foot for height, own in zip(heights, margins, strict=True))
    figure = Figure(figsize=(plot.width_mm / 25.4, down / 25.4))
    for panel, heading, own, (left, top, width, height) in boxes:
        above = 1 - (top - own.top - _GAP_MM / 2) / down
        weight = "bold" if language() == ENGLISH else "normal"
        figure.text(left / plot.width_mm, above, next(names), va="bottom", fontweight=weight)
        right = (left + width) / plot.width_mm
        figure.text(right, above, heading, va="bottom", ha="right", fontsize=SMALL_PT)
        _PAINTERS[type(panel)].paint(Place(figure, left, top, width, height, own), panel, sheet)
    if plot.legend:
        figure.legend(handles=[_handle(key) for key in plot.legend], loc="upper center", ncols=_columns(plot))
    return figure


def draw_for_page(panel: Panel) -> tuple[Figure, Sheet]:
    """Draw one panel for a page, whose own words stand for the heading, and what a pointer is told."""
    sheet, own = Sheet(on_page=True), _margins(panel, ())
    width = PAGE_MM - own.left - own.right
    height = _height(panel, width)
    figure = Figure(figsize=(PAGE_MM / 25.4, (own.top + height + own.foot) / 25.4))
    figure.patch.set_visible(False)
    _PAINTERS[type(panel)].paint(Place(figure, own.left, own.top, width, height, own), panel, sheet)
    return figure, sheet


def panel_names(n: int) -> list[str]:
    """Name n panels: a to z, then aa and on; one alone has no name."""
    names = [*ascii_lowercase, *(a + b for a in ascii_lowercase for b in ascii_lowercase)]
    return names[:n] if n > 1 else [""]


def lettered(sentences: Sequence[str]) -> str:
    """A caption's sentences about the panels, each after its panel's letter."""
    names = panel_names(len(sentences))
    return " ".join(f"({name}) {own}" if name else own for name, own in zip(names, sentences, strict=True))


def _margins(panel: Panel, before: Sequence[Panel]) -> Margins:
    own: Margins = _PAINTERS[type(panel)].margins(panel, before[-1] if before else None)
    return own


def _height(panel: Panel, width: float) -> float:
    return float(_PAINTERS[type(panel)].height_mm(panel, width))


def _columns(plot: Plot) -> int:
    widest = max(width_mm(key.words) for key in plot.legend) + _KEY_MM
    return max(1, min(len(plot.legend), int(plot.width_mm / widest)))


def _legend_mm(plot: Plot) -> float:
    return 2.0 + _LEGEND_LINE_MM * -(-len(plot.legend) // _columns(plot)) if plot.legend else 0.0


def _handle(key: Key) -> Line2D | Patch:
    """An entry of a legend."""
    words = Sheet(on_page=False).words(key.words)
    if key.bar is not None:
        return Patch(label=words, edgecolor=INK, linewidth=0.4, facecolor=key.bar.fill, hatch=key.bar.hatch)
    colour, style = key.line or (INK, "none")
    handle = Line2D([], [], color=colour, linestyle=cast(Any, style), label=words, markersize=0.5 * LARGE_PT)
    if key.mark is not None:
        handle.set(marker=key.mark.shape, markerfacecolor=key.mark.face, markeredgecolor=key.mark.edge)
    return handle
