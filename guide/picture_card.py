"""A picture that stands alone: SVG on a light card of its own, readable on any page, still or moving."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from xml.sax.saxutils import escape, quoteattr

from guide.views import number

INK, SOFT, CARD, EDGE = "#22303c", "#5b6873", "#fbfaf6", "#dcd8cc"
SKIN, SKIN_LINE, NAIL = "#efc9ae", "#9c6a4f", "#f8e0d3"
BONE, JOINT, ACCENT = "#fffdf6", "#2b6f8f", "#d9480f"
RECEIVER, CABLE, GOOD, BAD, METAL = "#2f3e4c", "#8894a0", "#2b7a4b", "#b3261e", "#8a94a0"
X_AXIS, Y_AXIS, Z_AXIS = "#c2410c", "#2b7a4b", "#1d5fa8"

_FONT = '"Noto Sans", "Segoe UI", "Helvetica Neue", Arial, sans-serif'
_FONT_JA = '"Noto Sans CJK JP", "IPAexGothic", sans-serif'
TEXT_PX = 14.0

_STILL = (
    ".still{display:none}@media (prefers-reduced-motion:reduce){.still{display:inline}.moving{display:none}}"
)
"""SMIL asks nobody whether movement is wanted: beside each moving outline is a still one."""

_STRAIGHT_PX = 1.0
"""By which a moving outline may be off, where it saves a frame."""

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


class Drawing:
    """Shapes added one over the other; y downward, px of a page 420 wide or so."""

    def __init__(
        self,
        name: str,
        title: str,
        description: str,
        width: float,
        height: float,
        language: str,
        enlarged: float = 1.0,
    ) -> None:
        """An empty card; `title` and `description` say in words what it shows. name : the file's.

        enlarged : how much larger a page shows it where nothing else is asked for.
        """
        font = _FONT_JA if language == "ja" else _FONT
        size = f"{number(width)} {number(height)}"
        self._prefix, self._names = f"{name}-", 0
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" '
            f'width="{number(width * enlarged)}" height="{number(height * enlarged)}" '
            f'role="img" lang={quoteattr(language)}>',
            f"<title>{escape(title)}</title>",
            f"<desc>{escape(description)}</desc>",
            f"<style>text{{font:{number(TEXT_PX)}px {font};fill:{INK}}}"
            f"path,line,polyline{{stroke-linecap:round;stroke-linejoin:round}}"
            f".h{{font-weight:600}}.s{{font-size:12.5px;fill:{SOFT}}}.m{{font-size:12px}}{_STILL}</style>",
            f'<rect x="1" y="1" width="{number(width - 2)}" height="{number(height - 2)}" rx="14" '
            f'fill="{CARD}" stroke="{EDGE}" stroke-width="1.5"/>',
            f'<clipPath id="{name}-card"><rect x="2" y="2" width="{number(width - 4)}" '
            f'height="{number(height - 4)}" rx="13"/></clipPath>',
        ]

    def svg(self) -> str:
        """The file's text."""
        return "\n".join([*self._parts, "</svg>", ""])

    @contextmanager
    def clipped(self) -> Iterator[None]:
        """What is added inside ends at the card's edge."""
        with self.group(f'clip-path="url(#{self._prefix}card)"'):
            yield

    @contextmanager
    def group(self, attributes: str = "") -> Iterator[None]:
        """What is added inside has SVG attributes in common."""
        self._parts.append(f"<g {attributes}>".replace(" >", ">"))
        yield
        self._parts.append("</g>")

    def path(self, frames: Sequence[str], attributes: str, seconds: float = 0.0) -> None:
        """Path data of every frame of a loop; one frame, or all the same, stand still.

        Who asks for less movement sees the first frame.
        """
        if len(set(frames)) == 1:
            self._parts.append(f'<path d="{frames[0]}" {attributes}/>')
            return
        times, values = _changes([*frames, frames[0]])
        with self.group(attributes):
            self._parts.append(
                f'<path class="still" d="{frames[0]}"/><path class="moving" d="{frames[0]}">'
                f'<animate attributeName="d" dur="{number(seconds)}s" repeatCount="indefinite" '
                f'keyTimes="{";".join(times)}" values="{";".join(values)}"/></path>'
            )

    def dots(self, frames: Sequence[str], size: float, colour: str, seconds: float) -> None:
        """Discs with a bright edge, where path data of points have them."""
        self._names += 1
        name = f"{self._prefix}{self._names}"
        with self.group(f'fill="none" stroke="{colour}" stroke-width="{number(size)}"'):
            # the copy below takes the edge's look, since the path has none of its own
            self._parts.append(f'<use href="#{name}" stroke="{CARD}" stroke-width="{number(size + 2.0)}"/>')
            self.path(frames, f'id="{name}"', seconds)

    def line(self, points: Sequence[tuple[float, float]], colour: str, width: float, more: str = "") -> None:
        """Straight from point to point."""
        places = " ".join(f"{number(x)},{number(y)}" for x, y in points)
        self._parts.append(
            f'<polyline points="{places}" fill="none" stroke="{colour}" '
            f'stroke-width="{number(width)}" {more}/>'
        )

    def circle(self, x: float, y: float, radius: float, attributes: str) -> None:
        """A disc or a ring."""
        self._parts.append(f'<circle cx="{number(x)}" cy="{number(y)}" r="{number(radius)}" {attributes}/>')

    def rectangle(self, x: float, y: float, width: float, height: float, attributes: str) -> None:
        """Upright, from its upper left corner."""
        self._parts.append(
            f'<rect x="{number(x)}" y="{number(y)}" width="{number(width)}" '
            f'height="{number(height)}" {attributes}/>'
        )

    def text(
        self, x: float, y: float, words: str, anchor: str = "start", css: str = "", more: str = ""
    ) -> None:
        """Words on a baseline. css : `h` for a heading, `s` for small and soft, `m` for small."""
        kind = f' class="{css}"' if css else ""
        at = "" if anchor == "start" else f' text-anchor="{anchor}"'
        self._parts.append(
            f'<text x="{number(x)}" y="{number(y)}"{at}{kind} {more}>{escape(words)}</text>'.replace(
                " >", ">"
            )
        )

    def badge(self, x: float, y: float, words: str, colour: str = ACCENT) -> None:
        """A number on a disc."""
        self.circle(x, y, 9.5, f'fill="{colour}" stroke="{CARD}" stroke-width="1.5"')
        self.text(x, y + 4.2, words, "middle", "m h", f'style="fill:{CARD}"')

    def arrow(
        self, start: tuple[float, float], end: tuple[float, float], colour: str, width: float = 2.4
    ) -> None:
        """A line with a head at its end."""
        dx, dy = end[0] - start[0], end[1] - start[1]
        length = max((dx * dx + dy * dy) ** 0.5, 1e-6)
        ux, uy, head = dx / length, dy / length, 4.0 + 1.6 * width
        neck = (end[0] - 0.8 * head * ux, end[1] - 0.8 * head * uy)
        self.line([start, neck], colour, width)
        wing = 0.42 * head
        corners = [
            end,
            (end[0] - head * ux - wing * uy, end[1] - head * uy + wing * ux),
            (end[0] - head * ux + wing * uy, end[1] - head * uy - wing * ux),
        ]
        self.path(["M" + "L".join(f"{number(x)} {number(y)}" for x, y in corners) + "Z"], f'fill="{colour}"')

    def fade(self, x: float, y: float, width: float, height: float, *, upward: bool = False) -> None:
        """Let what is under a rectangle pass into the card, downward."""
        self._names += 1
        name = f"{self._prefix}{self._names}"
        ends = ("y1='1' y2='0'" if upward else "y1='0' y2='1'").replace("'", '"')
        self._parts.append(
            f'<linearGradient id="{name}" x1="0" x2="0" {ends}><stop stop-color="{CARD}" stop-opacity="0"/>'
            f'<stop offset=".75" stop-color="{CARD}"/></linearGradient>'
        )
        self.rectangle(x, y, width, height, f'fill="url(#{name})"')

    def tick(self, x: float, y: float, *, right: bool) -> None:
        """A mark for right or wrong, in a disc."""
        self.circle(x, y, 11, f'fill="{GOOD if right else BAD}"')
        data = f"M{x - 5} {y}l3.6 4l6.4-8" if right else f"M{x - 4.2} {y - 4.2}l8.4 8.4m0-8.4l-8.4 8.4"
        self.path([data], f'fill="none" stroke="{CARD}" stroke-width="2.6"')


def _changes(values: Sequence[str]) -> tuple[list[str], list[str]]:
    """Times from 0 to 1 and values between which nothing is more than _STRAIGHT_PX off a straight way."""
    numbers = [[float(number) for number in _NUMBER.findall(value)] for value in values]
    last = len(values) - 1
    kept = sorted({0, last} | _bends(numbers, 0, last))
    return [f"{i / last:.4f}".rstrip("0").rstrip(".") for i in kept], [values[i] for i in kept]


def _bends(numbers: Sequence[Sequence[float]], first: int, last: int) -> set[int]:
    """Frames between two others that are needed (Ramer-Douglas-Peucker over time)."""
    worst, place = _STRAIGHT_PX, 0
    for i in range(first + 1, last):
        share = (i - first) / (last - first)
        off = max(
            abs(here - a - share * (b - a))
            for here, a, b in zip(numbers[i], numbers[first], numbers[last], strict=True)
        )
        if off > worst:
            worst, place = off, i
    return {place} | _bends(numbers, first, place) | _bends(numbers, place, last) if place else set()
