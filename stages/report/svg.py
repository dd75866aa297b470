"""Drawing SVG: elements with every name and value escaped, and labels that keep out of each other's way."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from markupsafe import Markup, escape


def element(name: str, *children: Markup | str, **attributes: str | float) -> Markup:
    """One SVG element.

    Attribute names: `class_` becomes class, other underscores become hyphens. Numbers are pixels, printed
    with one decimal at most.
    """
    parts = "".join([f' {_attribute(k)}="{_value(v)}"' for k, v in attributes.items()])
    inside = "".join([escape(child) for child in children])
    return Markup(f"<{name}{parts}>{inside}</{name}>")  # names are this program's, all else is escaped


def image(width: float, height: float, title: str, *children: Markup) -> Markup:
    """A drawing that scales with its place on the page; `title` says what it shows to who cannot see it."""
    return element("svg", element("title", title), *children, viewBox=f"0 0 {width:g} {height:g}", role="img")


def free_place(wanted: float, taken: Sequence[float], gap: float, lowest: float, highest: float) -> float:
    """The place (pixels) nearest to `wanted` within bounds that keeps a gap to all places taken."""
    steps = [0.0] + [sign * n * gap / 2 for n in range(1, 41) for sign in (1, -1)]
    places = [wanted + step for step in steps if lowest <= wanted + step <= highest]
    free = (place for place in places if all(abs(place - other) >= gap for other in taken))
    return next(free, min(max(wanted, lowest), highest))


@cache
def _attribute(name: str) -> str:
    return name.rstrip("_").replace("_", "-") if name != "viewBox" else name


def _value(value: str | float) -> str:
    return escape(value) if isinstance(value, str) else f"{value:.1f}".removesuffix(".0")
