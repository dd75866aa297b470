"""The picture of a posed skeleton: a hand from the back and from the thumb's side, in one scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.posed_skeleton import Chain, Point
from stages.report.svg import element, free_place, image

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT = 420, 400
_GUTTER, _FOOT = 14, 34
_PAD_MM = 14.0
# A joint farther than this from the box around the receivers is a gross failure: it must not shrink the rest.
_NEAR_MM = 45.0
_BAR_MM = 20
_LINE = 13.0


@dataclass(frozen=True)
class Window:
    """What a picture shows: the box around receivers and plausible joints, mm in the view's axes."""

    low_mm: Array
    high_mm: Array

    @property
    def size_mm(self) -> Array:
        """Extent along right, up and towards the viewer."""
        return np.asarray(self.high_mm - self.low_mm)

    @property
    def scale(self) -> float:
        """Pixels per mm at which both views fit side by side."""
        wide, high, deep = self.size_mm
        return float(min((WIDTH - _GUTTER) / (wide + deep), (HEIGHT - _FOOT) / high))


def window_of(receivers_mm: Array, chains: Sequence[Chain]) -> Window:
    """The window for a hand: its receivers, shape (n, 3), and every joint of any model that is near them."""
    low, high = receivers_mm.min(axis=0), receivers_mm.max(axis=0)
    joints = [point.position_mm for chain in chains for point in chain.points if point is not None]
    near = [p for p in joints if (p >= low - _NEAR_MM).all() and (p <= high + _NEAR_MM).all()]
    everything = np.concatenate([receivers_mm, np.reshape(near, (-1, 3))])
    return Window(everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM)


@dataclass(frozen=True)
class _View:
    """One projection: which signed axis goes to the right, and where its box stands in the picture."""

    across: int
    sign: int
    left: float
    window: Window
    scale: float

    @property
    def width(self) -> float:
        return float(self.window.size_mm[self.across]) * self.scale

    @property
    def height(self) -> float:
        return float(self.window.size_mm[1]) * self.scale

    def place(self, position_mm: Array) -> tuple[float, float]:
        """Pixels within the view's box."""
        edge = self.window.low_mm if self.sign > 0 else self.window.high_mm
        right = (position_mm[self.across] - edge[self.across]) * self.sign * self.scale
        return float(right), float((self.window.high_mm[1] - position_mm[1]) * self.scale)

    def shows(self, position_mm: Array) -> bool:
        x, y = self.place(position_mm)
        return 0 <= x <= self.width and 0 <= y <= self.height


def hand_picture(
    title: str, hand: str, chains: Sequence[Chain], receivers_mm: Array, window: Window, scale: float
) -> Markup:
    """Draw a hand's chains twice: from the back (left) and from the thumb's side (right).

    hand : right or left. receivers_mm : (n, 3) in the view's axes. scale : pixels per mm, window.scale at
    most. title : the text alternative.
    """
    deep_sign = 1 if hand == "right" else -1
    total = (window.size_mm[0] + window.size_mm[2]) * scale + _GUTTER
    start = (WIDTH - total) / 2
    back = _View(0, 1, start, window, scale)
    side = _View(2, deep_sign, start + back.width + _GUTTER, window, scale)
    words = ("back of the hand to the right", "back of the hand to the left")[hand != "right"]
    return image(
        WIDTH,
        back.height + _FOOT,
        title,
        _drawn(back, chains, receivers_mm),
        _drawn(side, chains, receivers_mm),
        *_captions(back, "seen from the back", ""),
        *_captions(side, "seen from the side,", words),
        *_scale_bar(back),
    )


def _drawn(view: _View, chains: Sequence[Chain], receivers_mm: Array) -> Markup:
    """One view in a box of its own, which cuts off what lies outside."""
    dots = [element("circle", cx=x, cy=y, r=1.8, class_="receiver") for x, y in map(view.place, receivers_mm)]
    bones = [bone for index, chain in enumerate(chains) for bone in _bones(view, index, chain)]
    points = {p.name: p for chain in chains for p in chain.points if p is not None}
    digit_of = _digits_of(chains)
    inside = [p for p in points.values() if view.shows(p.position_mm)]
    outside = [p for p in points.values() if not view.shows(p.position_mm)]
    tips = _tip_labels(view, chains)
    taken = [y for _, _, y in tips]
    return element(
        "svg",
        element("rect", width=view.width, height=view.height, class_="frame"),
        *dots,
        *bones,
        *(_joint(view, digit_of[point.name], point) for point in inside),
        *(element("text", words, x=x, y=y, class_="label middle") for words, x, y in tips),
        *_weak_labels(view, chains),
        *_outside_marks(view, outside, taken),
        x=view.left,
        y=1,
        width=view.width,
        height=view.height,
    )


def _bones(view: _View, index: int, chain: Chain) -> list[Markup]:
    """A line between neighbours that both have a place; a bone beside an absent joint is not drawn."""
    bones = []
    for near, far in zip(chain.points, chain.points[1:], strict=False):
        if near is not None and far is not None:
            (x1, y1), (x2, y2) = view.place(near.position_mm), view.place(far.position_mm)
            line = f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}"
            bones.append(element("path", d=line, class_=f"bone digit{index}"))
    return bones


def _digits_of(chains: Sequence[Chain]) -> dict[str, str]:
    """The colour class of every point: its digit's, or none where digits share it."""
    classes: dict[str, str] = {}
    for index, chain in enumerate(chains):
        for name in chain.names:
            classes[name] = "shared" if name in classes else f"digit{index}"
    return classes


def _joint(view: _View, colour: str, point: Point) -> Markup:
    x, y = view.place(point.position_mm)
    if point.status == "weak":
        return element("path", d=f"M{x:.1f} {y - 6:.1f}l6 6-6 6-6-6z", class_="weak")
    radius = 2.5 if point.name.endswith(" tip") else 4
    return element("circle", cx=x, cy=y, r=radius, class_=f"joint {colour}")


def _tip_labels(view: _View, chains: Sequence[Chain]) -> list[tuple[str, float, float]]:
    """Digit names above their tips, only from the back: from the side the fingers hide each other."""
    if view.across != 0:
        return []
    tips = [(chain.digit, chain.points[-1]) for chain in chains]
    places = [(digit, view.place(tip.position_mm)) for digit, tip in tips if tip is not None]
    return [(digit, x, max(y - 6, 10)) for digit, (x, y) in places]


def _weak_labels(view: _View, chains: Sequence[Chain]) -> list[Markup]:
    """Names of doubtful joints without their digit's, which stands at the tip; only from the back."""
    if view.across != 0:
        return []
    labels = {}
    for chain in chains:
        for point in chain.points:
            if point is not None and point.status == "weak" and view.shows(point.position_mm):
                x, y = view.place(point.position_mm)
                labels[point.name] = _text(view, point.name.removeprefix(f"{chain.digit}_"), x, y + 4, 9)
    return list(labels.values())


def _outside_marks(view: _View, points: Sequence[Point], taken: list[float]) -> list[Markup]:
    """An arrow at the edge for each joint outside, with its name and distance from its receiver."""
    inset = 5.0
    marks = []
    for point in points:
        x, y = view.place(point.position_mm)
        edge_x = min(max(x, inset), view.width - inset)
        edge_y = free_place(min(max(y, inset), view.height - inset), taken, _LINE, 14, view.height - 8)
        taken.append(edge_y)
        turn = float(np.degrees(np.arctan2(y - edge_y, x - edge_x)))
        place = f"translate({edge_x:.1f} {edge_y:.1f}) rotate({turn:.0f})"
        marks.append(element("path", d="M5 0l-9-5v10z", transform=place, class_="weak"))
        marks.append(_text(view, f"{point.name} {point.reach_mm:.0f} mm", edge_x, edge_y + 4, 9))
    return marks


def _text(view: _View, words: str, x: float, y: float, gap: float) -> Markup:
    """Words beside a place, on the side where there is room."""
    if x > view.width / 2:
        return element("text", words, x=x - gap, y=y, class_="label end")
    return element("text", words, x=x + gap, y=y, class_="label")


def _captions(view: _View, first: str, second: str) -> list[Markup]:
    x, y = view.left + view.width / 2, view.height + 14
    return [
        element("text", words, x=x, y=y + 12 * line, class_="tick middle")
        for line, words in enumerate((first, second))
        if words
    ]


def _scale_bar(view: _View) -> list[Markup]:
    x, y, length = view.left + 8, view.height - 6, _BAR_MM * view.scale
    return [
        element("path", d=f"M{x:.1f} {y - 3:.1f}v6m0-3h{length:.1f}m0-3v6", class_="axis"),
        element("text", f"{_BAR_MM} mm", x=x + length / 2, y=y - 5, class_="tick middle"),
    ]
