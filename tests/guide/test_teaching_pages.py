"""Pages that teach: the pictures that they name are drawn, and all that are drawn are named."""

import re
from pathlib import Path

import pytest

from guide.picture_words import label
from guide.pictures import PICTURES, file_name

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ("put-on-receivers.md", "calibration-movements.md", "room-and-metal.md", "protocol.md")
MOST_WORDS = 500


def text_of(page: str) -> str:
    return (DOCS / page).read_text("utf-8")


def test_pages_show_every_picture_that_is_drawn_and_no_other() -> None:
    shown = [
        name
        for page in DOCS.glob("*.md")
        for name in re.findall(r"\(pictures/(.*?)\)", page.read_text("utf-8"))
    ]
    english = {name for name in shown if not name.endswith(".ja.svg")}
    assert english == {file_name(name, "en") for name in PICTURES}
    assert set(shown) - english <= {file_name(name, "ja") for name in PICTURES}


@pytest.mark.parametrize("page", PAGES[:-1])
def test_a_page_is_short(page: str) -> None:
    words = re.sub(r"!\[.*?\]\(.*?\)|```.*?```|\]\(.*?\)", " ", text_of(page), flags=re.DOTALL).split()
    assert len(words) < MOST_WORDS


def test_the_protocol_has_a_box_for_every_movement_of_the_page() -> None:
    protocol = text_of("protocol.md").lower()
    headings = re.findall(r"^### (.+)$", text_of("calibration-movements.md"), re.MULTILINE)
    assert len(headings) == 11
    for heading in headings:
        assert heading.lower().replace("thumb, joint by joint", "thumb mcp joint, then ip joint") in protocol


@pytest.mark.parametrize("name", [name for name in PICTURES if name.startswith("movement-")])
def test_a_movement_is_called_alike_on_page_and_picture(name: str) -> None:
    words = re.sub(r"[^a-z ]", "", label(name, "en").lower()).split()
    assert words[0] in text_of("calibration-movements.md").lower()
