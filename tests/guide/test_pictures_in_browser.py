"""The guide's pictures as a browser draws them: words on the card, none over another, hands that move."""

from itertools import combinations
from pathlib import Path

import pytest
from browser import WatchedPage, chromium, watched

from guide.picture_words import LANGUAGES
from guide.pictures import PICTURES, file_name, write_pictures

pytestmark = pytest.mark.slow

BOXES = """() => [...document.querySelectorAll('text')].map(text => {
    const box = text.getBoundingClientRect();
    return [text.textContent, box.left, box.top, box.right, box.bottom]; })"""
CARD = (
    "() => { const box = document.documentElement.getBoundingClientRect(); return [box.right, box.bottom]; }"
)
MOVED = """at => { const svg = document.documentElement; svg.pauseAnimations(); svg.setCurrentTime(at);
    return [...document.querySelectorAll('path')].filter(path => path.firstElementChild)
        .map(path => { const box = path.getBBox(); return [box.x, box.y, box.width, box.height]; }); }"""


@pytest.fixture(scope="session")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    write_pictures(folder)
    return folder


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", PICTURES)
def test_words_are_on_the_card_and_not_over_each_other(
    name: str, language: str, pictures: Path, watched_page: WatchedPage
) -> None:
    watched_page.open(pictures / file_name(name, language))
    width, height = watched_page.value(CARD)
    boxes = watched_page.value(BOXES)
    for words, left, top, right, bottom in boxes:
        assert left > 3, words
        assert top > 3, words
        assert right < width - 3, words
        assert bottom < height - 1, words
    for one, other in combinations(boxes, 2):
        across = min(one[3], other[3]) - max(one[1], other[1])
        along = min(one[4], other[4]) - max(one[2], other[2])
        assert across < 1 or along < 4, (one[0], other[0])  # boxes of lines are higher than letters


@pytest.mark.parametrize("name", [name for name in PICTURES if name not in ("movement-flat",)])
def test_a_moving_picture_moves(name: str, pictures: Path, watched_page: WatchedPage) -> None:
    watched_page.open(pictures / file_name(name, "en"))
    start, later = watched_page.value(MOVED, 0.0), watched_page.value(MOVED, 0.9)
    assert (start != later) == (name.startswith("movement-") or name == "rigid-pair")


@pytest.mark.usefixtures("browser")
@pytest.mark.parametrize(("options", "moves"), [((), True), (("--force-prefers-reduced-motion",), False)])
@pytest.mark.parametrize("name", ["movement-fist", "rigid-pair"])
def test_it_stands_still_for_who_asks_for_less_movement(
    name: str, options: tuple[str, ...], moves: bool, pictures: Path
) -> None:
    """As a page of the guide shows it, in an <img>; to that Playwright's own emulation does not reach."""
    page, picture = pictures / f"{name}.html", pictures / file_name(name, "en")
    page.write_text(f'<img src="{picture.name}" alt="">', "utf-8")
    shots = set()
    with chromium(*options) as started, watched(started) as own:
        own.opened.add(picture.as_uri())
        own.open(page)
        for _ in range(4):
            shots.add(own.page.screenshot())
            own.page.wait_for_timeout(400)
    assert (len(shots) > 1) == moves
