"""What the user may ask for, and what is refused in a sentence."""

import pytest

from schemas.errors import InputError
from stages.capture.record import wishes


def test_lists_have_names() -> None:
    assert wishes.parse_items("full", "binary") == (8, 9, 11, 10, 12, 3, 7)
    assert wishes.parse_items("short", "binary") == (9, 2, 7)
    assert wishes.parse_items("9,2,7", "binary") == (9, 2, 7)
    assert wishes.parse_items("full", "binary", "fastrak") == (2, 11, 16, 1)


def test_text_has_blanks_behind_numbers_and_a_line_end() -> None:
    assert wishes.parse_items("full", "ascii") == (8, 0, 9, 0, 11, 0, 10, 0, 12, 0, 3, 7, 1)
    assert wishes.parse_items("8,2,4,1", "ascii") == (8, 0, 2, 4, 1)
    assert wishes.parse_items("2,9", "ascii") == (2, 9, 1)


def test_a_fastrak_record_ends_with_what_never_changes() -> None:
    assert wishes.parse_items("2,11", "binary", "fastrak") == (2, 11, 0)
    assert wishes.parse_items("2,11,1", "binary", "fastrak") == (2, 11, 1)
    assert wishes.parse_items("2,11,0", "ascii", "fastrak") == (2, 11, 0, 1)


@pytest.mark.parametrize(
    ("text", "mode", "family", "sentence"),
    [
        ("all", "binary", "liberty", "--items: is 'all'; expected full, short or numbers such as 9,2,7"),
        ("9,2,13", "binary", "liberty", "--items: 13 is no item"),
        ("2,7,8", "binary", "liberty", None),
        ("2,11,9", "binary", "patriot", None),
        ("2,11", "binary", "fastrak", None),
        (
            "2,7",
            "binary",
            "liberty",
            "--items: 2,7 has neither the frame count (9) nor the timestamp (8), so a lost frame could not "
            "be seen; add 9",
        ),
        ("3,7,10", "ascii", "patriot", "--items: 3,7,10 has neither the frame count (9)"),
        ("9,7", "binary", "liberty", "--items: 9,7 has no position"),
        ("9,11", "binary", "fastrak", "--items: 9 is no item"),
        ("11", "binary", "fastrak", "--items: 11 has no position"),
        ("2,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9", "binary", "liberty", "has 21 items"),
        ("short", "binary", "viper", "--items: a viper has no output lists"),
    ],
)
def test_lists_that_cannot_be(text: str, mode: str, family: str, sentence: str | None) -> None:
    if sentence is None:
        assert 2 in wishes.parse_items(text, mode, family)
        return
    with pytest.raises(InputError) as told:
        wishes.parse_items(text, mode, family)
    assert sentence in str(told.value)


def test_stations() -> None:
    assert wishes.parse_stations("1-3,7") == (1, 2, 3, 7)
    assert wishes.parse_stations("16") == (16,)
    for text in ("0-3", "17", "a", "3-1", ""):
        with pytest.raises(InputError, match="--stations: is "):
            wishes.parse_stations(text)


def test_hemisphere() -> None:
    assert wishes.parse_hemisphere("0,0,-1") == (0.0, 0.0, -1.0)
    assert wishes.parse_hemisphere("track") == wishes.TRACK
    for text in ("1,0", "x", "0,0,0", "nan,0,0"):
        with pytest.raises(InputError, match="--hemisphere: "):
            wishes.parse_hemisphere(text)
