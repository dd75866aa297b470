"""Two pictures a digit: every subject's number under each model, and its difference from the baseline's.

Rows are models. The panels of one picture share their scale, chosen so that a gross failure flattens no other
number. With few subjects the dots of one are one element with the subject's name, so that a pointer shows who
it is and where it lies under the other models; with many the dots of a row are one element, to keep the page
small: the table names the subjects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.palette import INK, MARK_PX, SOFT, Look
from stages.report.pictures.picture import Picture
from stages.report.pictures.scale import Scale
from stages.report.pictures.word_places import width_in_letters
from stages.report.table_cells import number
from stages.report.wording import mark, say, word

Array = npt.NDArray[np.float64]

MOST_NAMED = 30
"""The most subjects that are named in the pictures."""
FEWEST_FOR_QUARTILES = 5

_WIDTH, _TOP, _FOOT, _RIGHT = 400.0, 20.0, 36.0, 46.0
_LETTER, _LEFT_LEAST, _LEFT_MOST, _MARK_ROOM = 5.9, 46.0, 144.0, 12.0
_ROW_LEAST, _ROW_MOST, _ROW_PAD = 24.0, 84.0, 7.0
SIDES = (mark("better ←"), mark("→ worse"))
_GROSS = 8.0
"""The largest number being so many times the usual one, an even scale would squeeze all others together."""
_DECADES = 4.0
"""The most powers of ten that a logarithmic axis spans; what is smaller stands at its foot."""
_MARGIN = 0.06
"""The share of an axis of differences that is kept free at either end."""


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
    look: Look
    numbers: Mapping[str, float]
    mean: float | None = None
    interval: tuple[float, float] | None = None
    baseline: bool = False
    reference: bool = False


@dataclass(frozen=True)
class Panel:
    """One digit: its name, the text alternative of its picture, and its rows."""

    name: str
    title: str
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
    sides: tuple[str, str]

    @property
    def foot(self) -> float:
        return _TOP + sum(self.heights.values())

    def middle(self, model: str) -> float:
        return float(round(self.tops[model] + self.heights[model] / 2))  # whole pixels: fewer characters

    def across(self, values: npt.ArrayLike) -> Array:
        """Pixels of values (n,), those off the scale at its end."""
        share = np.clip(self.scale.share(values), 0.0, 1.0)
        return np.asarray(self.left + share * (_WIDTH - _RIGHT - self.left))


def draw_panels(
    panels: Sequence[Panel], scale: Scale, unit: str, n_subjects: int, sides: tuple[str, str] = SIDES
) -> Drawn:
    """Draw panels of one scale, a row for each model that any of them has, alike in all.

    sides : what is said left and right of a difference's zero.
    """
    models = list(dict.fromkeys(strip.model for panel in panels for strip in panel.strips))
    left = min(
        max(_LETTER * max(width_in_letters(word(model)) for model in models) + 8 + _MARK_ROOM, _LEFT_LEAST),
        _LEFT_MOST,
    )
    diameter = 9.0 if n_subjects <= 12 else 6.0 if n_subjects <= 40 else 4.0
    heights = dict.fromkeys(models, _ROW_LEAST)
    rows = _Rows(scale, unit, n_subjects, diameter, left, {}, heights, sides)
    lanes = int((_ROW_MOST - _ROW_PAD) / diameter) // 2 * 2 + 1
    swarms = [
        [spread(rows.across(list(strip.numbers.values())), diameter, lanes) for strip in panel.strips]
        for panel in panels
    ]
    for panel, own in zip(panels, swarms, strict=True):
        for strip, (offsets, _) in zip(panel.strips, own, strict=True):
            wide = 2 * float(np.abs(offsets).max(initial=0.0)) + diameter + _ROW_PAD
            heights[strip.model] = max(heights[strip.model], wide)
    tops = _TOP + np.cumsum([0.0, *heights.values()])
    rows = replace(rows, tops=dict(zip(models, tops.tolist(), strict=False)))
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


def _picture(panel: Panel, offsets: Sequence[Array], rows: _Rows) -> Markup:
    picture = Picture(panel.title, _WIDTH, rows.foot + _FOOT)
    picture.number_axis(rows.scale, (rows.left, _WIDTH - _RIGHT), _TOP, rows.foot, rows.unit)
    _zero(picture, rows)
    _dots(picture, panel, offsets, rows)
    for strip in panel.strips:
        _label(picture, strip, rows)
        _marks(picture, strip, rows)
    heading = say("mean") if any(strip.mean is not None for strip in panel.strips) else say("median")
    picture.text(_WIDTH, _TOP - 5, heading, "end", SOFT)
    return picture.markup()


def _zero(picture: Picture, rows: _Rows) -> None:
    """The zero of differences, and which side is the better one."""
    if not rows.scale.low < 0 < rows.scale.high:
        return
    zero, share = float(rows.across(0.0)), float(rows.scale.share(0.0))
    picture.line([(zero, _TOP), (zero, rows.foot)], SOFT)
    if share > 0.25:
        picture.text(zero - 5, _TOP - 5, say(rows.sides[0]), "end", SOFT)
    if share < 0.75:
        picture.text(zero + 5, _TOP - 5, say(rows.sides[1]), "start", SOFT)


def _label(picture: Picture, strip: Strip, rows: _Rows) -> None:
    """The model's name, how many subjects it has where not all, and its mean or median."""
    most = round((rows.left - 8 - _MARK_ROOM) / _LETTER)
    own = word(strip.model)
    name = own if width_in_letters(own) <= most else own[: most - 1] + "…"
    middle, missing = rows.middle(strip.model), len(strip.numbers) < rows.n_subjects
    colour = SOFT if strip.reference else INK
    picture.marks(np.array([[4.0, middle]]), strip.look.marker, MARK_PX, strip.look.colour)
    with picture.group("model", "" if name == own else own):
        picture.text(
            _MARK_ROOM,
            middle - (5 if missing else 0),
            name,
            "start",
            colour,
            middle=True,
            bold=strip.baseline,
        )
    if missing:
        picture.text(
            _MARK_ROOM,
            middle + 7,
            say("{n_numbers} of {n_subjects}", n_numbers=len(strip.numbers), n_subjects=rows.n_subjects),
            "start",
            SOFT,
            middle=True,
        )
    values = list(strip.numbers.values())
    shown = strip.mean if strip.mean is not None else float(np.median(values)) if values else None
    picture.text(_WIDTH, middle, number(shown).replace("-", "−"), "end", middle=True)


def _dots(picture: Picture, panel: Panel, offsets: Sequence[Array], rows: _Rows) -> None:
    """The dots, those of a subject in all rows together where subjects are named."""
    groups: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for strip, aside in zip(panel.strips, offsets, strict=True):
        across = rows.across(list(strip.numbers.values()))
        for name, x, step in zip(strip.numbers, across.tolist(), aside.tolist(), strict=True):
            owner = groups.setdefault(name if rows.n_subjects <= MOST_NAMED else "", {})
            owner.setdefault(strip.look.colour, []).append((x, rows.middle(strip.model) + step))
    for name, of_colour in groups.items():
        with picture.group("dots", name):
            for colour, places in of_colour.items():
                x, y = np.array(sorted(places)).T
                picture.dots(x, y, colour, rows.diameter)


def _marks(picture: Picture, strip: Strip, rows: _Rows) -> None:
    """Mean and interval of differences; else median and quartiles, where there are enough subjects."""
    y, reach = rows.middle(strip.model), min(rows.heights[strip.model] / 2 - 3, 9.0)
    values = np.array(list(strip.numbers.values()))
    if strip.mean is not None:
        middle = float(rows.across(strip.mean))
        if strip.interval is not None:
            low, high = rows.across(strip.interval).tolist()
            picture.line([(low, y), (high, y)], INK, 1.5)
            for end in (low, high):
                picture.line([(end, y - 4), (end, y + 4)], INK, 1.5)
    elif len(values) >= FEWEST_FOR_QUARTILES:
        low, middle, high = rows.across(np.quantile(values, [0.25, 0.5, 0.75])).tolist()
        top, foot = y - reach + 2, y + reach - 2
        picture.outline([(low, top), (high, top), (high, foot), (low, foot)], "none", INK)
    else:
        return
    picture.line([(middle, y - reach), (middle, y + reach)], INK, 2.5)
