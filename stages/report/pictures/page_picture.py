"""A matplotlib figure as SVG inside a page: small, in the page's font, in the colours of its theme.

One unit of a page picture is one CSS pixel. Matplotlib's identifiers are dropped except those that something
refers to, which become the picture's own; `marked` gives an artist a CSS class and a text that a pointer
shows.
"""

from __future__ import annotations

import hashlib
import io
import re
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree import ElementTree

from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.figure import Figure, FigureBase

from stages.report.palette import INK, as_custom_property
from stages.report.pictures.style import applied

TEXT_PX = 11.0

_PAGE_STYLE: dict[str, Any] = {
    "font.size": TEXT_PX,
    "axes.labelsize": TEXT_PX,
    "axes.titlesize": TEXT_PX,
    "xtick.labelsize": TEXT_PX,
    "ytick.labelsize": TEXT_PX,
    "legend.fontsize": TEXT_PX,
    "axes.linewidth": 1.0,
    "grid.linewidth": 1.0,
    "lines.linewidth": 1.1,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}

_SVG = "{http://www.w3.org/2000/svg}"
_XLINK = "{http://www.w3.org/1999/xlink}"
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_NUMBER = re.compile(r"-?\d+\.\d+")
_DOT = re.compile(r"M([^ML]+)L\1(?=M|$)")
_NO_TURN = re.compile(r"rotate\(-?0 [^)]*\)")
_DEFAULTS = {
    "stroke-linejoin:miter",
    "stroke-linecap:square",
    "opacity:1",
    "text-anchor:start",
    f"font-size:{TEXT_PX:g}px",
}
"""Styles that page.css gives every picture, or that change nothing to be seen."""


@contextmanager
def page_style() -> Iterator[None]:
    """Draw and save in the pages' style."""
    with applied(_PAGE_STYLE):
        yield


def page_figure(width_px: float, height_px: float) -> Figure:
    """An empty figure of that size; what is drawn in it is placed by hand."""
    return Figure(figsize=(width_px / 72, height_px / 72), dpi=72)


def marked(artist: Artist, css_class: str, title: str = "") -> None:
    """Give an artist a CSS class and, where it is not empty, a text that a pointer shows."""
    artist.set_gid(f"{css_class}|{title}")


def inline_svg(figure: FigureBase, title: str) -> Markup:
    """The figure as an SVG element that scales with its place; `title` is its text alternative."""
    assert isinstance(figure, Figure)
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph", UserWarning)  # the browser has the fonts, not matplotlib
        figure.savefig(stream, format="svg", metadata={"Date": None})
    root = ElementTree.fromstring(stream.getvalue())
    width, height = (72 * size for size in figure.get_size_inches())
    svg = ElementTree.Element("svg", {"viewBox": f"0 0 {width:g} {height:g}", "role": "img"})
    ElementTree.SubElement(svg, "title").text = title
    referenced = sorted(_referenced(root))
    _copy_children(root, svg, referenced)
    text = ElementTree.tostring(svg, encoding="unicode").replace(" />", "/>")
    digest = hashlib.sha256(text.encode()).hexdigest()[:8]
    for index, name in enumerate(referenced):
        text = text.replace(name, f"p{digest}-{index}")
    return Markup(text)  # what matplotlib wrote, escaped by it and by ElementTree


def _referenced(root: ElementTree.Element) -> set[str]:
    """The identifiers that a clip or a repeated mark refers to."""
    found: set[str] = set()
    for element in root.iter():
        found.update(re.findall(r"url\(#([^)]*)\)", element.get("clip-path", "")))
        found.add(element.get(f"{_XLINK}href", "#").removeprefix("#"))
    return found - {""}


def _copy_children(
    source: ElementTree.Element, target: ElementTree.Element, referenced: Collection[str]
) -> None:
    for child in source:
        name = child.tag.removeprefix(_SVG)
        if name in ("metadata", "style") or (name == "path" and not child.get("d")):
            continue
        attributes = _attributes(child, referenced)
        if name == "path" and attributes.get("style") == "fill:none":
            continue
        if (name == "g" and not attributes) or not (len(child) or attributes):
            _copy_children(child, target, referenced)  # what only holds others is left out
            continue
        title = attributes.pop("data-title", "")
        copy = ElementTree.SubElement(target, name, attributes)
        copy.text = (child.text or "").strip() if name == "text" else None
        if title:
            ElementTree.SubElement(copy, "title").text = title
        _copy_children(child, copy, referenced)
        if name == "defs" and not len(copy):
            target.remove(copy)


def _attributes(element: ElementTree.Element, referenced: Collection[str]) -> dict[str, str]:
    kept: dict[str, str] = {}
    for name, value in element.attrib.items():
        if name == "id" and "|" in value:
            kept["class"], _, title = value.partition("|")
            if title:
                kept["data-title"] = title
        elif name == "id":
            if value in referenced:
                kept["id"] = value
        elif name == "style":
            if style := _style(value, of_text=element.tag == f"{_SVG}text"):
                kept["style"] = style
        elif name == "transform":
            if turned := _shorter(_NO_TURN.sub("", value).strip()):
                kept["transform"] = turned
        else:
            kept[name.removeprefix(_XLINK)] = _shorter(value) if name in ("d", "x", "y", "points") else value
    return kept


def _style(value: str, *, of_text: bool) -> str:
    text = _COLOUR.sub(lambda colour: as_custom_property(colour[0]), value)
    parts = [part.strip().replace(": ", ":") for part in text.split(";")]
    defaults = _DEFAULTS | {f"fill:{as_custom_property(INK)}"} if of_text else _DEFAULTS
    return ";".join(p for p in parts if p and p not in defaults and not p.startswith("font-family"))


def _shorter(path: str) -> str:
    """Places to a tenth of a pixel, in as few characters as they take."""
    text = _NUMBER.sub(lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), " ".join(path.split()))
    if path[:1] != "M":
        return text
    text = re.sub(r" ?([A-Za-z]) ?", r"\1", text.replace("-0 ", "0 ")).replace(" -", "-")
    return _DOT.sub(r"M\1h0", text)
