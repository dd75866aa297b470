"""Pictures with a row a joint: ranges of its angles, and the singular values of its centre's system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from stages.report.palette import AMBER, HUES, INK, PAPER, SOFT, WEAK_LINE
from stages.report.pictures.marks import logarithmic, plain_numbers
from stages.report.pictures.page_picture import inline_svg, page_figure, page_style

_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM, _ROW = 400.0, 88.0, 14.0, 6.0, 36.0, 17.0
_LEAST_SPAN_DEG = 20.0
_LEAST_SINGULAR_VALUE, _LARGEST_SINGULAR_VALUE = 1e-4, 2.0
"""Below the least a singular value is the solver's own rounding, far below what any receiver resolves."""
_BLUE = HUES["blue"][0]

Range = tuple[float, float, float, float, float]
"""Of an angle, degrees: the least, 5th percentile, median, 95th percentile and greatest."""


def range_picture(title: str, joints: Sequence[str], ranges: dict[str, Range]) -> Markup:
    """One angle's range by joint, least to most and 5th to 95th percentile, with the median.

    `title` is the text alternative.
    """
    with page_style():
        axes = _row_axes(joints, "deg")
        rows = [joints.index(joint) for joint in ranges]
        if ranges:
            least, first, median, last, most = np.array(list(ranges.values())).T
            axes.hlines(rows, least, most, color=SOFT, linewidth=1.2)
            axes.hlines(rows, first, last, color=_BLUE, linewidth=7)
            axes.vlines(median, np.array(rows) - 0.35, np.array(rows) + 0.35, color=INK, linewidth=2)
        low = min((own[0] for own in ranges.values()), default=0.0)
        high = max((own[-1] for own in ranges.values()), default=0.0)
        pad = max(0.0, _LEAST_SPAN_DEG - (high - low)) / 2 + 0.02 * (high - low)
        axes.set_xlim(low - pad, high + pad)
        axes.axvline(0.0, color=SOFT, linewidth=1.0, zorder=0.5)
        plain_numbers(axes.xaxis)
        return inline_svg(axes.figure, title)


def singular_value_picture(title: str, joints: Sequence[str], values: Sequence[Sequence[float]]) -> Markup:
    """Each joint's six singular values, largest first, on a logarithmic scale; the sixth is a diamond."""
    with page_style():
        axes = _row_axes(joints, "singular value")
        known = np.maximum(np.array(values, float).reshape(len(joints), 6), _LEAST_SINGULAR_VALUE)
        rows = np.arange(len(joints))
        for place in range(6):
            marker, face, edge = "o", "none", SOFT
            if place == 5:
                marker, face, edge = "D", AMBER, WEAK_LINE
            elif place > 2:
                face, edge = _BLUE, PAPER
            axes.plot(
                known[:, place], rows, marker, markersize=7, markerfacecolor=face, markeredgecolor=edge,
                clip_on=False,
            )  # fmt: skip
        low = 10.0 ** np.floor(np.log10(known.min(initial=0.1)))
        logarithmic(axes.xaxis, float(low), _LARGEST_SINGULAR_VALUE)
        return inline_svg(axes.figure, title)


def _row_axes(joints: Sequence[str], unit: str) -> Axes:
    """Axes with a row a joint, the first on top."""
    height = _TOP + _ROW * len(joints) + _BOTTOM
    figure = page_figure(_WIDTH, height)
    box = (_LEFT, _BOTTOM, _WIDTH - _LEFT - _RIGHT, _ROW * len(joints))
    axes = figure.add_axes(tuple(np.array(box) / (_WIDTH, height, _WIDTH, height)))
    axes.set_ylim(len(joints) - 0.5, -0.5)
    axes.set_yticks(range(len(joints)), list(joints))
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", clip_on=False)
    axes.set_xlabel(unit, color=SOFT)
    return axes
