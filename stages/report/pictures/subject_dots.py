"""Two pictures a digit: every subject's number under each model, and its difference from the baseline's.

Rows are models. The panels of one picture share their scale, chosen so that a gross failure flattens no other
number. With few subjects the dots of one are one element with the subject's name, so that a pointer shows who
it is and where it lies under the other models; with many the dots of a row are one element, to keep the page
small: the table names the subjects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import AsinhLocator, MaxNLocator

from stages.report.palette import INK, SOFT
from stages.report.pictures.marks import dots, logarithmic, plain_numbers
from stages.report.pictures.page_picture import inline_svg, marked, page_figure, page_style
from stages.report.table_cells import number

Array = npt.NDArray[np.float64]

MOST_NAMED = 30
"""The most subjects that are named in the pictures."""
FEWEST_FOR_QUARTILES = 5

_WIDTH, _TOP, _FOOT, _RIGHT = 400.0, 20.0, 36.0, 46.0
_LETTER, _LEFT_LEAST, _LEFT_MOST = 5.9, 46.0, 132.0
_ROW_LEAST, _ROW_MOST, _ROW_PAD = 22.0, 60.0, 7.0
_GROSS = 8.0
"""The largest number being so many times the usual one, an even scale would squeeze all others together."""
_DECADES = 4.0
"""The most powers of ten that a logarithmic axis spans; what is smaller stands at its foot."""
_MARGIN = 0.06
"""The share of an axis of differences that is kept free at either end."""


@dataclass(frozen=True)
class Scale:
    """A horizontal scale from `low` to `high`; `kind` is linear, log or asinh (even within +-`even`)."""

    low: float
    high: float
    kind: str
    even: float = 1.0

    def below(self, values: Array) -> int:
        """How many values are below a logarithmic axis."""
        return int((np.asarray(values) < self.low).sum()) if self.kind == "log" else 0

    def set_on(self, axes: Axes) -> None:
        """Give the axes this scale, with its ticks."""
        if self.kind == "log":
            logarithmic(axes.xaxis, self.low, self.high)
            return
        if self.kind == "asinh":
            axes.set_xscale("asinh", linear_width=self.even)
            ticks = AsinhLocator(self.even, numticks=5).tick_values(self.low, self.high)
            axes.set_xticks([tick for tick in ticks if tick == 0.0 or abs(tick) >= self.even / 2])
        else:
            axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axes.set_xlim(self.low, self.high)
        plain_numbers(axes.xaxis)


def value_scale(values: Array) -> Scale:
    """A scale for errors (n,), none below 0: from 0, or logarithmic where the largest dwarfs the usual."""
    highest, usual = float(values.max(initial=0.0)), float(np.median(values)) if len(values) else 0.0
    if highest <= 0.0:
        return Scale(0.0, 1.0, "linear")
    if highest <= _GROSS * usual:
        return Scale(0.0, highest * 1.04, "linear")
    lowest = max(float(values[values > 0].min()), highest / 10.0**_DECADES)
    return Scale(lowest / 1.1, highest * 1.1, "log")


def difference_scale(values: Array) -> Scale:
    """A scale for differences (n,) with 0 on it: even, or even about 0 and squeezed outward."""
    sizes = np.abs(values)
    largest = float(sizes.max(initial=0.0))
    if largest <= 0.0:
        return Scale(-1.0, 1.0, "linear")
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    usual = float(np.median(sizes[sizes > largest * 1e-6]))
    if largest <= _GROSS * usual:
        pad = _MARGIN * (high - low)
        return Scale(low - pad, high + pad, "linear")
    even = max(usual, largest / 10.0**_DECADES)
    ends = np.arcsinh(np.array([low, high]) / even)
    pad = _MARGIN * float(ends[1] - ends[0])
    low, high = (even * math.sinh(float(end)) for end in (ends[0] - pad, ends[1] + pad))
    return Scale(low, high, "asinh", even)


@dataclass(frozen=True)
class Strip:
    """One model's row: the subjects' numbers by name, and what is marked among them.

    mean, interval : of differences; without a mean the quartiles are marked. reference : drawn in grey.
    """

    model: str
    numbers: Mapping[str, float]
    mean: float | None = None
    interval: tuple[float, float] | None = None
    baseline: bool = False
    reference: bool = False


@dataclass(frozen=True)
class Panel:
    """One digit: its name, the text alternative of its picture, the colour of its dots and its rows."""

    name: str
    title: str
    colour: str
    strips: Sequence[Strip]


@dataclass(frozen=True)
class Drawn:
    """The panels' pictures, in their order, and how many of their dots lie on others."""

    pictures: tuple[Markup, ...]
    overlapping: int


@dataclass(frozen=True)
class _Rows:
    """What the panels share: the scale, its unit, the plot's left edge and every row's top and height, px."""

    scale: Scale
    unit: str
    n_subjects: int
    diameter: float
    left: float
    tops: Mapping[str, float]
    heights: Mapping[str, float]

    @property
    def foot(self) -> float:
        return sum(self.heights.values())

    def axes(self) -> Axes:
        """New axes in a figure of their own; y is in px from the top of the first row."""
        height = _TOP + self.foot + _FOOT
        box = (self.left, _FOOT, _WIDTH - _RIGHT - self.left, self.foot)
        axes = page_figure(_WIDTH, height).add_axes(tuple(np.array(box) / (_WIDTH, height, _WIDTH, height)))
        axes.set_ylim(self.foot, 0.0)
        self.scale.set_on(axes)
        return axes


def draw_panels(panels: Sequence[Panel], scale: Scale, unit: str, n_subjects: int) -> Drawn:
    """Draw panels of one scale, a row for each model that any of them has, alike in all."""
    models = list(dict.fromkeys(strip.model for panel in panels for strip in panel.strips))
    left = min(max(_LETTER * max(map(len, models)) + 8, _LEFT_LEAST), _LEFT_MOST)
    diameter = 6.0 if n_subjects <= 12 else 4.0 if n_subjects <= 40 else 2.8
    rows = _Rows(scale, unit, n_subjects, diameter, left, {}, dict.fromkeys(models, _ROW_LEAST))
    with page_style():
        axes = rows.axes()
        swarms = [[_swarm(axes, strip, diameter) for strip in panel.strips] for panel in panels]
    heights = dict(rows.heights)
    for panel, own in zip(panels, swarms, strict=True):
        for strip, (offsets, _) in zip(panel.strips, own, strict=True):
            wide = 2 * float(np.abs(offsets).max(initial=0.0)) + diameter + _ROW_PAD
            heights[strip.model] = max(heights[strip.model], wide)
    ends = np.cumsum([0.0, *heights.values()])
    rows = _Rows(scale, unit, n_subjects, diameter, left, dict(zip(models, ends, strict=False)), heights)
    pictures = tuple(
        _picture(panel, [offsets for offsets, _ in own], rows)
        for panel, own in zip(panels, swarms, strict=True)
    )
    return Drawn(pictures, sum(overlapping for own in swarms for _, overlapping in own))


def spread(x: Array, diameter: float, most_lanes: int) -> tuple[Array, int]:
    """How far dots at x (n,) (pixels) are moved across the row so that none overlaps.

    Gives the offsets (n,) from the middle, in pixels, and how many dots overlap others because all of
    `most_lanes` lanes were taken. The same x give the same offsets.
    """
    ends = [-math.inf] * most_lanes
    lanes = np.zeros(len(x), int)
    overlapping = 0
    for index in np.argsort(x, kind="stable").tolist():
        here = float(x[index])
        lane = next((lane for lane, end in enumerate(ends) if here - end >= diameter), -1)
        if lane < 0:
            overlapping += 1
            lane = ends.index(min(ends))
        ends[lane] = here
        lanes[index] = lane
    steps = (lanes + 1) // 2 * np.where(lanes % 2, -1, 1)  # 0, -1, 1, -2, 2, ...: from the middle outward
    middle = (steps.max(initial=0) + steps.min(initial=0)) / 2
    return (steps - middle) * diameter, overlapping


def _swarm(axes: Axes, strip: Strip, diameter: float) -> tuple[Array, int]:
    x = _on_axis(axes, list(strip.numbers.values()))
    pixels = axes.transData.transform(np.column_stack([x, np.zeros(len(x))]))[:, 0]
    return spread(pixels, diameter, int((_ROW_MOST - _ROW_PAD) / diameter) // 2 * 2 + 1)


def _on_axis(axes: Axes, values: Sequence[float]) -> Array:
    """Values (n,), those off the axis at its end."""
    return np.asarray(np.clip(np.array(values, float), *axes.get_xlim()))


def _picture(panel: Panel, offsets: Sequence[Array], rows: _Rows) -> Markup:
    with page_style():
        axes = rows.axes()
        axes.spines[:].set_visible(False)
        axes.set_yticks([])
        axes.grid(axis="x", clip_on=False)
        axes.set_xlabel(rows.unit, color=SOFT)
        _zero(axes)
        _dots(axes, panel, offsets, rows)
        for strip in panel.strips:
            _label(axes, strip, rows)
            _marks(axes, strip, rows)
        heading = "mean" if any(strip.mean is not None for strip in panel.strips) else "median"
        axes.annotate(heading, (1, 1), (_RIGHT, 5), "axes fraction", "offset pixels", color=SOFT, ha="right")
        return inline_svg(axes.figure, panel.title)


def _zero(axes: Axes) -> None:
    """The zero of differences, and which side is the better one."""
    low, high = axes.get_xlim()
    if not low < 0 < high:
        return
    axes.axvline(0.0, color=SOFT, linewidth=1.0, zorder=0.6, clip_on=False)
    share = float(axes.transAxes.inverted().transform(axes.transData.transform((0.0, 0.0)))[0])
    for text, fits, shift, align in (
        ("better ←", share > 0.25, -5, "right"),
        ("→ worse", share < 0.75, 5, "left"),
    ):
        if fits:
            axes.annotate(
                text, (0, 1), (shift, 5), ("data", "axes fraction"), "offset pixels", color=SOFT, ha=align
            )


def _label(axes: Axes, strip: Strip, rows: _Rows) -> None:
    """The model's name, how many subjects it has where not all, and its mean or median."""
    most = int((rows.left - 8) / _LETTER)
    name = strip.model if len(strip.model) <= most else strip.model[: most - 1] + "…"
    middle = rows.tops[strip.model] + rows.heights[strip.model] / 2
    missing = len(strip.numbers) < rows.n_subjects
    beside = axes.get_yaxis_transform()
    text = axes.annotate(
        name, (0, middle - (5 if missing else 0)), (-rows.left, 0), beside, "offset pixels", va="center",
        fontweight="bold" if strip.baseline else "normal", color=SOFT if strip.reference else INK,
    )  # fmt: skip
    marked(text, "model", strip.model)
    if missing:
        count = f"{len(strip.numbers)} of {rows.n_subjects}"
        axes.annotate(
            count, (0, middle + 7), (-rows.left, 0), beside, "offset pixels", va="center", color=SOFT
        )
    values = list(strip.numbers.values())
    shown = strip.mean if strip.mean is not None else float(np.median(values)) if values else None
    axes.annotate(
        number(shown).replace("-", "−"),
        (1, middle),
        (_RIGHT, 0),
        beside,
        "offset pixels",
        ha="right",
        va="center",
    )


def _dots(axes: Axes, panel: Panel, offsets: Sequence[Array], rows: _Rows) -> None:
    """The dots, those of a subject in all rows together where subjects are named."""
    groups: dict[tuple[str, bool], list[tuple[float, float]]] = {}
    for strip, aside in zip(panel.strips, offsets, strict=True):
        middle = rows.tops[strip.model] + rows.heights[strip.model] / 2
        x = _on_axis(axes, list(strip.numbers.values()))
        for name, place, step in zip(strip.numbers, x, aside, strict=True):
            owner = name if rows.n_subjects <= MOST_NAMED else ""
            groups.setdefault((owner, strip.reference), []).append((float(place), middle + float(step)))
    for (name, reference), places in groups.items():
        x, y = np.array(sorted(places)).T
        patch = dots(axes, x, y, SOFT if reference else panel.colour, rows.diameter)
        marked(patch, "dots", name)


def _marks(axes: Axes, strip: Strip, rows: _Rows) -> None:
    """Mean and interval of differences; else median and quartiles, where there are enough subjects."""
    height = rows.heights[strip.model]
    y, reach = rows.tops[strip.model] + height / 2, min(height / 2 - 3, 9.0)
    values = np.array(list(strip.numbers.values()))
    if strip.mean is not None:
        middle, ends = strip.mean, strip.interval
        if ends is not None:
            axes.plot(ends, (y, y), color=INK, linewidth=1.5)
            axes.vlines(ends, y - 4, y + 4, color=INK, linewidth=1.5)
    elif len(values) >= FEWEST_FOR_QUARTILES:
        low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
        box = ((low, high, high, low, low), np.array((-1, -1, 1, 1, -1)) * (reach - 2) + y)
        axes.plot(*box, color=INK, linewidth=1.0)
    else:
        return
    axes.plot((middle, middle), (y - reach, y + reach), color=INK, linewidth=2.5)
