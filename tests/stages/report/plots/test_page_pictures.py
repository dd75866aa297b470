"""Pictures inside a page: text and names are text, colours follow the theme, nothing refers elsewhere."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np

from shukotsu.stages.report.palette import DIGITS, MARKERS, MODELS, RULE, Look
from shukotsu.stages.report.plots.description import Band, CurvesPanel, Group, Line, Row, RowsPanel, Scale
from shukotsu.stages.report.plots.page_pictures import page_picture

HOSTILE = '</text><script> a "name" & <more> \x07'


def curves(title: str = "A picture <of> nothing") -> str:
    x, y = np.arange(4.0), np.array([0.0, np.nan, 2.0, 1.0])
    line, band = Line(x, y, DIGITS[1]), Band(x, y - 1, y + 1, RULE)
    scale = Scale(0.0, 3.0)
    return page_picture(CurvesPanel("", title, "x", HOSTILE, scale, scale, 30.0, (line,), (band,)))


def rows(names: list[str]) -> str:
    own = tuple(
        Row(name, Look(MODELS[0], marker), {name: 1.0, "a & b": 2.0})
        for name, marker in zip(names, MARKERS, strict=False)
    )
    return page_picture(RowsPanel("", "t", "mm", Scale(0.0, 3.0), (Group("", own),), of_all=3))


def test_text_and_names_are_text() -> None:
    root = ElementTree.fromstring(curves())
    assert root.findtext("title") == "A picture <of> nothing"
    assert HOSTILE.replace("\x07", "\\x07") in [text.text for text in root.iter("text")]
    dots = [
        group for group in ElementTree.fromstring(rows(["<b>"])).iter("g") if group.get("class") == "dots"
    ]
    assert {path.findtext("title") for path in dots[0].iter("path")} == {"<b>", "a & b"}


def test_colours_are_the_themes_and_nothing_is_referred_to() -> None:
    picture = curves() + rows(["one", "two"])
    assert "var(--blue)" in picture
    assert "var(--umber)" in picture
    assert not re.search(r"#[0-9a-f]{6}\b(?!\")|font-family|<style|https?:|nan", picture)
    identifiers = re.findall(r' id="([^"]*)"', picture)
    assert set(re.findall(r'href="#([^"]*)"|url\(#([^)]*)\)', picture)) <= {
        pair for name in identifiers for pair in ((name, ""), ("", name))
    }


def test_pictures_of_a_page_share_no_identifier() -> None:
    one, other = (set(re.findall(r' id="([^"]*)"', curves(title))) for title in ("one", "other"))
    assert one
    assert not one & other


def test_every_marker_looks_different_and_lines_break_at_gaps() -> None:
    shapes = re.findall(r'<path id="[^"]*" d="([^"]*)', rows([f"m{index}" for index in range(len(MARKERS))]))
    assert len(set(shapes)) == len(shapes) == len(MARKERS)
    line = next(path for path in re.findall("<path[^>]*", curves()) if "var(--blue)" in path)
    assert line.count("M") == 2
