"""What the user may ask for, and what is refused in a sentence."""

import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.record import request


@pytest.mark.parametrize(
    ("text", "mode", "family", "items"),
    [
        ("full", "binary", "liberty", (8, 9, 11, 10, 12, 3, 7)),
        ("short", "binary", "liberty", (9, 2, 7)),
        ("9,2,7", "binary", "liberty", (9, 2, 7)),
        ("2,7,8", "binary", "liberty", (2, 7, 8)),
        ("2,11,9", "binary", "patriot", (2, 11, 9)),
        ("full", "ascii", "liberty", (8, 0, 9, 0, 11, 0, 10, 0, 12, 0, 3, 7, 1)),
        ("8,2,4,1", "ascii", "liberty", (8, 0, 2, 4, 1)),
        ("2,9", "ascii", "liberty", (2, 9, 1)),
        ("full", "binary", "fastrak", (2, 11, 16, 1)),
        ("2,11", "binary", "fastrak", (2, 11, 0)),
        ("2,11,1", "binary", "fastrak", (2, 11, 1)),
        ("2,11,0", "ascii", "fastrak", (2, 11, 0, 1)),
    ],
)
def test_lists_get_what_their_records_need_to_be_decoded(text: str, mode: str, family: str, items) -> None:
    assert request.parse_items(text, mode, family) == items


@pytest.mark.parametrize(
    ("text", "mode", "family", "sentence"),
    [
        ("all", "binary", "liberty", "--items: is 'all'; expected full, short or numbers such as 9,2,7"),
        ("9,2,13", "binary", "liberty", "--items: 13 is no item"),
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
def test_lists_that_cannot_be(text: str, mode: str, family: str, sentence: str) -> None:
    with pytest.raises(InputError) as told:
        request.parse_items(text, mode, family)
    assert sentence in str(told.value)


@pytest.mark.parametrize(
    ("family", "settings", "sentence"),
    [
        ("viper", {"stations": (1,)}, "--stations: a VIPER sends every sensor"),
        ("viper", {"mode": "ascii"}, "--ascii: a VIPER sends binary only"),
        ("trakstar", {"mode": "ascii"}, "--ascii: a trakSTAR sends binary only"),
        ("trakstar", {"hemisphere": (0.0, 0.0, 1.0)}, "set them with the trakSTAR's own program"),
        ("trakstar", {"no_filters": True}, "set them with the trakSTAR's own program"),
        ("fastrak", {"hemisphere": request.TRACK}, "a FASTRAK does not follow a receiver"),
        ("patriot", {"rate_hz": 120}, "--rate: a patriot has a rate of its own"),
    ],
)
def test_what_a_family_cannot_do_is_refused(family: str, settings, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        request.RecordingRequest(family, **settings)
