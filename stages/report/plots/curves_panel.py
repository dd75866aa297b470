"""Paint numbers over time: bands, lines and levels."""

from __future__ import annotations

from matplotlib.ticker import FuncFormatter, NullLocator

from shukotsu.stages.report.palette import INK, PAPER, RULE, SOFT
from shukotsu.stages.report.plots.description import CurvesPanel, Panel
from shukotsu.stages.report.plots.rows_panel import plain, ticks
from shukotsu.stages.report.plots.style import SMALL_PT, Margins, Place, Sheet

_MARKS = 8
"""About as many marks tell a line apart from others; they are no samples."""


def margins(panel: CurvesPanel, _before: Panel | None) -> Margins:
    """Give room for both axes' numbers and words."""
    return Margins(13.0 if panel.y_label else 9.0, 2.0, 0.0, 9.0 if panel.x_label else 1.0)


def height_mm(panel: CurvesPanel, _width_mm: float) -> float:
    """Give the height that it asks for."""
    return panel.height_mm


def paint(place: Place, panel: CurvesPanel, sheet: Sheet) -> None:
    """Paint the panel."""
    axes = place.axes()
    axes.set_xlim(panel.x_scale.low, panel.x_scale.high)
    axes.set_yscale(panel.y_scale.kind)
    axes.set_ylim(panel.y_scale.low, panel.y_scale.high)
    at = ticks(panel.y_scale, 0.16)
    axes.set_yticks(at, [plain(tick, 0) for tick in at])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(plain))
    axes.tick_params(labelbottom=bool(panel.x_label))
    axes.grid(axis="y", clip_on=False)
    axes.set_xlabel(sheet.words(panel.x_label))
    axes.set_ylabel(sheet.words(panel.y_label))
    for band in panel.bands:
        axes.fill_between(band.x, band.low, band.high, color=band.colour, alpha=band.opacity, linewidth=0)
    for height in panel.levels:
        axes.axhline(height, color=RULE, linewidth=0.8)
    for order, line in enumerate(panel.lines):
        step = max(1, len(line.x) // _MARKS)
        axes.plot(
            line.x, line.y, color=line.colour, linestyle=line.style, linewidth=line.width, marker=line.marker,
            markersize=3.0, markevery=(int(line.phase * step), step), markeredgecolor=PAPER,
            markeredgewidth=0.3, zorder=2.5 + order / 100,
        )  # fmt: skip
    for start, end in panel.marked:
        axes.axvspan(start, end, ymax=0.03, color=INK)
    if panel.words:
        axes.text(
            0.02, 0.5, sheet.words(panel.words), transform=axes.transAxes, va="center", fontsize=SMALL_PT,
            color=SOFT,
        )  # fmt: skip
