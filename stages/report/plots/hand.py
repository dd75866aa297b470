"""A posed hand, seen from its back and its thumb's side, or as an index of its joints.

Positions are in the view's axes: right, up (distal) and towards the viewer (dorsal), mm, as `hand_motion`
has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.belief import BELIEF_MARKS, BELIEVED
from shukotsu.stages.report.hand_motion import Chain, DrawnPoint
from shukotsu.stages.report.palette import (
    AMBER,
    BONE,
    INK,
    PAPER,
    RULE,
    SOFT,
    WEAK_LINE,
    Look,
    Mark,
    digit_looks,
)
from shukotsu.stages.report.plots.panels import PAGE_MM, Panel
from shukotsu.stages.report.plots.style import SMALL_PT, width_mm

Array = npt.NDArray[np.float64]
Box = tuple[float, float, float, float]
"""Left, lower, right and upper edge, mm of the picture."""

_GUTTER_MM, _BAR_MM, _PAD_MM = 10.0, 20.0, 14.0
_NEAR_MM = 45.0
"""A joint farther than this from the box around the receivers is a gross failure: it must not shrink the
rest.
"""
_EDGE_MM, _FOOT_MM, _INDEX_FOOT_MM, _INDEX_MM, _LINE_MM, _USUAL_MM = 3.0, 9.0, 12.0, 92.0, 3.2, 85.0
"""What is free at both sides together and below the views, how high an index is at most and a line of text,
and how wide a picture is whose lines have their usual widths.
"""


@dataclass(frozen=True)
class JointLink:
    """A joint of an index: one of BELIEFS, where its mark leads to, and what is said of it."""

    believed: str
    href: str
    words: str


@dataclass(frozen=True)
class Window:
    """A picture's extent: the box around receivers and plausible joints, corners (3,), mm."""

    low_mm: Array
    high_mm: Array

    @property
    def size_mm(self) -> Array:
        """Extent along right, up and towards the viewer."""
        return np.asarray(self.high_mm - self.low_mm)

    @property
    def width_mm(self) -> float:
        """Width of both views side by side."""
        return float(self.size_mm[0] + _GUTTER_MM + self.size_mm[2])

    def holds(self, point: DrawnPoint) -> bool:
        """Whether the point is inside."""
        return bool((point.position_mm >= self.low_mm).all() and (point.position_mm <= self.high_mm).all())


def window_of(receivers_mm: Array, chains: Sequence[Chain]) -> Window:
    """Return the window for a hand: its receivers (n, 3) and every joint of any model that is near them."""
    low, high = receivers_mm.min(axis=0), receivers_mm.max(axis=0)
    joints = [point.position_mm for chain in chains for point in chain.points if point is not None]
    near = [p for p in joints if (p >= low - _NEAR_MM).all() and (p <= high + _NEAR_MM).all()]
    everything = np.concatenate([receivers_mm, np.reshape(near, (-1, 3))])
    return Window(everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM)


def hand_panel(
    heading: str,
    title: str,
    hand: str,
    chains: Sequence[Chain],
    receivers_mm: Array,
    window: Window,
    *,
    panel_mm: float = PAGE_MM,
    mm_per_mm: float = math.inf,
    links: Mapping[str, JointLink] | None = None,
) -> Panel:
    """Return the panel of a hand in a window, `panel_mm` wide.

    mm_per_mm : the most millimetres of the picture to one of the hand. links : makes it an index, seen from
    the back alone, in which each of these joints leads somewhere.
    """
    wide, high, _ = window.size_mm.tolist()
    scale = min(mm_per_mm, (panel_mm - _EDGE_MM) / (window.width_mm if links is None else wide))
    scale = scale if links is None else min(scale, _INDEX_MM / high)
    foot_mm = _FOOT_MM if links is None else _INDEX_FOOT_MM
    draw = partial(
        draw_hand, hand=hand, chains=chains, receivers_mm=receivers_mm, window=window, scale=scale,
        panel_mm=panel_mm, links=links,
    )  # fmt: skip
    return Panel(heading, title, high * scale + foot_mm + 2.0, 0.0, draw)


def draw_hand(
    axes: Axes,
    hand: str,
    chains: Sequence[Chain],
    receivers_mm: Array,
    window: Window,
    scale: float,
    panel_mm: float,
    links: Mapping[str, JointLink] | None = None,
) -> None:
    """Draw the hand in millimetres of the picture: bones, receivers, joints and names."""
    wide, high, deep = (window.size_mm * scale).tolist()
    spare = (panel_mm - _EDGE_MM - (wide if links is not None else window.width_mm * scale)) / 2
    foot_mm = _FOOT_MM if links is None else _INDEX_FOOT_MM
    axes.set(xlim=(-spare, panel_mm - _EDGE_MM - spare), ylim=(-foot_mm, high), aspect="equal")
    axes.axis("off")
    thick, looks = min(1.6, panel_mm / _USUAL_MM), digit_looks([chain.digit for chain in chains])
    points = _looks_of_points(chains)
    tips = {chain.points[-1].name: chain.digit for chain in chains if chain.points[-1] is not None}
    views = (("back", 0.0, wide), ("side", wide + _GUTTER_MM * scale, deep))
    for view, left, width in views[: 1 if links is not None else 2]:
        box = (left, 0.0, left + width, high)
        edge = "none" if links is not None else RULE
        frame = axes.add_patch(
            Rectangle((left, 0.0), width, high, fill=False, edgecolor=edge, lw=0.6, clip_on=False)
        )
        for chain in chains:
            ends = [np.full(3, np.nan) if p is None else p.position_mm for p in chain.points]
            (bones,) = axes.plot(
                *_flat(np.array(ends), window, view, hand, scale).T, solid_capstyle="round",
                color=looks[chain.digit].colour if links is None else BONE,
                linewidth=(1.3 if links is None else 2.8) * thick,
            )  # fmt: skip
            bones.set_clip_path(frame)
        places = {p.name: tuple(_flat(p.position_mm, window, view, hand, scale).tolist()) for p, _ in points}
        inside = [(point, look) for point, look in points if window.holds(point)]
        if links is None:
            at = _flat(receivers_mm, window, view, hand, scale)
            axes.plot(*at.T, "o", color=SOFT, markersize=1.6 * thick, markeredgewidth=0.0)
            for point, look in inside:
                mark = BELIEF_MARKS[point.believed]
                if point.believed == BELIEVED:
                    mark = Mark("o", PAPER, look.colour if look else INK)
                axes.plot(
                    *places[point.name], mark.shape, markerfacecolor=mark.face, markeredgecolor=mark.edge,
                    markersize=(2.4 if point.name.endswith("_tip") else 3.6) * thick,
                    markeredgewidth=0.9 * thick,
                )  # fmt: skip
        taken = [(x - 1, y - 1, x + 1, y + 1) for x, y in (places[point.name] for point, _ in inside)]
        for point, _ in inside:
            if view == "back" and point.name in tips:
                x, y = places[point.name]
                _write(axes, word(tips[point.name]), (x, y + 3.0), "center", box, taken)
        for point, _ in points:
            if links is None and not window.holds(point):
                _draw_outside(axes, point, places[point.name], box, taken)
    if links is not None:
        _draw_links(axes, links, {p.name: places[p.name] for p, _ in inside}, spare)
        return
    side = tr("from the side, back of the hand to the {hand}", hand=hand)
    for words, (_, left, width) in zip((tr("from the back"), side), views, strict=True):
        lines = [line for line in words.split(", ") if width_mm(line) < 1.2 * deep]
        x = left + width / 2
        axes.text(x, -1.0, "\n".join(lines), ha="center", va="top", color=SOFT, fontsize=SMALL_PT)
    start, end = 2.0, 2.0 + _BAR_MM * scale
    axes.plot([start, end], [1.5, 1.5], marker="|", color=SOFT, linewidth=0.8, markersize=4.0)
    words = tr("{BAR_MM:g} mm", BAR_MM=_BAR_MM)
    axes.text((start + end) / 2, 2.2, words, ha="center", va="bottom", color=SOFT, fontsize=SMALL_PT)


def _flat(position_mm: Array, window: Window, view: str, hand: str, scale: float) -> Array:
    """Return places (..., 2) of positions (..., 3), in mm of the picture from its corner."""
    low, high = window.low_mm, window.high_mm
    across = position_mm[..., 0] - low[0]
    if view == "side":
        dorsal = position_mm[..., 2] - low[2] if hand == "right" else high[2] - position_mm[..., 2]
        across = window.size_mm[0] + _GUTTER_MM + dorsal
    return np.stack([scale * across, scale * (position_mm[..., 1] - low[1])], axis=-1)


def _looks_of_points(chains: Sequence[Chain]) -> list[tuple[DrawnPoint, Look | None]]:
    """Return every point with a place, once, with its digit's look; None where several digits share it."""
    looks = digit_looks([chain.digit for chain in chains])
    points: dict[str, tuple[DrawnPoint, Look | None]] = {}
    for chain in chains:
        for point in filter(None, chain.points):
            points[point.name] = (point, None if point.name in points else looks[chain.digit])
    return list(points.values())


def _draw_outside(
    axes: Axes, point: DrawnPoint, place: tuple[float, float], box: Box, taken: list[Box]
) -> None:
    """Draw an arrow at the edge, with the joint's name and its distance from its receiver."""
    x, y = place
    at_x, at_y = min(max(x, box[0] + 1.5), box[2] - 1.5), min(max(y, 1.5), box[3] - 1.5)
    right = at_x < (box[0] + box[2]) / 2
    words = tr("{name} {reach_mm:.0f} mm", name=word(point.name), reach_mm=point.reach_mm)
    wanted = (at_x + (2.0 if right else -2.0), at_y)
    at_y = _write(axes, words, wanted, "left" if right else "right", box, taken)
    turn = math.degrees(math.atan2(y - at_y, x - at_x)) - 90.0
    axes.plot(
        at_x, at_y, marker=(3, 0, turn), markersize=6.0, markerfacecolor=AMBER, markeredgecolor=WEAK_LINE,
        markeredgewidth=0.7,
    )  # fmt: skip


def _write(axes: Axes, words: str, wanted: tuple[float, float], ha: str, box: Box, taken: list[Box]) -> float:
    """Write words where there is room; return how high."""
    x, y = free_place(words, wanted, ha, box, taken)
    axes.text(x, y, words, ha=ha, va="center", fontsize=SMALL_PT, gid=f"label{len(taken)}")
    return y


def free_place(
    words: str, wanted: tuple[float, float], ha: str, box: Box, taken: list[Box]
) -> tuple[float, float]:
    """Return the nearest place to the wanted one, the middle of the line, where none of those taken is, and
    take it; where none is free, the wanted one.
    """
    wide = width_mm(words)
    start = {"left": 0.0, "center": -wide / 2, "right": -wide}[ha]
    steps = sorted(
        ((2.1 * dx, 1.6 * dy) for dx in range(-3, 4) for dy in range(-6, 7)),
        key=lambda step: (abs(step[0]) + abs(step[1]), -step[1], step[0]),
    )
    for dx, dy in steps:
        x, y = wanted[0] + dx, wanted[1] + dy
        line = (x + start, y - _LINE_MM / 2, x + start + wide, y + _LINE_MM / 2)
        inside = line[0] >= box[0] and line[2] <= box[2] and line[1] >= box[1] and line[3] <= box[3]
        if inside and not any(
            line[0] < b[2] and b[0] < line[2] and line[1] < b[3] and b[1] < line[3] for b in taken
        ):
            taken.append(line)
            return x, y
    return wanted


def _draw_links(
    axes: Axes, links: Mapping[str, JointLink], places: Mapping[str, tuple[float, ...]], spare: float
) -> None:
    """Draw every joint's mark as a link, those without a place in a row below, and what the marks mean."""
    absent = [name for name in links if name not in places]
    for index, (name, link) in enumerate(links.items()):
        at = places[name] if name in places else (4.0 + 6.0 * absent.index(name) - spare, -2.5)
        _draw_mark(axes, at, link.believed, f"link{index}", f"{link.href}\n{link.words}")
    if absent:
        words = tr("outside the picture, or without a place")
        x = 4.0 + 6.0 * len(absent) - spare
        axes.text(x, -2.5, words, va="center", color=SOFT, fontsize=SMALL_PT)
    x = 3.0 - spare
    for shown in BELIEF_MARKS:
        words = tr(shown)[2:] + (tr(", its place is known") if shown == BELIEVED else "")
        _draw_mark(axes, (x, -8.5), shown)
        axes.text(x + 3.0, -8.5, words, va="center", fontsize=SMALL_PT)
        x += 9.0 + width_mm(words)


def _draw_mark(
    axes: Axes, at: tuple[float, ...], believed: str, identifier: str | None = None, told: str = ""
) -> None:
    mark = BELIEF_MARKS[believed]
    axes.plot(
        *at, mark.shape, markersize=8.0, markerfacecolor=mark.face, markeredgecolor=mark.edge,
        gid=identifier, label=told,
    )  # fmt: skip
