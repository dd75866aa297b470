"""Refusals read as a user can follow, and what says so of all others notices those that do not."""

import argparse

import pytest
import refusals
from refusal_places import places

from schemas.errors import MOST_LETTERS, InputError
from stages import command_line


@pytest.mark.parametrize(
    "sentence",
    [
        "a.csv: cannot be read (ValueError('x'))",
        "a.csv: 'utf-8' codec can't decode byte 0xff",
        "a.yaml: planes: None is not of type 'object'",
        "a.csv: is <class 'str'>; expected a number",
        "a.csv: cannot be opened ([Errno 13] Permission denied)",
        "a.csv: has dtype('float64'); expected text",
        "no " * MOST_LETTERS,
        "a.csv: \x1b[31mred text",
        "a.csv",
    ],
)
def test_what_a_user_cannot_follow_is_noticed(sentence: str) -> None:
    assert refusals.complaint(sentence)
    assert not refusals.complaint("a.csv: line 3, column x_mm: is 'a'; expected a number")


def test_every_sentence_is_recorded_with_its_place() -> None:
    arguments = argparse.Namespace(note="\udcff")
    assert command_line.run(arguments, lambda _: None) == 2
    ((file, line, sentence),) = refusals.here()
    assert file == "stages/command_line.py"
    assert "is not UTF-8 text" in sentence
    (place,) = [place for place in places() if (place.file, place.line) == (file, line)]
    assert place not in refusals.unreached({(file, line)})
    assert place in refusals.unreached(set())


def test_every_exception_is_of_a_place_that_there_is() -> None:
    known = {name for place in places() for name in (place.file, f"{place.file}: {place.pattern}")}
    assert refusals.UNREACHED.keys() <= known


def test_whatever_a_sentence_quotes_it_is_one_short_printable_line() -> None:
    """It may be a line of a stranger's file, with codes for a terminal in it."""
    said = str(InputError("a.csv: is \x1b]0;x\x07\x9b31m\ud800\n\tb " + "x" * 5000 + "; expected a number"))
    assert len(said) <= MOST_LETTERS
    assert said.isprintable()
    assert said.startswith("a.csv: is ?]0;x??31m? b xxx")
    assert said.endswith("xxx; expected a number")
