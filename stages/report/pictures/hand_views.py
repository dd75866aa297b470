"""A posed hand seen from its back and, beside that, from its thumb's side: the views, and a page's picture.

Positions are in the view's axes: right, up (distal) and towards the viewer (dorsal), mm, as `hand_motion`
gives them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.belief import BELIEF_MARKS, BELIEVED, NOT
from stages.report.hand_motion import Chain, Point
from stages.report.palette import AMBER, INK, PAPER, RULE, SOFT, WEAK_LINE, Look, digit_looks
from stages.report.pictures.picture import Picture
from stages.report.pictures.word_places import Labels
from stages.report.wording import say, word

Array = npt.NDArray[np.float64]

GUTTER_MM, BAR_MM = 10.0, 20.0
_WIDTH_PX, _HEIGHT_PX, _FOOT_PX = 420.0, 400.0, 34.0
_PAD_MM = 14.0
_LINE_PX = 13.0
_NEAR_MM = 45.0
"""A joint farther than this from the box around the receivers is a gross failure: it must not shrink the
rest.
"""


@dataclass(frozen=True)
class Window:
    """What a picture shows: the box around receivers and plausible joints, corners (3,), mm."""

    low_mm: Array
    high_mm: Array

    @property
    def size_mm(self) -> Array:
        """Extent along right, up and towards the viewer."""
        return np.asarray(self.high_mm - self.low_mm)

    @property
    def width_mm(self) -> float:
        """Both views side by side."""
        return float(self.size_mm[0] + GUTTER_MM + self.size_mm[2])

    @property
    def scale(self) -> float:
        """Pixels per mm at which both views fit into a page picture."""
        return min(_WIDTH_PX / self.width_mm, (_HEIGHT_PX - _FOOT_PX) / float(self.size_mm[1]))

    def holds(self, point: Point) -> bool:
        """Whether the point is inside."""
        return bool((point.position_mm >= self.low_mm).all() and (point.position_mm <= self.high_mm).all())


@dataclass(frozen=True)
class View:
    """One projection: from the back (right and up), or beside it from the side (dorsal and up).

    Its places are (x, y) from the lower left corner of both views, y upward, mm.
    """

    window: Window
    kind: str
    hand: str

    @property
    def left(self) -> float:
        """Where the view begins, mm."""
        return 0.0 if self.kind == "back" else float(self.window.size_mm[0]) + GUTTER_MM

    @property
    def width(self) -> float:
        """Of the view, mm."""
        return float(self.window.size_mm[0 if self.kind == "back" else 2])

    @property
    def height(self) -> float:
        """Of both views, mm."""
        return float(self.window.size_mm[1])

    def places(self, position_mm: Array) -> Array:
        """Places (..., 2) of positions (..., 3)."""
        low, high = self.window.low_mm, self.window.high_mm
        up = position_mm[..., 1] - low[1]
        if self.kind == "back":
            return np.stack([position_mm[..., 0] - low[0], up], axis=-1)
        dorsal = position_mm[..., 2] - low[2] if self.hand == "right" else high[2] - position_mm[..., 2]
        return np.stack([self.left + dorsal, up], axis=-1)

    def chain(self, chain: Chain) -> Array:
        """Places (n, 2) of a digit's points, NaN where one has none."""
        nowhere = np.full(3, np.nan)
        return self.places(np.array([nowhere if p is None else p.position_mm for p in chain.points]))


def views_of(window: Window, hand: str) -> tuple[View, View]:
    """The view from the back and that from the side."""
    return View(window, "back", hand), View(window, "side", hand)


def window_of(receivers_mm: Array, chains: Sequence[Chain]) -> Window:
    """The window for a hand: its receivers (n, 3) and every joint of any model that is near them."""
    low, high = receivers_mm.min(axis=0), receivers_mm.max(axis=0)
    joints = [point.position_mm for chain in chains for point in chain.points if point is not None]
    near = [p for p in joints if (p >= low - _NEAR_MM).all() and (p <= high + _NEAR_MM).all()]
    everything = np.concatenate([receivers_mm, np.reshape(near, (-1, 3))])
    return Window(everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM)


def looks_of_points(chains: Sequence[Chain]) -> list[tuple[Point, Look | None]]:
    """Every point that has a place, once, with the look of its digit; None where several digits share it."""
    looks = digit_looks([chain.digit for chain in chains])
    points: dict[str, tuple[Point, Look | None]] = {}
    for chain in chains:
        for point in filter(None, chain.points):
            points[point.name] = (point, None if point.name in points else looks[chain.digit])
    return list(points.values())


def hand_picture(
    title: str, hand: str, chains: Sequence[Chain], receivers_mm: Array, window: Window, scale: float
) -> Markup:
    """A hand's chains for a page. scale : pixels per mm, `window.scale` at most."""
    height = float(window.size_mm[1]) * scale
    page = _Page(Picture(title, _WIDTH_PX, height + _FOOT_PX), window, scale, height)
    for view in views_of(window, hand):
        page.draw(view, chains, receivers_mm)
    page.captions(hand)
    return page.picture.markup()


@dataclass(frozen=True)
class _Page:
    """A page picture of both views: scale in pixels per mm, height of the views in px."""

    picture: Picture
    window: Window
    scale: float
    height: float

    def px(self, places_mm: Array) -> Array:
        """Pixels (..., 2) of the views' places (..., 2)."""
        spare = (_WIDTH_PX - self.window.width_mm * self.scale) / 2
        return np.asarray(places_mm * (self.scale, -self.scale) + (spare, self.height))

    def draw(self, view: View, chains: Sequence[Chain], receivers_mm: Array) -> None:
        """One view with its names."""
        left, width = float(self.px(np.array([view.left, 0.0]))[0]), view.width * self.scale
        corners = np.array(
            [(left, 0.0), (left + width, 0.0), (left + width, self.height), (left, self.height)]
        )
        self.picture.outline(corners, "none", RULE)
        with self.picture.group("receivers"):
            self.picture.marks(self.px(view.places(receivers_mm)), "o", 3.5, SOFT)
        looks = digit_looks([chain.digit for chain in chains])
        with self.picture.window(left, 0.0, width, self.height):
            for chain in chains:
                colour = looks[chain.digit].colour
                self.picture.line(self.px(view.chain(chain)), colour, 3.0, "stroke-linecap:round")
        for point, look in looks_of_points(chains):
            if self.window.holds(point):
                place = self.px(view.places(point.position_mm))[None]
                if point.believed != BELIEVED:
                    shape, face, edge = BELIEF_MARKS[point.believed]
                    self.picture.marks(place, shape, 8.0, face, edge, 1.5)
                else:
                    size = 5.0 if point.name.endswith("_tip") else 8.0
                    self.picture.marks(place, "o", size, PAPER, look.colour if look else INK, 2.0)
        self._names(view, chains, left, left + width)

    def _names(self, view: View, chains: Sequence[Chain], left: float, right: float) -> None:
        """Digits at their tips and joints not to believe, from the back; names of joints outside, in both."""
        taken: list[float] = []
        inside = [
            (chain, p) for chain in chains for p in chain.points if p is not None and self.window.holds(p)
        ]
        if view.kind == "back":
            labels = Labels(left, right)
            labels.avoid((tuple(self.px(view.places(p.position_mm)).tolist()) for _, p in inside), 3.0)
            for chain, point in inside:
                x, y = self.px(view.places(point.position_mm)).tolist()
                if point is chain.points[-1]:
                    x, y = labels.place(word(chain.digit), x, y - 10)
                    taken.append(y)
                    self.picture.text(x, y, word(chain.digit), "middle", middle=True, css_class="label")
            for _, point in inside:
                if point.believed == NOT:
                    x, y = self.px(view.places(point.position_mm)).tolist()
                    x, y = labels.place(word(point.name), x, y + 12)
                    self.picture.text(x, y, word(point.name), "middle", middle=True, css_class="label")
        for point, _ in looks_of_points(chains):
            if not self.window.holds(point):
                self._outside(view, point, taken, left, right)

    def _outside(self, view: View, point: Point, taken: list[float], left: float, right: float) -> None:
        """An arrow at the edge, with the joint's name and its distance from its receiver."""
        x, y = self.px(view.places(point.position_mm)).tolist()
        at_x = min(max(x, left + 5), right - 5)
        at_y = free_place(min(max(y, 5.0), self.height - 5), taken, _LINE_PX, self.height)
        taken.append(at_y)
        way = np.array([x - at_x, y - at_y]) / max(np.hypot(x - at_x, y - at_y), 1e-9)
        across = np.array([-way[1], way[0]])
        corners = np.array([at_x, at_y]) + 5 * np.array(
            [way, across * 0.87 - way / 2, -across * 0.87 - way / 2]
        )
        self.picture.outline(corners, AMBER, WEAK_LINE)
        self._aside(
            say("{name} {reach_mm:.0f} mm", name=word(point.name), reach_mm=point.reach_mm),
            at_x,
            at_y,
            rightwards=at_x < (left + right) / 2,
        )

    def _aside(self, words: str, x: float, y: float, *, rightwards: bool) -> None:
        """Words beside a place, with a halo in the paper's colour (page.css)."""
        anchor = "start" if rightwards else "end"
        self.picture.text(x + (9 if rightwards else -9), y, words, anchor, middle=True, css_class="label")

    def captions(self, hand: str) -> None:
        """Under each view from where it is seen, and a bar that says how long 20 mm are."""
        wide, _, deep = self.window.size_mm
        for middle, lines in (
            (wide / 2, [say("seen from the back")]),
            (
                wide + GUTTER_MM + deep / 2,
                [say("seen from the side,"), say("back of the hand to the {hand}", hand=hand)],
            ),
        ):
            x, y = self.px(np.array([middle, 0.0])).tolist()
            for index, line in enumerate(lines):
                self.picture.text(x, y + 14 + 13 * index, line, "middle", SOFT)
        left, y = self.px(np.zeros(2)).tolist()
        start, end, y = left + 8, left + 8 + BAR_MM * self.scale, y - 6
        self.picture.line([(start, y), (end, y)], SOFT)
        for x in (start, end):
            self.picture.line([(x, y - 3), (x, y + 3)], SOFT)
        self.picture.text((start + end) / 2, y - 5, say("{BAR_MM:g} mm", BAR_MM=BAR_MM), "middle", SOFT)


def free_place(wanted: float, taken: Sequence[float], gap: float, highest: float) -> float:
    """The place nearest to `wanted`, from a gap to `highest` less a gap, that keeps a gap to all places
    taken.
    """
    steps = [0.0] + [sign * n * gap / 2 for n in range(1, 41) for sign in (1, -1)]
    places = [wanted + step for step in steps if gap <= wanted + step <= highest - gap]
    free = (place for place in places if all(abs(place - other) >= gap for other in taken))
    return next(free, min(max(wanted, gap), highest - gap))
