"""Pictures inside a page: text and names are text, colours follow the theme, nothing refers elsewhere."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from stages.report.palette import DIGITS, HUES, INK
from stages.report.pictures.page_picture import inline_svg, marked, page_figure, page_style


def drawn(title: str = "A picture <of> nothing") -> str:
    with page_style():
        figure = page_figure(200, 100)
        axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
        axes.plot([0, 1, 2], [0, 2, 1], color=DIGITS[1], marker="o")
        marked(axes.text(1, 1, "</text><script>"), "label", 'a "name" & <more>')
        return str(inline_svg(figure, title))


def test_text_and_names_are_text() -> None:
    root = ElementTree.fromstring(drawn())
    assert root.findtext("title") == "A picture <of> nothing"
    assert "</text><script>" in [text.text for text in root.iter("text")]
    (label,) = [group for group in root.iter("g") if group.get("class") == "label"]
    assert label.findtext("title") == 'a "name" & <more>'


def test_colours_are_the_themes_and_text_the_pages() -> None:
    picture = drawn()
    assert "var(--blue)" in picture
    assert not re.search("#[0-9a-f]{6}", picture)
    assert not re.search("font-family|<style|<metadata", picture)


def test_the_same_picture_is_the_same_text_and_refers_to_itself_alone() -> None:
    first, other = drawn(), drawn("Another")
    assert first == drawn()
    ids = set(re.findall('id="([^"]*)"', first))
    assert ids == set(re.findall(r'(?:url\(#|href="#)([^")]*)', first))
    assert not ids & set(re.findall('id="([^"]*)"', other))


@pytest.mark.parametrize("name", ["山田", "$x_1$", r"\frac{1}", "é–Ω"])
def test_any_name_is_drawn_as_it_is(name: str, recwarn: pytest.WarningsRecorder) -> None:
    with page_style():
        figure = page_figure(100, 50)
        figure.text(0, 0.5, name, color=INK)
        picture = inline_svg(figure, name)
    assert f">{name}</text>" in picture
    assert not recwarn.list


def test_every_hue_is_one_colour() -> None:
    lights = [light for light, _ in HUES.values()]
    assert len(set(lights)) == len(lights)
