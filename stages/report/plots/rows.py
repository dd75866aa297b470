"""Named rows of dots, with what is marked among them, over one horizontal scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import (
    FixedFormatter,
    FuncFormatter,
    Locator,
    LogLocator,
    MaxNLocator,
    NullLocator,
)

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.palette import INK, PAPER, SOFT, Look
from shukotsu.stages.report.plots.panels import Panel
from shukotsu.stages.report.plots.style import SMALL_PT, width_mm
from shukotsu.stages.report.table_cells import number

Array = npt.NDArray[np.float64]

FEWEST_FOR_QUARTILES = 4
ROW_MM, _MOST_NAME_MM, FOOT_MM, _LINE_MM = 3.6, 42.0, 9.0, 3.4
_SCATTER, _GOLDEN = 0.6, (5**0.5 - 1) / 2
_GROSS, _DECADES, _ROUNDING, _MARGIN = 8.0, 4.0, 1e-6, 0.06
"""How many times the usual number the largest is where an even scale would squeeze the others; powers of ten
on a logarithmic scale; errors of rounding, mm or degrees; share of a scale kept free at either end.
"""


@dataclass(frozen=True)
class Scale:
    """A scale from `low` to `high`; `kind` is linear or log."""

    low: float
    high: float
    kind: str = "linear"


def value_scale(values: npt.ArrayLike) -> Scale:
    """Return a scale for values none below 0: from 0, or logarithmic where the largest dwarfs the usual."""
    sizes = np.asarray(values, float)
    sizes = np.where(sizes < _ROUNDING, 0.0, sizes)[np.isfinite(sizes)]
    highest, usual = float(sizes.max(initial=0.0)), float(np.median(sizes)) if len(sizes) else 0.0
    if highest <= _GROSS * usual or highest <= 0.0:
        return Scale(0.0, highest * (1 + _MARGIN) or 1.0)
    lowest = max(float(sizes[sizes > 0].min()), highest / 10.0**_DECADES)
    return Scale(lowest / 1.1, highest * 1.1, "log")


@dataclass(frozen=True)
class Row:
    """A named row: numbers by subject or hand, and the mean of differences with its interval.

    Without a mean the median and quartiles are marked.
    """

    name: str
    look: Look
    numbers: Mapping[str, float] = field(default_factory=dict)
    mean: float | None = None
    interval: tuple[float, float] | None = None

    def values(self) -> list[float]:
        """Everything of the row that its scale must hold."""
        return [*self.numbers.values(), *([] if self.mean is None else [self.mean]), *(self.interval or ())]


@dataclass(frozen=True)
class Group:
    """Rows under a heading, which may be empty."""

    heading: str
    rows: tuple[Row, ...]


def rows_panel(
    heading: str,
    title: str,
    axis: str,
    scale: Scale,
    groups: Sequence[Group],
    of_all: int = 0,
) -> Panel:
    """Return a panel of named rows.

    of_all : how many numbers a full row has; a row with fewer says how many it has. With 0 no row says its
    mean or median.
    """
    lines = sum(len(group.rows) + bool(group.heading) for group in groups) + bool(of_all)
    draw = partial(draw_rows, axis=axis, scale=scale, groups=groups, of_all=of_all)
    foot_mm = FOOT_MM + _LINE_MM * axis.count("\n")
    return Panel(heading, title, ROW_MM * lines, foot_mm, draw)


def draw_rows(
    axes: Axes,
    axis: str,
    scale: Scale,
    groups: Sequence[Group],
    of_all: int = 0,
) -> None:
    """Draw named rows, the first on top: a dot a number, each name's as far aside in every row."""
    lines: list[tuple[str, Row | None]] = []
    for group in groups:
        lines += [(group.heading, None)] if group.heading else []
        lines += [(word(row.name), row) for row in group.rows]
    row_axes(axes, [name for name, _ in lines], axis, scale, top=bool(of_all))
    for label, (_, row) in zip(axes.get_yticklabels(), lines, strict=True):
        label.set_fontweight("bold" if row is None else "normal")
    rows = [(row, y) for y, (_, row) in enumerate(lines) if row is not None]
    if scale.low < 0 < scale.high:
        axes.axvline(0.0, color=SOFT, linewidth=0.6, zorder=1)
    names = list(dict.fromkeys(name for row, _ in rows for name in row.numbers))
    aside_of = dict(zip(names, scattered(len(names)), strict=True))
    size = 3.4 if len(names) <= 12 else 2.6 if len(names) <= 40 else 1.8
    for row, y in rows:
        values = np.array(list(row.numbers.values()))
        middle, bar, colour = row.mean, row.interval, INK
        if middle is None and len(values):
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
            bar, colour = ((low, high) if len(values) >= FEWEST_FOR_QUARTILES else None), row.look.colour
        if len(values):  # far below the foot of a logarithmic scale matplotlib leaves dots out
            x = np.maximum(values, scale.low) if scale.kind == "log" else values
            axes.plot(
                x, [y + aside_of[name] for name in row.numbers], "o", color=row.look.colour, markersize=size,
                alpha=0.6, markeredgewidth=0.0, clip_on=False, zorder=2.2, gid=f"dots{y}",
                label="\n".join(row.numbers),
            )  # fmt: skip
        if middle is None:
            continue
        if bar is not None:
            axes.plot(bar, [y, y], color=colour, linewidth=1.4, solid_capstyle="butt", zorder=2.4)
        axes.plot(
            middle, y, row.look.marker, color=row.look.colour, markersize=row.look.size + 1.0, zorder=2.6,
            markeredgewidth=0.6, markeredgecolor=PAPER,
        )  # fmt: skip
        if of_all:
            note = number(middle).replace("-", "−")
            note += f" (n = {len(values)})" if 0 < len(values) < of_all else ""
            _write_aside(axes, y, note, INK)
    if of_all:
        _write_aside(axes, -1, tr("mean") if any(r.mean is not None for r, _ in rows) else tr("median"), SOFT)


def _write_aside(axes: Axes, y: int, words: str, colour: str) -> None:
    """Write right of the axes, in line with a row."""
    axes.text(
        1.03,
        y,
        words,
        va="center_baseline",
        fontsize=SMALL_PT,
        color=colour,
        transform=axes.get_yaxis_transform(),
    )


def row_axes(axes: Axes, names: Sequence[str], axis: str, scale: Scale, *, top: bool = False) -> None:
    """Name rows from the top, with one free above if `top`, over a horizontal axis with a grid."""
    fits = int(_MOST_NAME_MM / width_mm("m"))
    axes.set_ylim(len(names) - 0.5, -1.5 if top else -0.5)
    axes.set_yticks(range(len(names)))
    shortened = [name if len(name) <= fits else name[: fits - 1] + "…" for name in names]
    axes.yaxis.set_major_formatter(FixedFormatter(shortened))
    axes.spines["left"].set_visible(False)
    axes.set_xscale(scale.kind)
    axes.set_xlim(scale.low, scale.high)
    axes.xaxis.set_major_locator(locator(scale))
    axes.xaxis.set_major_formatter(PLAIN)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(axis="x", clip_on=False)
    axes.tick_params(length=0)
    axes.set_xlabel(axis)


def locator(scale: Scale) -> Locator:
    """Return what puts ticks at round numbers of the scale."""
    if scale.kind == "linear":
        return MaxNLocator(6, steps=[1, 2, 5, 10])
    span = scale.high / scale.low
    return LogLocator(
        subs=(1.0, 2.0, 5.0) if span < 100 else (1.0, 3.0) if span < 2000 else (1.0,), numticks=9
    )


PLAIN = FuncFormatter(lambda value, _: f"{round(value, 9) + 0.0:g}".replace("-", "−"))
"""A number without trailing zeros, with a true minus sign."""


def scattered(n: int) -> Array:
    """Return steps aside (n,) within a row, even about its middle and the same every time."""
    steps = (np.arange(n) * _GOLDEN) % 1.0
    return np.asarray((steps - steps.mean()) * _SCATTER) if n else np.zeros(0)
