"""Paint named rows of dots with what is marked among them, over one horizontal scale."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.palette import INK, PAPER, SOFT, Look
from shukotsu.stages.report.plots.description import Array, Panel, Row, RowsPanel, Scale
from shukotsu.stages.report.plots.style import SMALL_PT, Margins, Place, Sheet, width_mm
from shukotsu.stages.report.table_cells import number

FEWEST_FOR_QUARTILES = 4
MOST_NAMED = 30
"""The most subjects whose names a pointer is told; with more a page would grow too large."""

_ROW_MM, _SCATTER, _MOST_NAME_MM, _FOOT_MM, _NEXT_MM, _LINE_MM = 3.6, 0.6, 42.0, 9.0, 4.0, 3.4
_GOLDEN = (5**0.5 - 1) / 2


def margins(panel: RowsPanel, before: Panel | None) -> Margins:
    """Give room for the rows' names, unless the panel to the left has the same, and for the numbers."""
    named = not (isinstance(before, RowsPanel) and _names(before) == _names(panel))
    names = max(map(width_mm, _names(panel)))
    notes = [note for row in panel.rows if (note := _note(panel, row))]
    right = max(map(width_mm, [*notes, _heading(panel)])) if notes else 0.0
    top = _ROW_MM if notes or any(panel.sides) else 0.0
    left = min(names, _MOST_NAME_MM) + 2.5 if named else _NEXT_MM
    return Margins(left, right + 2.5, top, _FOOT_MM + _LINE_MM * panel.axis.count("\n"))


def height_mm(panel: RowsPanel, _width_mm: float) -> float:
    """Give the height of its rows and headings."""
    return _ROW_MM * len(_names(panel))


def paint(place: Place, panel: RowsPanel, sheet: Sheet) -> None:
    """Paint the panel, the first row on top."""
    axes = place.axes()
    places = list(_places(panel))
    axes.set_ylim(len(_names(panel)) - 0.5, -0.5)
    horizontal_axis(axes, panel.scale, sheet.words(panel.axis))
    if place.margins.left > _NEXT_MM:
        _write_names(axes, panel, sheet, place.width)
    _write_notes(axes, panel, places, place.width)
    if panel.scale.low < 0 < panel.scale.high:
        axes.axvline(0.0, color=SOFT, linewidth=0.6, zorder=1)
        for words, ha, aside in zip(panel.sides, ("right", "left"), (-3, 3), strict=True):
            axes.annotate(
                sheet.words(words), (0.0, -0.5), (aside, 2), textcoords="offset points", ha=ha,
                fontsize=SMALL_PT, color=SOFT,
            )  # fmt: skip
    _paint_bars(axes, places)
    _paint_dots(axes, places, sheet)
    _paint_marks(axes, places)


def horizontal_axis(axes: Axes, scale: Scale, words: str) -> None:
    """Give the horizontal axis the scale, with ticks at plain numbers and a grid; the other one nothing."""
    kind = {"linear_width": scale.even} if scale.kind == "asinh" else {}
    axes.set_xscale(scale.kind, **kind)
    axes.set_xlim(scale.low, scale.high)
    at = ticks(scale)
    axes.set_xticks(at, [plain(tick, 0) for tick in at])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_visible(False)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", clip_on=False)
    axes.tick_params(axis="x", length=0)
    axes.set_xlabel(words)


def plain(value: float, _place: int) -> str:
    """A number without trailing zeros, with a true minus sign, as matplotlib's formatters are called."""
    return f"{round(value, 9) + 0.0:g}".replace("-", "−")


PLAIN = FuncFormatter(plain)


def ticks(scale: Scale, apart: float = 0.12) -> list[float]:
    """Round numbers on the scale; of one that is not even as many as stand apart by a share of it."""
    if scale.kind == "linear":
        found = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(scale.low, scale.high)
        return [float(own) for own in found if scale.low <= own <= scale.high]

    def share(values: npt.ArrayLike) -> Array:
        even = np.log10 if scale.kind == "log" else lambda own: np.arcsinh(np.asarray(own) / scale.even)
        low, high = even(scale.low), even(scale.high)
        return np.asarray((even(np.asarray(values, float)) - low) / (high - low))

    kept: list[float] = []
    largest = max(-scale.low, scale.high)
    for steps in ((1, 2, 5), (1, 3), (1,)):
        decades = range(math.floor(math.log10(largest)) - 6, math.ceil(math.log10(largest)) + 1)
        sizes = [float(f"{step}e{decade}") for decade in decades for step in steps]
        if scale.kind == "asinh":
            far = np.abs(share(sizes) - share(0.0)) > apart
            sizes = [size for size, own in zip(sizes, far, strict=True) if own]
            sizes = [0.0, *sizes, *(-size for size in sizes)]
        kept = sorted(own for own in sizes if scale.low <= own <= scale.high)
        if np.diff(share(kept)).min(initial=1.0) > apart:
            break
    return kept


def scattered(n: int) -> Array:
    """Steps aside (n,) within a row, even about its middle and the same every time."""
    steps = (np.arange(n) * _GOLDEN) % 1.0
    return np.asarray((steps - steps.mean()) * _SCATTER) if n else np.zeros(0)


def _places(panel: RowsPanel) -> Iterator[tuple[Row, int]]:
    """Give every row with its place from the top, after its group's heading."""
    place = 0
    for group in panel.groups:
        place += bool(group.heading)
        for row in group.rows:
            yield row, place
            place += 1


def _names(panel: RowsPanel) -> list[str]:
    """Give the words of every line: headings of groups, and their rows."""
    return [
        own
        for group in panel.groups
        for own in (*([group.heading] if group.heading else []), *(word(row.name) for row in group.rows))
    ]


def _heading(panel: RowsPanel) -> str:
    """Return the heading of the notes."""
    return tr("mean") if any(row.mean is not None for row in panel.rows) else tr("median")


def _note(panel: RowsPanel, row: Row) -> str:
    """Give the row's mean or median in numbers, and of how many where not of all."""
    values = list(row.numbers.values())
    if not panel.of_all or (row.mean is None and not values):
        return ""
    shown = number(float(np.median(values)) if row.mean is None else row.mean).replace("-", "−")
    return shown + (f" (n = {len(values)})" if 0 < len(values) < panel.of_all else "")


def _write_names(axes: Axes, panel: RowsPanel, sheet: Sheet, width: float) -> None:
    rows, fits = {place for _, place in _places(panel)}, int(_MOST_NAME_MM / width_mm("m"))
    for place, name in enumerate(_names(panel)):
        axes.text(
            -1.5 / width, place, sheet.words(name if len(name) <= fits else name[: fits - 1] + "…"),
            ha="right", va="center", fontsize=SMALL_PT, transform=axes.get_yaxis_transform(),
            fontweight="normal" if place in rows else "bold",
        )  # fmt: skip


def _write_notes(axes: Axes, panel: RowsPanel, places: Sequence[tuple[Row, int]], width: float) -> None:
    aside, x = axes.get_yaxis_transform(), 1 + 1.5 / width
    notes = [(_note(panel, row), place) for row, place in places]
    for note, place in notes:
        if note:
            axes.text(x, place, note, va="center", fontsize=SMALL_PT, transform=aside)
    if any(note for note, _ in notes):
        axes.text(x, -0.6, _heading(panel), va="bottom", fontsize=SMALL_PT, color=SOFT, transform=aside)


def _paint_bars(axes: Axes, places: Sequence[tuple[Row, int]]) -> None:
    """Paint stacked bars from 0 on, those of one fill together."""
    foot: dict[int, float] = defaultdict(float)
    for index in range(max((len(row.bars) for row, _ in places), default=0)):
        own = [(row.bars[index], place) for row, place in places if len(row.bars) > index]
        axes.barh(
            [place for _, place in own], [bar.length for bar, _ in own], 0.8,
            [foot[place] for _, place in own], facecolor=own[0][0].fill, hatch=own[0][0].hatch,
            edgecolor=INK, linewidth=0.4,
        )  # fmt: skip
        for bar, place in own:
            foot[place] += bar.length


def _paint_dots(axes: Axes, places: Sequence[tuple[Row, int]], sheet: Sheet) -> None:
    """Paint a dot a number, each name's as far aside in every row; those of one colour are one artist."""
    names = list(dict.fromkeys(name for row, _ in places for name in row.numbers))
    aside = dict(zip(names, scattered(len(names)), strict=True))
    size = 3.4 if len(names) <= 12 else 2.6 if len(names) <= 40 else 1.8
    together: dict[tuple[str, bool], list[tuple[float, float, str]]] = defaultdict(list)
    spans: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for row, place in places:
        for name, value in row.numbers.items():
            y = place + aside[name]
            together[row.look.colour, name in row.hollow].append((value, y, name))
            if name in row.spans:
                spans[row.look.colour].append((value, y, row.spans[name]))
    for colour, own in spans.items():
        x, y, reach = np.array(own).T
        axes.hlines(y, x - reach, x + reach, color=colour, linewidth=0.5)
    for index, ((colour, hollow), found) in enumerate(together.items()):
        x, y = np.array([each[:2] for each in found]).T
        if axes.get_xscale() == "log":  # far below its foot matplotlib leaves dots out
            x = np.maximum(x, axes.get_xlim()[0])
        (dots,) = axes.plot(
            x, y, "o", color=colour, markersize=size, clip_on=False, zorder=2.2, gid=f"dots{index}",
            alpha=1.0 if hollow else 0.6, markerfacecolor=PAPER if hollow else colour,
            markeredgewidth=0.5 if hollow else 0.0,
        )  # fmt: skip
        if sheet.on_page:
            sheet.tips[str(dots.get_gid())] = [each[2] for each in found] if len(names) <= MOST_NAMED else []


def _paint_marks(axes: Axes, places: Sequence[tuple[Row, int]]) -> None:
    """Paint what is marked among the dots: mean and interval, else median and quartiles; and levels."""
    bars: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    marks: dict[tuple[Look, bool], list[tuple[float, float]]] = defaultdict(list)
    levels: dict[bool, list[tuple[float, float]]] = defaultdict(list)
    for row, place in places:
        values = list(row.numbers.values())
        for level, dotted in row.levels:
            levels[dotted] += [(level, place - 0.4), (level, place + 0.4), (np.nan, np.nan)]
        if row.mean is not None:
            marks[row.look, row.filled].append((row.mean, place))
            if row.interval is not None:
                bars[INK].append((*row.interval, place))
        elif values and row.summary:
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
            marks[row.look, True].append((middle, place))
            if len(values) >= FEWEST_FOR_QUARTILES:
                bars[row.look.colour].append((low, high, place))
    for colour, own in bars.items():
        x = np.array([(low, high, np.nan) for low, high, _ in own]).ravel()
        y = np.repeat([place for _, _, place in own], 3)
        axes.plot(x, y, color=colour, linewidth=1.4, solid_capstyle="butt", zorder=2.4)
    for (look, filled), at in marks.items():
        axes.plot(
            *np.array(at).T, look.marker, color=look.colour, markersize=look.size + 1.0, linestyle="none",
            markerfacecolor=look.colour if filled else PAPER, markeredgewidth=0.6, zorder=2.6,
            markeredgecolor=PAPER if filled else look.colour,
        )  # fmt: skip
    for dotted, ends in levels.items():
        colour, style = (SOFT, (0, (1, 1))) if dotted else (INK, "-")
        axes.plot(*np.array(ends).T, color=colour, linestyle=style, linewidth=0.8)
