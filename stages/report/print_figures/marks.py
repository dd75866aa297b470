"""What figures are drawn with: subjects as dots, axes for errors, and legends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from stages.report.palette import Look
from stages.report.print_figures.style import label

Array = npt.NDArray[np.float64]

_LOG_RATIO = 20.0
_GOLDEN = (5**0.5 - 1) / 2
FEWEST_FOR_QUARTILES = 4
MANY = 40


def dots(axes: Axes, x: Array, y: Array, colour: str, diameter: float = 0.0) -> PathPatch:
    """Round dots at x, y, each (n,), as one outline: a hundred subjects take little room in the file.

    diameter : in the figure's unit; unless given small, and smaller for many.

    The axes' limits do not take them into account: every panel sets its own, and to measure dots takes long.
    """
    size = diameter or (2.4 if len(x) <= MANY else 1.5)
    places = np.repeat(np.column_stack([x, y]), 2, axis=0)
    codes = np.tile([Outline.MOVETO, Outline.LINETO], len(x))
    patch = PathPatch(
        Outline(places, codes), fill=False, edgecolor=colour, linewidth=size, capstyle="round", alpha=0.6
    )
    patch.get_path().should_simplify = False  # a dot is a line of no length
    axes.add_artist(patch)
    patch.set_clip_on(False)
    return patch


def scattered(n: int, width: float) -> Array:
    """Steps aside (n,) within `width`, even and the same every time."""
    return np.asarray(((np.arange(n) * _GOLDEN) % 1.0 - 0.5) * width)


def summary(axes: Axes, x: float, values: Array, look: Look, width: float) -> None:
    """The median as the model's mark and, from FEWEST_FOR_QUARTILES on, the quartiles as a bar."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    if len(values) >= FEWEST_FOR_QUARTILES:
        axes.plot([x, x], [low, high], color=look.colour, linewidth=1.4, solid_capstyle="butt")
    axes.plot(
        [x], [middle], look.marker, color=look.colour, markersize=width, markeredgecolor="white",
        markeredgewidth=0.5, linestyle="none",
    )  # fmt: skip


def error_axis(axes: Axes, values: Iterable[Array]) -> None:
    """The vertical axis from zero, or logarithmic where the largest would flatten a group of the others."""
    groups = [part for part in values if part.size]
    low, high = min(float(part.min()) for part in groups), max(float(part.max()) for part in groups)
    if low > 0 and high > _LOG_RATIO * min(float(np.median(part)) for part in groups):
        logarithmic(axes.yaxis, low / 1.25, high * 1.25)
    else:
        axes.set_ylim(0.0, high * 1.06 or 1.0)
    axes.grid(axis="y")


def logarithmic(axis: Axis, low: float, high: float) -> None:
    """Make an axis logarithmic, with ticks at plain numbers."""
    if isinstance(axis, XAxis):
        axis.axes.set_xscale("log")
        axis.axes.set_xlim(low, high)
    else:
        axis.axes.set_yscale("log")
        axis.axes.set_ylim(low, high)
    steps = (1.0, 2.0, 5.0) if high / low < 60 else (1.0, 3.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(LogLocator(10.0, steps))
    axis.set_minor_locator(NullLocator())
    plain_numbers(axis)
    axis.set_minor_formatter(NullFormatter())


def plain_numbers(axis: Axis) -> None:
    """Ticks as numbers without trailing zeros, with a true minus sign."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(value, 9):g}".replace("-", "−")))


def model_handles(looks: Mapping[str, Look], names: Sequence[str]) -> list[Line2D]:
    """Entries of a legend: a mark a model."""
    return [
        Line2D(
            [], [], color=looks[name].colour, marker=looks[name].marker, linestyle="none", label=label(name)
        )
        for name in names
    ]


def columns_for(n_lines: int) -> int:
    """Pixel columns that each of so many lines may take, so that the file stays small."""
    return max(90, min(420, 5500 // max(1, n_lines)))
