"""The guide's pictures: drawn alike each time, well formed, small, in words too, in both languages."""

import re
from functools import cache
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from guide.picture_words import LABELS, LANGUAGES, label
from guide.pictures import PICTURES, file_name, main
from guide.receiver_pictures import LAYOUT
from schemas.layout import read_layout

SVG = "{http://www.w3.org/2000/svg}"
JAPANESE = re.compile(r"[\u3040-\u30ff\u4e00-\u9fff]")
SAID_ALIKE = {"about-30", "as-specified"}
MOST_BYTES = 130_000
ALL = [(name, language) for name in PICTURES for language in LANGUAGES]


@cache
def drawn(name: str, language: str) -> ElementTree.Element:
    return ElementTree.fromstring(PICTURES[name](language))


def words(name: str, language: str) -> list[str]:
    return [element.text or "" for element in drawn(name, language).iter(f"{SVG}text")]


@pytest.mark.parametrize(("name", "language"), ALL)
def test_a_picture_says_in_words_what_it_shows(name: str, language: str) -> None:
    root = drawn(name, language)
    title, description = root.findtext(f"{SVG}title"), root.findtext(f"{SVG}desc")
    assert root.get("lang") == language
    assert title
    assert description
    assert len(description) > len(title)
    assert bool(JAPANESE.search(title + description)) == (language == "ja")


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_drawn_alike_each_time_and_is_small(name: str) -> None:
    once, again = PICTURES[name]("en"), PICTURES[name]("en")
    assert once == again
    assert len(once.encode()) < MOST_BYTES
    assert not re.search(r"(?:href|src)=\"(?!#)|url\((?!#)|nan|inf", once)


@pytest.mark.parametrize(("name", "language"), ALL)
def test_a_picture_stands_on_a_card_of_its_own_and_keeps_its_words_on_it(name: str, language: str) -> None:
    root = drawn(name, language)
    width, height = map(float, root.attrib["viewBox"].split()[2:])
    card = root.find(f"{SVG}rect")
    assert card is not None
    assert float(card.attrib["width"]) == width - 2
    assert width <= 470  # a phone shows it at four fifths and more: 12 px stay legible
    for text in root.iter(f"{SVG}text"):
        assert 0 < float(text.attrib["x"]) < width
        assert 0 < float(text.attrib["y"]) < height


@pytest.mark.parametrize(("name", "language"), ALL)
def test_moving_outlines_keep_their_commands_and_begin_as_printed(name: str, language: str) -> None:
    """A browser goes from one outline to the next only where both have the same commands."""
    for path in drawn(name, language).iter(f"{SVG}path"):
        for moving in path.iter(f"{SVG}animate"):
            values, times = moving.attrib["values"].split(";"), moving.attrib["keyTimes"].split(";")
            assert len(values) == len(times)
            assert (times[0], times[-1]) == ("0", "1")
            assert values[0] == values[-1] == path.attrib["d"]
            assert len({re.sub(r"[-\d. ]+", "_", value) for value in values}) == 1
            assert moving.attrib["repeatCount"] == "indefinite"


@pytest.mark.parametrize("name", PICTURES)
def test_who_asks_for_less_movement_sees_the_first_frame(name: str) -> None:
    """Each moving outline has a still one beside it, and a style shows one of the two."""
    text = PICTURES[name]("en")
    assert ".still{display:none}@media (prefers-reduced-motion:reduce){" in text
    for parent in drawn(name, "en").iter():
        for before, path in pairwise([None, *parent]):
            if path.find(f"{SVG}animate") is not None:
                assert before is not None
                assert before.attrib == {"class": "still", "d": path.get("d")}
                assert path.get("class") == "moving"


def test_ids_differ_between_pictures_of_one_page() -> None:
    ids = [one for name in PICTURES for element in drawn(name, "en").iter() if (one := element.get("id"))]
    assert len(ids) == len(set(ids)) > 0


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_receiver_of_the_layout_stands_in_its_picture(language: str) -> None:
    layout = read_layout(LAYOUT)
    worn = {name: one.receiver for name, one in layout.segments.items() if one.receiver and not one.optional}
    shown = words("receivers", language)
    assert len(worn) == 16
    assert sorted(int(word) for word in shown if word.isdigit()) == sorted([*worn.values()] * 2)
    assert sorted(word for word in shown if word in layout.segments) == sorted(worn)
    assert [word for word in shown if word in "xyz"] == ["x", "y", "z"]


def test_words_are_there_in_both_languages() -> None:
    assert all(len(both) == len(LANGUAGES) and all(both) for both in LABELS.values())
    same = {key for key, (english, japanese) in LABELS.items() if english == japanese}
    assert same == SAID_ALIKE
    assert [key for key in LABELS if key not in SAID_ALIKE and not JAPANESE.search(label(key, "ja"))] == []


def test_no_word_is_kept_that_no_picture_says() -> None:
    said = {text for name, language in ALL for text in drawn(name, language).itertext()}
    unsaid = {key for key, both in LABELS.items() if not said & set(both)}
    assert unsaid == set()


def test_the_command_writes_every_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "pictures")]) == 0
    assert "pictures in" in capsys.readouterr().out
    written = {path.name: path.read_text("utf-8") for path in (tmp_path / "pictures").iterdir()}
    assert written == {file_name(name, language): PICTURES[name](language) for name, language in ALL}


def test_the_command_writes_one_language(tmp_path: Path) -> None:
    assert main([str(tmp_path), "--language", "ja"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.ja.svg" for name in PICTURES}


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main([str(tmp_path / "file" / "pictures")]) == 2
    assert "cannot be written" in capsys.readouterr().err
