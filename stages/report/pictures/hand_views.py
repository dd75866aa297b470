"""A posed hand drawn twice, from its back and from its thumb's side, in one scale: for pages and for print.

Positions are in the view's axes: right, up (distal) and towards the viewer (dorsal), mm, as `hand_motion`
gives them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from stages.report.hand_motion import Chain, Point
from stages.report.palette import AMBER, INK, PAPER, RULE, SOFT, WEAK_LINE, Look, digit_looks
from stages.report.pictures.page_picture import inline_svg, marked, page_figure, page_style

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
class Strokes:
    """Widths and sizes in the figure's unit (pt in print, px in a page).

    markers : whether each digit has a marker of its own. unit_mm : the figure's unit in mm of the hand; 0
    leaves out the names of tips, of doubtful joints and of joints outside the window.
    """

    bone: float
    joint: float
    tip: float
    weak: float
    edge: float
    markers: bool
    unit_mm: float = 0.0


def window_of(receivers_mm: Array, chains: Sequence[Chain]) -> Window:
    """The window for a hand: its receivers (n, 3) and every joint of any model that is near them."""
    low, high = receivers_mm.min(axis=0), receivers_mm.max(axis=0)
    joints = [point.position_mm for chain in chains for point in chain.points if point is not None]
    near = [p for p in joints if (p >= low - _NEAR_MM).all() and (p <= high + _NEAR_MM).all()]
    everything = np.concatenate([receivers_mm, np.reshape(near, (-1, 3))])
    return Window(everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM)


def hand_picture(
    title: str, hand: str, chains: Sequence[Chain], receivers_mm: Array, window: Window, scale: float
) -> Markup:
    """A hand's chains for a page. scale : pixels per mm, `window.scale` at most."""
    height = float(window.size_mm[1]) * scale + _FOOT_PX
    with page_style():
        figure = page_figure(_WIDTH_PX, height)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        strokes = Strokes(3.0, 8.0, 5.0, 8.0, 2.0, markers=False, unit_mm=1 / scale)
        draw_hand(axes, hand, chains, receivers_mm, window, strokes)
        _captions(axes, hand, window, strokes.unit_mm)
        spare = (_WIDTH_PX / scale - window.width_mm) / 2
        axes.set_xlim(-spare, window.width_mm + spare)
        axes.set_ylim(-_FOOT_PX / scale, float(window.size_mm[1]))
        return inline_svg(figure, title)


def draw_hand(
    axes: Axes, hand: str, chains: Sequence[Chain], receivers_mm: Array, window: Window, strokes: Strokes
) -> None:
    """Draw both views in mm of the hand from (0, 0), the side view to the right; limits are the caller's."""
    looks = digit_looks([chain.digit for chain in chains])
    for view in (_View(axes, window, "back", hand), _View(axes, window, "side", hand)):
        box = Rectangle((view.left, 0.0), view.width, view.height, fill=False, edgecolor=RULE, linewidth=1.0)
        axes.add_patch(box)
        axes.plot(
            *view.places(receivers_mm).T, "o" if strokes.unit_mm else "+", color=SOFT,
            alpha=0.6, markersize=3.0, markeredgewidth=0.5,
        )  # fmt: skip
        for chain in chains:
            (bones,) = axes.plot(
                *view.places(np.array([_place(p) for p in chain.points])).T,
                color=looks[chain.digit].colour,
                linewidth=strokes.bone,
                solid_capstyle="round",
            )
            bones.set_clip_path(box)
        points = {p.name: p for chain in chains for p in chain.points if p is not None}
        digits = _digits_of(chains)
        marks: dict[tuple[str, str, str, float], list[Point]] = {}
        for point in points.values():
            if window.holds(point):
                mark = _mark(point, looks.get(digits[point.name]), strokes)
                marks.setdefault(mark, []).append(point)
        for (shape, edge, face, size), of_mark in marks.items():
            axes.plot(
                *view.places(np.array([point.position_mm for point in of_mark])).T, shape, color=edge,
                markerfacecolor=face, markersize=size, markeredgewidth=strokes.edge, zorder=3,
            )  # fmt: skip
        if strokes.unit_mm:
            _labels(axes, view, chains, strokes.unit_mm)


def _mark(point: Point, look: Look | None, strokes: Strokes) -> tuple[str, str, str, float]:
    """Shape, edge, face and size: a diamond where doubtful, ink where several digits share it."""
    if point.status == "weak":
        return "D", WEAK_LINE, AMBER, strokes.weak
    shape = look.marker if look and strokes.markers else "o"
    size = strokes.tip if point.name.endswith("_tip") else strokes.joint
    return shape, look.colour if look else INK, PAPER, size


@dataclass(frozen=True)
class _View:
    """One projection into the axes: from the back (right and up), or from the side (dorsal and up)."""

    axes: Axes
    window: Window
    kind: str
    hand: str

    @property
    def left(self) -> float:
        return 0.0 if self.kind == "back" else float(self.window.size_mm[0]) + GUTTER_MM

    @property
    def width(self) -> float:
        return float(self.window.size_mm[0 if self.kind == "back" else 2])

    @property
    def height(self) -> float:
        return float(self.window.size_mm[1])

    def places(self, position_mm: Array) -> Array:
        """Axes coordinates (..., 2) of positions (..., 3)."""
        low, high = self.window.low_mm, self.window.high_mm
        up = position_mm[..., 1] - low[1]
        if self.kind == "back":
            return np.stack([position_mm[..., 0] - low[0], up], axis=-1)
        dorsal = position_mm[..., 2] - low[2] if self.hand == "right" else high[2] - position_mm[..., 2]
        return np.stack([self.left + dorsal, up], axis=-1)


def _labels(axes: Axes, view: _View, chains: Sequence[Chain], unit_mm: float) -> None:
    """Digits at their tips and names of doubtful joints, from the back; of joints outside, in both views."""
    taken: list[float] = []
    if view.kind == "back":
        for chain in chains:
            if (tip := chain.points[-1]) is not None and view.window.holds(tip):
                x, y = view.places(tip.position_mm)
                y = min(float(y) + 6 * unit_mm, view.height - 10 * unit_mm)
                _text(axes, chain.digit, x, y, "center", "bottom")
                taken.append(y)
        for chain in chains:
            for point in chain.points:
                if point is not None and point.status == "weak" and view.window.holds(point):
                    _beside(axes, view, point.name.removeprefix(f"{chain.digit}_"), point, unit_mm)
    outside = {
        p.name: p for chain in chains for p in chain.points if p is not None and not view.window.holds(p)
    }
    for point in outside.values():
        _outside(axes, view, point, taken, unit_mm)


def _beside(axes: Axes, view: _View, text: str, point: Point, unit_mm: float) -> None:
    """A name beside a point, outward if there is room."""
    x, y = (float(value) for value in view.places(point.position_mm))
    width = (6.5 * len(text) + 9) * unit_mm
    left_half = x < view.left + view.width / 2
    fits = x - width > view.left if left_half else x + width < view.left + view.width
    _text_aside(axes, text, x, y, unit_mm, rightwards=left_half != fits)


def _outside(axes: Axes, view: _View, point: Point, taken: list[float], unit_mm: float) -> None:
    """An arrow at the edge, with the joint's name and its distance from its receiver."""
    x, y = (float(value) for value in view.places(point.position_mm))
    inset = 5 * unit_mm
    edge_x = min(max(x, view.left + inset), view.left + view.width - inset)
    edge_y = free_place(min(max(y, inset), view.height - inset), taken, _LINE_PX * unit_mm, view.height)
    taken.append(edge_y)
    turn = float(np.degrees(np.arctan2(y - edge_y, x - edge_x)))
    axes.plot(
        [edge_x], [edge_y], marker=(3, 0, turn - 90), color=WEAK_LINE, markerfacecolor=AMBER, markersize=10,
        markeredgewidth=1.0, zorder=3,
    )  # fmt: skip
    rightwards = edge_x < view.left + view.width / 2
    _text_aside(axes, f"{point.name} {point.reach_mm:.0f} mm", edge_x, edge_y, unit_mm, rightwards=rightwards)


def free_place(wanted: float, taken: Sequence[float], gap: float, highest: float) -> float:
    """The place nearest to `wanted`, from a gap to `highest` less a gap, that keeps a gap to all places
    taken.
    """
    steps = [0.0] + [sign * n * gap / 2 for n in range(1, 41) for sign in (1, -1)]
    places = [wanted + step for step in steps if gap <= wanted + step <= highest - gap]
    free = (place for place in places if all(abs(place - other) >= gap for other in taken))
    return next(free, min(max(wanted, gap), highest - gap))


def _text_aside(axes: Axes, text: str, x: float, y: float, unit_mm: float, *, rightwards: bool) -> None:
    _text(axes, text, x + (9 if rightwards else -9) * unit_mm, y, "left" if rightwards else "right", "center")


def _text(axes: Axes, text: str, x: float, y: float, across: str, up: str) -> None:
    """Words with a halo in the paper's colour (page.css)."""
    marked(axes.text(x, y, text, ha=across, va=up, zorder=4), "label")


def _captions(axes: Axes, hand: str, window: Window, unit_mm: float) -> None:
    """Under each view from where it is seen, and a bar that says how long 20 mm are."""
    wide, _, deep = window.size_mm
    side = "back of the hand to the right" if hand == "right" else "back of the hand to the left"
    for x, lines in (
        (wide / 2, ["seen from the back"]),
        (wide + GUTTER_MM + deep / 2, ["seen from the side,", side]),
    ):
        for index, line in enumerate(lines):
            axes.text(x, -(14 + 13 * index) * unit_mm, line, ha="center", va="baseline", color=SOFT)
    x, y, tick = 8 * unit_mm, 6 * unit_mm, 3 * unit_mm
    for xs, ys in (
        ((x, x + BAR_MM), (y, y)),
        ((x, x), (y - tick, y + tick)),
        ((x + BAR_MM, x + BAR_MM), (y - tick, y + tick)),
    ):
        axes.plot(xs, ys, color=SOFT, linewidth=1.0)
    axes.text(x + BAR_MM / 2, y + 5 * unit_mm, f"{BAR_MM:g} mm", ha="center", va="bottom", color=SOFT)


def _digits_of(chains: Sequence[Chain]) -> Mapping[str, str]:
    """The digit of every point; empty where several share it."""
    digits: dict[str, str] = {}
    for chain in chains:
        for name in chain.names:
            digits[name] = "" if name in digits else chain.digit
    return digits


def _place(point: Point | None) -> Array:
    return np.full(3, np.nan) if point is None else point.position_mm
