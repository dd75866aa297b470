"""Paint a posed hand: from its back and its thumb's side, or as an index of its joints."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.transforms import Transform

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.belief import BELIEF_MARKS, BELIEVED
from shukotsu.stages.report.hand_motion import DrawnPoint
from shukotsu.stages.report.palette import AMBER, BONE, INK, PAPER, RULE, SOFT, WEAK_LINE, Mark, digit_looks
from shukotsu.stages.report.plots.description import HandPanel, Panel
from shukotsu.stages.report.plots.hand_views import BAR_MM, GUTTER_MM, View, looks_of_points, views_of
from shukotsu.stages.report.plots.style import SMALL_PT, Margins, Place, Sheet, width_mm

_FOOT_MM, _INDEX_FOOT_MM, _INDEX_MM = 9.0, 12.0, 92.0
_LINE_MM, _USUAL_MM = 3.2, 85.0
"""How high a line of text is; and how wide a picture is whose lines have their usual widths."""

Box = tuple[float, float, float, float]
"""Left, lower, right and upper edge, mm of the picture."""


def margins(panel: HandPanel, _before: Panel | None) -> Margins:
    """Give room for what stands below the views."""
    return Margins(1.5, 1.5, 0.0, _FOOT_MM if panel.links is None else _INDEX_FOOT_MM)


def height_mm(panel: HandPanel, width_mm: float) -> float:
    """Give the height of the views."""
    return float(panel.window.size_mm[1]) * _scale(panel, width_mm)


def paint(place: Place, panel: HandPanel, sheet: Sheet) -> None:
    """Paint the panel, in millimetres of the picture, without axes: they would take longer than the hand."""
    scale, width = _scale(panel, place.width), place.width
    spare = (width - _width(panel) * scale) / 2
    pen = _Pen(place.figure, place.millimetres(spare), sheet)
    for view in views_of(panel.window, panel.hand)[: 1 if panel.links is not None else 2]:
        _View(pen, panel, view, scale, min(1.6, width / _USUAL_MM)).paint()
    if panel.links is None:
        _write_captions(pen, panel, scale)
    else:
        _paint_links(pen, panel, scale, spare)


@dataclass(frozen=True)
class _Pen:
    """Lines, marks and words in a figure, at places in mm."""

    figure: Figure
    transform: Transform
    sheet: Sheet

    def line(self, x: npt.ArrayLike, y: npt.ArrayLike, **look: Any) -> Line2D:
        """Draw a line or marks."""
        drawn = Line2D(np.atleast_1d(x), np.atleast_1d(y), transform=self.transform, **look)
        self.figure.add_artist(drawn)
        return drawn

    def mark(self, place: tuple[float, float], mark: Mark, identifier: str | None = None) -> None:
        """Draw a mark of an index."""
        self.line(
            *place, marker=mark.shape, markersize=8.0, markerfacecolor=mark.face,
            markeredgecolor=mark.edge, gid=identifier,
        )  # fmt: skip

    def write(self, x: float, y: float, words: str, **look: Any) -> None:
        """Write words."""
        shown = self.sheet.words(words)
        self.figure.text(x, y, shown, fontsize=SMALL_PT, transform=self.transform, **look)


def _width(panel: HandPanel) -> float:
    return float(panel.window.width_mm if panel.links is None else panel.window.size_mm[0])


def _scale(panel: HandPanel, width_mm: float) -> float:
    """Millimetres of the picture to one of the hand."""
    most = width_mm / _width(panel)
    if panel.links is not None:
        most = min(most, _INDEX_MM / float(panel.window.size_mm[1]))
    return min(most, panel.mm_per_mm or most)


@dataclass
class _View:
    """One view of a panel; `thick` is how wide its lines are, 1 in a picture of the usual width."""

    pen: _Pen
    panel: HandPanel
    view: View
    scale: float
    thick: float
    taken: list[Box] = field(default_factory=list)

    def paint(self) -> None:
        """Paint bones, joints and names."""
        left, width, height = (
            self.scale * own for own in (self.view.left, self.view.width, self.view.height)
        )
        index = self.panel.links is not None
        box = Rectangle(
            (left, 0.0), width, height, fill=False, edgecolor="none" if index else RULE, linewidth=0.6,
            transform=self.pen.transform,
        )  # fmt: skip
        self.pen.figure.add_artist(box)
        looks = digit_looks([chain.digit for chain in self.panel.chains])
        for chain in self.panel.chains:
            bones = self.pen.line(
                *(self.scale * self.view.chain(chain)).T, color=BONE if index else looks[chain.digit].colour,
                linewidth=(2.8 if index else 1.3) * self.thick, solid_capstyle="round",
            )  # fmt: skip
            bones.set_clip_path(box)
        if not index:
            places = self.scale * self.view.places(self.panel.receivers_mm)
            self.pen.line(
                *places.T, marker="o", linestyle="none", color=SOFT, markersize=1.6 * self.thick,
                markeredgewidth=0.0,
            )  # fmt: skip
            self._paint_joints()
        self._write_names((left, 0.0, left + width, height))

    def _paint_joints(self) -> None:
        """Paint every joint and tip inside, those that look alike together."""
        alike: dict[tuple[str, str, str, float], list[tuple[float, float]]] = defaultdict(list)
        for point, look in looks_of_points(self.panel.chains):
            if self.panel.window.holds(point):
                mark = Mark("o", PAPER, look.colour if look else INK)
                if point.believed != BELIEVED:
                    mark = BELIEF_MARKS[point.believed]
                alike[*mark, 2.4 if point.name.endswith("_tip") else 3.6].append(self._place(point))
        for (shape, face, edge, size), places in alike.items():
            self.pen.line(
                *np.array(places).T, marker=shape, linestyle="none", markersize=size * self.thick,
                markerfacecolor=face, markeredgecolor=edge, markeredgewidth=0.9 * self.thick,
            )  # fmt: skip

    def _write_names(self, box: Box) -> None:
        """Name digits, seen from the back, and in both views joints outside; captions name the doubted."""
        points = [p for p, _ in looks_of_points(self.panel.chains)]
        inside = [p for p in points if self.panel.window.holds(p)]
        self.taken += [(x - 1, y - 1, x + 1, y + 1) for x, y in map(self._place, inside)]
        if self.view.kind == "back":
            tips = {c.points[-1].name: c.digit for c in self.panel.chains if c.points[-1] is not None}
            for point in inside:
                x, y = self._place(point)
                if point.name in tips:
                    self._write(word(tips[point.name]), (x, y + 3.0), "center", box)
        for point in points:
            if point not in inside and self.panel.links is None:
                self._write_outside(point, box)

    def _write_outside(self, point: DrawnPoint, box: Box) -> None:
        """Write an arrow at the edge, with the joint's name and its distance from its receiver."""
        x, y = self._place(point)
        at_x, at_y = min(max(x, box[0] + 1.5), box[2] - 1.5), min(max(y, 1.5), box[3] - 1.5)
        right = at_x < (box[0] + box[2]) / 2
        words = tr("{name} {reach_mm:.0f} mm", name=word(point.name), reach_mm=point.reach_mm)
        ha = "left" if right else "right"
        _, at_y = self._write(words, (at_x + (2.0 if right else -2.0), at_y), ha, box)
        turn = math.degrees(math.atan2(y - at_y, x - at_x)) - 90.0
        self.pen.line(
            at_x, at_y, marker=(3, 0, turn), markersize=6.0, markerfacecolor=AMBER, markeredgecolor=WEAK_LINE,
            markeredgewidth=0.7,
        )  # fmt: skip

    def _write(self, words: str, wanted: tuple[float, float], ha: str, box: Box) -> tuple[float, float]:
        x, y = free_place(words, wanted, ha, box, self.taken)
        self.pen.write(x, y, words, ha=ha, va="center", gid=f"label{len(self.taken)}")
        return x, y

    def _place(self, point: DrawnPoint) -> tuple[float, float]:
        x, y = (self.scale * self.view.places(point.position_mm)).tolist()
        return x, y


def free_place(
    words: str, wanted: tuple[float, float], ha: str, box: Box, taken: list[Box]
) -> tuple[float, float]:
    """Give the nearest place to the wanted one, the middle of the words' line, where none of those taken is,
    and take it; where none is free, the wanted one.
    """
    wide = width_mm(words)
    start = {"left": 0.0, "center": -wide / 2, "right": -wide}[ha]
    steps = sorted(
        ((2.1 * dx, 1.6 * dy) for dx in range(-3, 4) for dy in range(-6, 7)),
        key=lambda step: (abs(step[0]) + abs(step[1]), -step[1], step[0]),
    )
    for dx, dy in steps:
        x, y = wanted[0] + dx, wanted[1] + dy
        own = (x + start, y - _LINE_MM / 2, x + start + wide, y + _LINE_MM / 2)
        inside = own[0] >= box[0] and own[2] <= box[2] and own[1] >= box[1] and own[3] <= box[3]
        if inside and not any(_overlap(own, other) for other in taken):
            taken.append(own)
            return x, y
    return wanted


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _write_captions(pen: _Pen, panel: HandPanel, scale: float) -> None:
    """Write under each view from where it is seen, if there is room, and above a bar how long it is."""
    wide, _, deep = panel.window.size_mm * scale
    side = tr("from the side, back of the hand to the {hand}", hand=panel.hand)
    for x, words in ((wide / 2, tr("from the back")), (wide + GUTTER_MM * scale + deep / 2, side)):
        lines = [line for line in words.split(", ") if width_mm(line) < 1.2 * deep]
        pen.write(x, -1.0, "\n".join(lines), ha="center", va="top", color=SOFT)
    start, end = 2.0, 2.0 + BAR_MM * scale
    pen.line([start, end], [1.5, 1.5], marker="|", color=SOFT, linewidth=0.8, markersize=4.0)
    words = tr("{BAR_MM:g} mm", BAR_MM=BAR_MM)
    pen.write((start + end) / 2, 2.2, words, ha="center", va="bottom", color=SOFT)


def _paint_links(pen: _Pen, panel: HandPanel, scale: float, spare: float) -> None:
    """Paint every joint's mark as a link; those outside the window, or without a place, in a row below."""
    links, view = panel.links or {}, views_of(panel.window, panel.hand)[0]
    points = {p.name: p for p, _ in looks_of_points(panel.chains) if panel.window.holds(p)}
    absent = [name for name in links if name not in points]
    for index, (name, own) in enumerate(links.items()):
        x, y = (
            (scale * view.places(points[name].position_mm)).tolist()
            if name in points
            else (4.0 + 6.0 * absent.index(name) - spare, -2.5)
        )
        pen.sheet.tips[f"link{index}"] = [own.href, own.words]
        pen.mark((x, y), BELIEF_MARKS[own.believed], f"link{index}")
    if absent:
        words = tr("outside the picture, or without a place")
        pen.write(4.0 + 6.0 * len(absent) - spare, -2.5, words, va="center", color=SOFT)
    x, y = 3.0 - spare, -8.5
    for shown, mark in BELIEF_MARKS.items():
        words = tr(shown)[2:] + (tr(", its place is known") if shown == BELIEVED else "")
        pen.mark((x, y), mark)
        pen.write(x + 3.0, y, words, va="center")
        x += 9.0 + width_mm(words)
