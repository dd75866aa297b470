"""Two pictures a digit: every subject's number under each model, and its difference from the baseline's.

Rows are models. The panels of one picture share their scale. With few subjects the dots of one are one
element with the subject's name, so that a pointer shows who it is and where it lies under the other models;
with many the dots of a row are one element, to keep the page small: the table names the subjects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.data_table import number
from stages.report.models_compared.axis import Axis
from stages.report.models_compared.swarm import dots, swarm
from stages.report.svg import element, image

Array = npt.NDArray[np.float64]

WIDTH = 400
MOST_NAMED = 30
"""The most subjects that are named in the pictures."""
FEWEST_FOR_QUARTILES = 5
_TOP, _FOOT, _RIGHT = 18, 34, 46
_LETTER, _LEFT_LEAST, _LEFT_MOST = 5.9, 46.0, 132.0
_ROW_LEAST, _ROW_MOST, _ROW_PAD = 22.0, 60.0, 7.0
_TICK_ROOM, _WORD_ROOM, _HEADING_ROOM = 34.0, 52.0, 30.0


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
    """One digit: its name, the text alternative of its picture, the class of its dots and its rows."""

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
class _Frame:
    """What the panels of one picture share; `left` and `foot` are the plot's edges in pixels."""

    axis: Axis
    left: float
    foot: float
    unit: str
    n_subjects: int
    diameter: float

    def pixels(self, values: Sequence[float] | Array) -> Array:
        """Values (n,) to pixels from the left edge of the picture."""
        return _pixels(np.asarray(values, float), self.axis, self.left)


@dataclass(frozen=True)
class _Swarm:
    """One strip's dots, in pixels: x by the axis, y from the middle of the row."""

    strip: Strip
    x: Array
    y: Array
    n_lanes: int
    overlapping: int


@dataclass(frozen=True)
class _Row:
    """A swarm in its place; y is now from the top of the picture."""

    strip: Strip
    x: Array
    y: Array
    height: float
    middle: float

    @classmethod
    def of(cls, swarm: _Swarm, top: float, height: float) -> _Row:
        """Put a swarm in the middle of a row."""
        middle = top + height / 2
        return cls(swarm.strip, swarm.x, middle + swarm.y, height, middle)


def draw(panels: Sequence[Panel], axis: Axis, unit: str, n_subjects: int) -> Drawn:
    """Draw panels of one scale, a row for each model that any of them has, alike in all."""
    models = list(dict.fromkeys(strip.model for panel in panels for strip in panel.strips))
    left = min(max(_LETTER * max(map(len, models)) + 8, _LEFT_LEAST), _LEFT_MOST)
    diameter = 6.0 if n_subjects <= 12 else 4.0 if n_subjects <= 40 else 2.8
    swarms = [_swarms(panel, axis, left, diameter) for panel in panels]
    heights = dict.fromkeys(models, _ROW_LEAST)
    for one in chain.from_iterable(swarms):
        heights[one.strip.model] = max(heights[one.strip.model], one.n_lanes * diameter + _ROW_PAD)
    tops = dict(zip(models, accumulate(heights.values(), initial=_TOP), strict=False))
    frame = _Frame(axis, left, _TOP + sum(heights.values()), unit, n_subjects, diameter)
    rows = [
        [_Row.of(one, tops[one.strip.model], heights[one.strip.model]) for one in every] for every in swarms
    ]
    pictures = tuple(_picture(panel, own, frame) for panel, own in zip(panels, rows, strict=True))
    return Drawn(pictures, sum(one.overlapping for every in swarms for one in every))


def _picture(panel: Panel, rows: Sequence[_Row], frame: _Frame) -> Markup:
    parts = [
        *_grid(frame),
        *(part for row in rows for part in _labels(row, frame)),
        element(
            "g", *_dots(rows, panel.colour, frame.n_subjects), class_="dots", stroke_width=frame.diameter
        ),
        *(part for row in rows for part in _marks(row, frame)),
    ]
    heading = "mean" if any(row.strip.mean is not None for row in rows) else "median"
    parts.append(element("text", heading, x=WIDTH, y=11, class_="tick end"))
    return image(WIDTH, frame.foot + _FOOT, panel.title, *parts)


def _pixels(values: Array, axis: Axis, left: float) -> Array:
    return left + axis.place(values) * (WIDTH - _RIGHT - left)


def _swarms(panel: Panel, axis: Axis, left: float, diameter: float) -> list[_Swarm]:
    most = int((_ROW_MOST - _ROW_PAD) / diameter) // 2 * 2 + 1
    found = []
    for strip in panel.strips:
        x = _pixels(np.array(list(strip.numbers.values())), axis, left)
        found.append(_Swarm(strip, x, *swarm(x, diameter, most)))
    return found


def _grid(frame: _Frame) -> list[Markup]:
    """Tick lines with their numbers, the zero of differences, and the unit."""
    axis, foot, wide = frame.axis, frame.foot, WIDTH - _RIGHT - frame.left
    ticks = axis.ticks(_TICK_ROOM / wide)
    places = frame.pixels(ticks)
    lines = "".join(f"M{x:.1f} {_TOP}V{foot:.1f}" for x in places)
    parts = [element("path", class_="grid", d=lines)]
    if axis.low < 0 < axis.high:
        (zero,) = frame.pixels([0.0])
        parts.append(element("path", class_="axis zero", d=f"M{zero:.1f} {_TOP - 4}V{foot:.1f}"))
        if zero > _WORD_ROOM:
            parts.append(element("text", "better ←", x=zero - 5, y=11, class_="tick end"))
        if zero < WIDTH - _WORD_ROOM - _HEADING_ROOM:
            parts.append(element("text", "→ worse", x=zero + 5, y=11, class_="tick"))
    for tick, x in zip(ticks, places, strict=True):
        parts.append(element("text", f"{tick:.6g}".replace("-", "−"), x=x, y=foot + 13, class_="tick middle"))
    parts.append(element("text", frame.unit, x=frame.left + wide / 2, y=foot + 28, class_="tick middle"))
    return parts


def _labels(row: _Row, frame: _Frame) -> list[Markup]:
    """The model's name, how many subjects it has where not all, and its mean or median."""
    strip, y = row.strip, row.middle
    most = int((frame.left - 8) / _LETTER)
    name = strip.model if len(strip.model) <= most else strip.model[: most - 1] + "…"
    missing = len(strip.numbers) < frame.n_subjects
    kind = "baseline" if strip.baseline else "tick" if strip.reference else "model"
    whole = element("title", strip.model)
    parts = [element("text", name, whole, x=0, y=y + (0 if missing else 4), class_=kind)]
    if missing:
        count = f"{len(strip.numbers)} of {frame.n_subjects}"
        parts.append(element("text", count, x=0, y=y + 11, class_="tick"))
    values = list(strip.numbers.values())
    shown = strip.mean if strip.mean is not None else float(np.median(values)) if values else None
    parts.append(element("text", number(shown).replace("-", "−"), x=WIDTH, y=y + 4, class_="end"))
    return parts


def _dots(rows: Sequence[_Row], colour: str, n_subjects: int) -> list[Markup]:
    if n_subjects > MOST_NAMED:
        return [
            element("path", class_=_class_of(row.strip, colour), d=dots(row.x, row.y))
            for row in rows
            if len(row.x)
        ]
    of_subject: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in rows:
        for name, x, y in zip(row.strip.numbers, row.x, row.y, strict=True):
            of_subject.setdefault((name, _class_of(row.strip, colour)), []).append((x, y))
    return [
        element("path", element("title", name), class_=kind, d=dots(*np.array(places).T))
        for (name, kind), places in of_subject.items()
    ]


def _class_of(strip: Strip, colour: str) -> str:
    return "reference" if strip.reference else colour


def _marks(row: _Row, frame: _Frame) -> list[Markup]:
    """Mean and interval of differences; else median and quartiles, where there are enough subjects."""
    strip, reach = row.strip, min(row.height / 2 - 3, 9.0)
    values = np.array(list(strip.numbers.values()))
    if strip.mean is not None:
        marks = [strip.mean, *(strip.interval or ())]
    elif len(values) >= FEWEST_FOR_QUARTILES:
        marks = np.quantile(values, [0.5, 0.25, 0.75]).tolist()
    else:
        return []
    middle, *ends = frame.pixels(marks).tolist()
    y, parts = row.middle, []
    if ends and strip.mean is None:
        box = f"M{ends[0]:.1f} {y - reach + 2:.1f}H{ends[1]:.1f}v{2 * reach - 4:.1f}H{ends[0]:.1f}z"
        parts.append(element("path", class_="box", d=box))
    elif ends:
        bar = "".join(f"M{end:.1f} {y - 4:.1f}v8" for end in ends) + f"M{ends[0]:.1f} {y:.1f}H{ends[1]:.1f}"
        parts.append(element("path", class_="bar", d=bar))
    return [*parts, element("path", class_="mark", d=f"M{middle:.1f} {y - reach:.1f}v{2 * reach:.1f}")]
