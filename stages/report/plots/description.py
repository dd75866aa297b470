"""Describe a plot: what is drawn, in data units. `figures.py` draws it for page and print."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shukotsu.stages.report.hand_motion import Chain
from shukotsu.stages.report.palette import INK, Look, Mark
from shukotsu.stages.report.plots.hand_views import Window

Array = npt.NDArray[np.float64]

_GROSS = 8.0
"""The largest number being so many times the usual one, an even scale would squeeze all others together."""
_DECADES = 4.0
"""The most powers of ten that a logarithmic scale spans; what is smaller stands at its foot."""
_ROUNDING = 1e-6
"""What is smaller, in mm or degrees, is an error of rounding: it is shown as 0, and stretches no scale."""
_MARGIN = 0.06
"""The share of a scale that is kept free at either end."""


@dataclass(frozen=True)
class Scale:
    """A scale from `low` to `high`; `kind` is linear, log or asinh (even within +-`even`)."""

    low: float
    high: float
    kind: str = "linear"
    even: float = 1.0


def value_scale(values: npt.ArrayLike) -> Scale:
    """Give a scale for values none below 0: from 0, or logarithmic where the largest dwarfs the usual."""
    own = np.asarray(values, float)
    own = np.where(own < _ROUNDING, 0.0, own)[np.isfinite(own)]
    highest, usual = float(own.max(initial=0.0)), float(np.median(own)) if len(own) else 0.0
    if highest <= _GROSS * usual or highest <= 0.0:
        return Scale(0.0, highest * (1 + _MARGIN) or 1.0)
    lowest = max(float(own[own > 0].min()), highest / 10.0**_DECADES)
    return Scale(lowest / 1.1, highest * 1.1, "log")


def difference_scale(values: npt.ArrayLike) -> Scale:
    """Give a scale for differences with 0 on it: even, or even about 0 and squeezed outward."""
    own = np.asarray(values, float)
    sizes = np.abs(own)
    largest = float(sizes.max(initial=0.0))
    if largest <= _ROUNDING:
        return Scale(-1.0, 1.0)
    usual = float(np.median(sizes[sizes > largest * 1e-6]))
    gross = largest > _GROSS * usual
    even = max(usual, largest / 10.0**_DECADES)
    ends = np.array([min(float(own.min()), 0.0), max(float(own.max()), 0.0)])
    low, high = np.arcsinh(ends / even) if gross else ends
    pad = _MARGIN * float(high - low)
    if gross:
        return Scale(even * math.sinh(low - pad), even * math.sinh(high + pad), "asinh", even)
    return Scale(float(low) - pad, float(high) + pad)


def even_scale(values: Iterable[npt.ArrayLike]) -> Scale:
    """Give an even scale that holds all finite values."""
    known = np.concatenate([np.zeros(0), *(np.ravel(np.asarray(own, float)) for own in values)])
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    pad = _MARGIN * (high - low) if high - low > _ROUNDING else 1.0
    return Scale(low - pad, high + pad)


@dataclass(frozen=True)
class Bar:
    """A stretch of a row's bar, as long as `length`, with its fill and hatching."""

    length: float
    fill: str
    hatch: str = ""


@dataclass(frozen=True)
class Row:
    """A named row of dots, and what is marked among them.

    numbers : by subject or hand. spans : 1-sigma errors of some of them. hollow : whose dots are not filled.
    mean, interval : of differences; without a mean the median and quartiles are marked. filled : whether the
    mean's mark is. levels : values at which the row is crossed, each with whether dotted. bars : from 0 on.
    """

    name: str
    look: Look
    numbers: Mapping[str, float] = field(default_factory=dict)
    spans: Mapping[str, float] = field(default_factory=dict)
    hollow: frozenset[str] = frozenset()
    mean: float | None = None
    interval: tuple[float, float] | None = None
    filled: bool = True
    summary: bool = True
    levels: tuple[tuple[float, bool], ...] = ()
    bars: tuple[Bar, ...] = ()

    def values(self) -> list[float]:
        """Everything of the row that its scale must hold."""
        mean = [] if self.mean is None else [self.mean]
        return [*self.numbers.values(), *mean, *(self.interval or ())]


@dataclass(frozen=True)
class Group:
    """Rows under a heading, which may be empty."""

    heading: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class RowsPanel:
    """Named rows over one horizontal scale.

    heading : of the panel. title : what it shows, for who cannot see it. sides : what a difference's two
    sides say. of_all : how many numbers a full row has; a row with fewer says how many it has.
    """

    heading: str
    title: str
    axis: str
    scale: Scale
    groups: tuple[Group, ...]
    sides: tuple[str, str] = ("", "")
    of_all: int = 0

    @property
    def rows(self) -> list[Row]:
        """The rows of all groups."""
        return [row for group in self.groups for row in group.rows]


@dataclass(frozen=True)
class Line:
    """A line through x and y, broken at NaN; `marker` stands on some of its points, from `phase` on."""

    x: Array
    y: Array
    colour: str = INK
    style: str = "-"
    width: float = 1.2
    marker: str = ""
    phase: float = 0.0


@dataclass(frozen=True)
class Band:
    """A shade between low and high over x."""

    x: Array
    low: Array
    high: Array
    colour: str
    opacity: float = 1.0


@dataclass(frozen=True)
class CurvesPanel:
    """Numbers over time.

    levels : heights of horizontal lines. marked : stretches
    stretches of x, from and to, drawn along the foot. words : what is said where nothing is drawn. An empty
    x_label leaves the axis without numbers, for the panel below has them.
    """

    heading: str
    title: str
    x_label: str
    y_label: str
    x_scale: Scale
    y_scale: Scale
    height_mm: float
    lines: tuple[Line, ...] = ()
    bands: tuple[Band, ...] = ()
    levels: tuple[float, ...] = ()
    marked: tuple[tuple[float, float], ...] = ()
    words: str = ""


@dataclass(frozen=True)
class JointLink:
    """A joint of an index: one of BELIEFS, where its mark leads to, and what is said of it."""

    believed: str
    href: str
    words: str


@dataclass(frozen=True)
class HandPanel:
    """A posed hand, seen from its back and, unless it is an index, from its thumb's side.

    mm_per_mm : millimetres of the picture to one of the hand; None: as many as there is room for. links : of
    an index, what each joint leads to; its bones have one colour.
    """

    heading: str
    title: str
    hand: str
    chains: tuple[Chain, ...]
    receivers_mm: Array
    window: Window
    mm_per_mm: float | None = None
    links: Mapping[str, JointLink] | None = None


Panel = RowsPanel | CurvesPanel | HandPanel


@dataclass(frozen=True)
class Key:
    """An entry of a legend: a mark, a line or a fill, and what it stands for."""

    words: str
    mark: Mark | None = None
    line: tuple[str, str] | None = None
    bar: Bar | None = None


@dataclass(frozen=True)
class Plot:
    """Panels in rows, and a legend; lettered says whether the panels of print have letters."""

    rows: tuple[tuple[Panel, ...], ...]
    width_mm: float
    legend: tuple[Key, ...] = ()
    lettered: bool = True

    @property
    def panels(self) -> list[Panel]:
        """All panels, row by row."""
        return [panel for row in self.rows for panel in row]


def in_rows(panels: Sequence[Panel], across: int) -> tuple[tuple[Panel, ...], ...]:
    """So many panels side by side."""
    return tuple(tuple(panels[start : start + across]) for start in range(0, len(panels), across))
