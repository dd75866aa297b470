"""Pictures of numbers over a percent of a cycle or over each other: bands, lines, points and levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.palette import HUES, INK, RULE, SOFT
from stages.report.pictures.picture import Picture
from stages.report.pictures.scale import Scale, plain

Array = npt.NDArray[np.float64]

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _FOOT = 400.0, 210.0, 46.0, 390.0, 22.0, 172.0
_PAD = 0.06
BAND = HUES["rule"][0]


@dataclass(frozen=True)
class XYPlot:
    """What is drawn, in data units, each array (n,).

    band : x, low and high. lines : x and y, with their colour. points : x and y. levels : heights of
    horizontal lines, with a dash where they are limits. marked : stretches of x, from and to, drawn along
    the foot. words : of the x and the y axis.
    """

    title: str
    words: tuple[str, str]
    band: tuple[Array, Array, Array] | None = None
    lines: Sequence[tuple[Array, Array, str]] = ()
    points: tuple[Array, Array] | None = None
    levels: Sequence[tuple[float, bool]] = ()
    marked: Sequence[tuple[float, float]] = field(default_factory=tuple)
    colour: str = INK

    def scales(self) -> tuple[Scale, Scale]:
        """Scales that hold everything."""
        x = [self.band[0]] if self.band else []
        y = [*self.band[1:]] if self.band else []
        for own in (*((a, b) for a, b, _ in self.lines), *([self.points] if self.points else [])):
            x.append(own[0])
            y.append(own[1])
        y.append(np.array([height for height, _ in self.levels]))
        return _scale(x), _scale(y)


def xy_picture(plot: XYPlot, y_scale: Scale | None = None) -> Markup:
    """The plot for a page; `y_scale` is that of all panels where they share one."""
    x_scale, own = plot.scales()
    scale = y_scale or own
    picture = Picture(plot.title, _WIDTH, _HEIGHT)

    def px(x: Array, y: Array) -> Array:
        across = _LEFT + x_scale.share(x) * (_RIGHT - _LEFT)
        return np.column_stack([across, _FOOT - scale.share(y) * (_FOOT - _TOP)])

    for tick in scale.ticks(4):
        height = float(px(np.zeros(1), np.array([tick]))[0, 1])
        picture.line([(_LEFT, height), (_RIGHT, height)], SOFT if tick == 0 else RULE)
        picture.text(_LEFT - 5, height, plain(tick), "end", middle=True)
    picture.text(0, 12, plot.words[1], colour=SOFT)
    if plot.band is not None:
        x, low, high = (np.asarray(part) for part in plot.band)
        known = np.isfinite(low) & np.isfinite(high)
        corners = np.concatenate([px(x[known], low[known]), px(x[known], high[known])[::-1]])
        if len(corners):
            picture.outline(corners, BAND, "none")
    for level, dashed in plot.levels:
        ends = px(np.array([x_scale.low, x_scale.high]), np.full(2, level))
        picture.line(ends, INK, 1.2, "stroke-dasharray:5 4" if dashed else "")
    for x, y, colour in plot.lines:
        picture.line(px(x, y), colour, 2.0)
    if plot.points is not None:
        where = px(*plot.points)
        picture.dots(where[:, 0], where[:, 1], plot.colour, 8.0)
    for start, end in plot.marked:
        ends = px(np.array([start, end]), np.full(2, scale.low))
        picture.line(ends - (0.0, 3.0), INK, 5.0)
    picture.number_axis(x_scale, (_LEFT, _RIGHT), _FOOT, _FOOT, plot.words[0])
    return picture.markup()


def shared_scale(plots: Sequence[XYPlot]) -> Scale:
    """One vertical scale for all."""
    own = [plot.scales()[1] for plot in plots]
    return Scale(min(scale.low for scale in own), max(scale.high for scale in own))


def _scale(values: Sequence[Array]) -> Scale:
    known = np.concatenate([np.ravel(part) for part in values]) if values else np.zeros(0)
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    pad = _PAD * (high - low) or 1.0
    return Scale(low - pad, high + pad)
