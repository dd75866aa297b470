"""Pages that teach: their pictures are there, say what they show, fetch nothing."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PICTURES = sorted((DOCS / "pictures").glob("*.svg"))
SVG = "{http://www.w3.org/2000/svg}"


def text_of(page: str) -> str:
    return (DOCS / page).read_text("utf-8")


def test_every_picture_is_on_a_page_and_every_page_has_its_pictures() -> None:
    """A page without a Japanese translation has Japanese pictures on the site all the same."""
    shown = {
        name for page in DOCS.glob("*.md") for name in re.findall(r"\(pictures/(.*?)\)", text_of(page.name))
    }
    there = {path.name for path in PICTURES}
    assert shown <= there
    assert {name.replace(".ja.svg", ".svg") for name in there} == {
        name for name in shown if not name.endswith(".ja.svg")
    }


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.name)
def test_a_picture_says_in_words_what_it_shows_and_is_whole_by_itself(picture: Path) -> None:
    text = picture.read_text("utf-8")
    root = ElementTree.fromstring(text)
    assert root.findtext(f"{SVG}title")
    assert root.findtext(f"{SVG}desc")
    assert root.get("lang") == ("ja" if picture.name.endswith(".ja.svg") else "en")
    assert not re.search(r"(?:href|src)=\"(?!#)|url\((?!#)|<script", text)


def test_the_protocol_has_a_box_for_every_movement_of_the_page() -> None:
    protocol = text_of("protocol.md").lower()
    headings = re.findall(r"^\| !.*\*\*(.+)\*\*", text_of("calibrate.md"), re.MULTILINE)
    assert len(headings) == 12
    for heading in headings:
        assert heading.lower().replace("thumb, joint by joint", "thumb mcp joint, then ip joint") in protocol
