"""A still picture inside a page: SVG in CSS pixels, y downward, in the page's font and its theme's colours.

Colours are the palette's light values; each becomes the custom property of its hue. Every picture says in
words what it shows, and refers to nothing outside itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape

from stages.report.palette import INK, MARK_PATHS, MARK_PX, RULE, SOFT, as_custom_property
from stages.report.pictures.scale import Scale, plain

Array = npt.NDArray[np.float64]

TEXT_PX = 11.0
"""As page.css sets the text of pictures."""

_MIDDLE_PX = 0.35 * TEXT_PX
"""From the middle of a line of text down to its baseline."""


class Picture:
    """A picture that shapes are added to; what comes later lies on top."""

    def __init__(self, title: str, width: float, height: float, role: str = "img") -> None:
        """An empty picture; `title` is its text alternative. role : group, of one with links in it."""
        self._parts = [
            f'<svg viewBox="0 0 {_px(width)} {_px(height)}" role="{role}"><title>{escape(title)}</title>'
        ]

    def markup(self) -> Markup:
        """The picture as an element of a page."""
        return Markup("".join([*self._parts, "</svg>"]))  # texts were escaped when they were added

    @contextmanager
    def group(self, css_class: str, title: str = "") -> Iterator[None]:
        """What is added inside has a CSS class and, unless empty, a text that a pointer shows."""
        words = f"<title>{escape(title)}</title>" if title else ""
        self._parts.append(f'<g class="{css_class}">{words}')
        yield
        self._parts.append("</g>")

    @contextmanager
    def link(self, href: str, words: str) -> Iterator[None]:
        """What is added inside leads to `href`; `words` say what it is, also where a pointer rests."""
        self._parts.append(
            f'<a href="{escape(href)}" aria-label="{escape(words)}"><title>{escape(words)}</title>'
        )
        yield
        self._parts.append("</a>")

    @contextmanager
    def window(self, left: float, top: float, width: float, height: float) -> Iterator[None]:
        """What is added inside is seen in this rectangle alone; an inner picture clips by itself."""
        places = " ".join(map(_px, (left, top, width, height)))
        size = f'x="{_px(left)}" y="{_px(top)}" width="{_px(width)}" height="{_px(height)}"'
        self._parts.append(f'<svg {size} viewBox="{places}">')
        yield
        self._parts.append("</svg>")

    def line(self, points: npt.ArrayLike, colour: str, width: float = 1.0, css: str = "") -> None:
        """A line through points (n, 2), broken where one is NaN. css : more of its style."""
        path, pen = [], "M"
        for x, y in np.asarray(points, float).tolist():
            broken = math.isnan(x) or math.isnan(y)
            path.append("" if broken else f"{pen}{_px(x)} {_px(y)}")
            pen = "M" if broken else "L"
        self._path("".join(path), "none", colour, width, css)

    def dots(self, x: Array, y: Array, colour: str, diameter: float) -> None:
        """Translucent round dots at x, y (n,), as one path: lines of no length with round ends."""
        path = "".join(f"M{_px(a)} {_px(b)}h0" for a, b in zip(x, y, strict=True))
        self._path(path, "none", colour, diameter, "stroke-linecap:round;opacity:.75")

    def marks(
        self, points: Array, shape: str, size: float, face: str, edge: str = "none", edge_px: float = 1.0
    ) -> None:
        """A marker of the palette at each of the points (n, 2), all alike; size is its width."""
        times = size / MARK_PX
        style = _style(face, edge, edge_px / times)
        for x, y in points[np.isfinite(points).all(-1)].tolist():
            place = f"translate({_px(x)} {_px(y)})" + (f" scale({times:.3g})" if times != 1 else "")
            self._parts.append(f'<path transform="{place}" d="{MARK_PATHS[shape]}" style="{style}"/>')

    def outline(self, corners: npt.ArrayLike, face: str, edge: str, width: float = 1.0) -> None:
        """A closed shape with these corners (n, 2)."""
        path = "L".join(f"{_px(a)} {_px(b)}" for a, b in np.asarray(corners).tolist())
        self._path(f"M{path}Z", face, edge, width)

    def text(
        self, x: float, y: float, words: str, anchor: str = "start", colour: str = INK, *,
        middle: bool = False, bold: bool = False, css_class: str = "",
    ) -> None:  # fmt: skip
        """Words at x; y is their baseline, or with `middle` the middle of the line. anchor : as SVG's."""
        style = "" if colour == INK else f"fill:{as_custom_property(colour)};"
        style += "font-weight:bold;" if bold else ""
        attributes = f' class="{css_class}"' if css_class else ""
        attributes += f' text-anchor="{anchor}"' if anchor != "start" else ""
        attributes += f' style="{style}"' if style else ""
        down = y + _MIDDLE_PX if middle else y
        self._parts.append(f'<text x="{_px(x)}" y="{_px(down)}"{attributes}>{escape(words)}</text>')

    def number_axis(
        self, scale: Scale, ends: tuple[float, float], top: float, foot: float, unit: str
    ) -> None:
        """A horizontal axis from ends[0] to ends[1] at `foot`, its grid up to `top`, its unit below it."""
        for tick in scale.ticks():
            x = ends[0] + float(scale.share(tick)) * (ends[1] - ends[0])
            self.line([(x, top), (x, foot)], RULE)
            self.text(x, foot + 14, plain(tick), "middle")
        self.text(sum(ends) / 2, foot + 29, unit, "middle", SOFT)

    def _path(self, path: str, face: str, edge: str, width: float, css: str = "") -> None:
        self._parts.append(f'<path d="{path}" style="{_style(face, edge, width)}{css and ";" + css}"/>')


def _style(face: str, edge: str, width: float) -> str:
    style = f"fill:{as_custom_property(face)}"
    if edge == "none":
        return style
    style += f";stroke:{as_custom_property(edge)}"
    return style if width == 1.0 else f"{style};stroke-width:{width:.3g}"


def _px(value: float) -> str:
    """To a tenth of a pixel, in as few characters as it takes."""
    text = f"{value:.1f}"
    return "0" if text == "-0.0" else text.removesuffix(".0")
