"""Turn a panel into SVG inside a page: in the page's font and its theme's colours, small, with its title.

Colours are the palette's light values; each becomes the custom property of its hue.
"""

from __future__ import annotations

import io
import re
import traceback
import warnings
from xml.etree import ElementTree

from markupsafe import Markup
from matplotlib.lines import Line2D

from shukotsu.errors import on_one_line
from shukotsu.sentences.messages import message_of, translated
from shukotsu.sentences.translation import tr
from shukotsu.stages.report.palette import as_custom_property
from shukotsu.stages.report.plots.panels import Panel, page_figure
from shukotsu.stages.report.plots.style import applied, rewrite, without_controls

_NUMBER = re.compile(r"-?\d+\.\d+")
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_REACH = "7"
_USUAL = ("fill:var(--ink)", "stroke-width:1", "text-anchor:start")


_UNDRAWN: list[str] = []


def taken_failures() -> list[str]:
    """Why pictures could not be drawn since this was last asked."""
    messages = [*_UNDRAWN]
    _UNDRAWN.clear()
    return messages


def page_picture(panel: Panel) -> Markup:
    """The picture as an element of a page, or the sentence why there is none; the same for the same panel."""
    try:
        return _svg(panel)
    except MemoryError:
        raise
    except Exception as error:  # a picture must not cost a study its page
        traceback.print_exc()
        text = on_one_line(f"{panel.title}: {type(error).__name__}: {error}")
        message = message_of("internal", stage="report", text=text)
        _UNDRAWN.append(message)
        return Markup("<p>{}</p>").format(tr("Not drawn: {reason}.", reason=translated(message)))


def _svg(panel: Panel) -> Markup:
    room = {"axes.labelpad": 5.0, "ytick.labelsize": 8.5}  # a page's letters are its browser's
    with applied({"svg.hashsalt": panel.title, **room}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # the browser has it
        figure = page_figure(panel)
        rewrite(figure, without_controls)
        marks = {str(line.get_gid()): line for line in figure.findobj(Line2D) if isinstance(line, Line2D)}
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    root = ElementTree.fromstring(drawn.getvalue())
    for element in root.iter():
        _shorten(element)
    linked = any(identifier.startswith("link") for identifier in marks)
    root.attrib = {"viewBox": root.attrib["viewBox"], "role": "group" if linked else "img"}
    title = ElementTree.Element("title")
    title.text = panel.title
    root[:] = [title, *(kept for child in root for kept in _tidied(child, marks))]
    return Markup(ElementTree.tostring(root, "unicode"))  # texts are escaped


def _shorten(element: ElementTree.Element) -> None:
    """Leave out namespaces, what the page's style says, and digits that no screen shows."""
    element.tag = element.tag.rpartition("}")[2]
    element.tail = None
    element.text = element.text if element.tag == "text" else None
    own = {
        name.rpartition("}")[2]: value if name == "id" else _NUMBER.sub(_rounded, " ".join(value.split()))
        for name, value in element.attrib.items()
    }
    if "d" in own:
        own["d"] = re.sub(r" ?([A-Za-z]) ?", r"\1", own["d"])
    if own.get("transform", "").startswith("rotate(0 "):
        del own["transform"]
    if "style" in own:
        own["style"] = _style(own["style"], is_text=element.tag == "text")
    element.attrib = {name: value for name, value in own.items() if value}


def _style(style: str, *, is_text: bool) -> str:
    kept = [each.strip().replace(": ", ":") for each in style.split(";")]
    kept = [_COLOUR.sub(lambda found: as_custom_property(found[0]), each) for each in kept]
    usual = _USUAL if is_text else _USUAL[1:]
    return ";".join(
        each for each in kept if each not in usual and not each.startswith(("font-size", "font-family"))
    )


def _rounded(found: re.Match[str]) -> str:
    text = f"{float(found[0]):.1f}"
    return "0" if text == "-0.0" else text.removesuffix(".0")


def _tidied(element: ElementTree.Element, marks: dict[str, Line2D]) -> list[ElementTree.Element]:
    """Give an element without groups that say nothing; marks say what a pointer is told."""
    if element.tag in ("metadata", "style"):
        return []
    own = element.get("id", "")
    element[:] = [kept for child in element for kept in _tidied(child, marks)]
    if element.tag == "g":
        if own.startswith("dots"):
            return [*element.iter("defs"), _as_paths(element, marks[own])]  # others may use its mark
        if own.startswith("link"):
            return [_as_link(element, *str(marks[own].get_label()).split("\n"))]
        if own.startswith("label"):
            for text in element:
                text.set("class", "label")
        return list(element)
    if element.tag == "defs" and not len(element):
        return []
    return [element]


def _as_paths(group: ElementTree.Element, line: Line2D) -> ElementTree.Element:
    """Give dots as lines of no length with round ends, a path a name, which a pointer is told."""
    dots, names = list(group.iter("use")), str(line.get_label()).split("\n")
    style = f"{dots[0].attrib['style'].replace('fill', 'stroke')};stroke-width:{line.get_markersize():g}"
    unnamed = names[0].startswith("_child")  # what matplotlib calls a line without a label
    made = ElementTree.Element("g", {"class": "dots", "style": style})
    places: dict[str, list[str]] = {}
    for dot, name in zip(dots, [""] * len(dots) if unnamed else names, strict=True):
        places.setdefault(name, []).append(f"M{dot.attrib['x']} {dot.attrib['y']}h0")
    for name, own in places.items():
        path = ElementTree.SubElement(made, "path", {"d": "".join(own)})
        if name:
            ElementTree.SubElement(path, "title").text = name
    return made


def _as_link(group: ElementTree.Element, href: str, words: str) -> ElementTree.Element:
    """Give a mark as a link, which says in words where it leads and feels a pointer from farther away."""
    link = ElementTree.Element("a", {"href": href, "aria-label": words})
    ElementTree.SubElement(link, "title").text = words
    (mark,) = group.iter("use")
    place = {"cx": mark.attrib["x"], "cy": mark.attrib["y"], "r": _REACH, "fill": "none"}
    ElementTree.SubElement(link, "circle", place)
    link.extend(group)
    return link
