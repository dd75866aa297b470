"""Pictures inside a page: text and names are text, colours follow the theme, nothing refers elsewhere."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from stages.report.palette import DIGITS, HUES, MARKERS
from stages.report.pictures.picture import Picture
from stages.report.pictures.scale import Scale


def drawn(title: str = "A picture <of> nothing") -> str:
    picture = Picture(title, 200, 100)
    picture.line([(0, 0), (1, np.nan), (1, 2), (2, 1)], DIGITS[1])
    for marker in MARKERS:
        picture.marks(np.array([[50.0, 50.0], [np.nan, 1.0]]), marker, 6.0, DIGITS[0])
    with picture.group("names", 'a "name" & <more>'):
        picture.text(1, 1, "</text><script>")
    return str(picture.markup())


def test_text_and_names_are_text() -> None:
    root = ElementTree.fromstring(drawn())
    assert root.findtext("title") == "A picture <of> nothing"
    assert "</text><script>" in [text.text for text in root.iter("text")]
    (group,) = [group for group in root.iter("g") if group.get("class") == "names"]
    assert group.findtext("title") == 'a "name" & <more>'


def test_colours_are_the_themes_and_nothing_is_referred_to() -> None:
    picture = drawn()
    assert "var(--blue)" in picture
    assert not re.search("#[0-9a-f]{6}|font-family|<style|id=|href|nan", picture)


def test_every_marker_looks_different_and_lines_break_at_gaps() -> None:
    picture = drawn()
    line, *marks = re.findall(r' d="([^"]*)', picture)
    assert line == "M0 0M1 2L2 1"
    assert len(set(marks)) == len(marks) == len(MARKERS)


@pytest.mark.parametrize("name", ["山田", "$x_1$", r"\frac{1}", "é–Ω"])
def test_any_name_is_drawn_as_it_is(name: str) -> None:
    picture = Picture(name, 100, 50)
    picture.text(0, 25, name)
    assert f">{name}</text>" in picture.markup()


@pytest.mark.parametrize(
    ("scale", "ticks"),
    [
        (Scale(-1.0, 9.3), [0, 2, 4, 6, 8]),
        (Scale(0.0, 0.5), [0, 0.1, 0.2, 0.3, 0.4, 0.5]),
        (Scale(1e-4, 2.0, "log"), [1e-4, 1e-3, 1e-2, 0.1, 1]),
        (Scale(0.8, 9.0, "log"), [1, 2, 5]),
        (Scale(-30.0, 200.0, "asinh", 2.0), [-30, -10, -3, 0, 3, 10, 30, 100]),
    ],
)
def test_ticks_are_round_numbers(scale: Scale, ticks: list[float]) -> None:
    assert scale.ticks() == pytest.approx(ticks)


def test_every_hue_is_one_colour() -> None:
    lights = [light for light, _ in HUES.values()]
    assert len(set(lights)) == len(lights)
