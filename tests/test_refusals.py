"""A refusal is one short printable line; what left the program is refused by its name, with what to take."""

from __future__ import annotations

import pytest

from shukotsu.__main__ import main
from shukotsu.errors import MOST_LETTERS, InputError
from shukotsu.left import LEFT, instead


def test_whatever_a_sentence_quotes_it_is_one_short_printable_line() -> None:
    """It may be a line of a stranger's file, with codes for a terminal in it."""
    sentence = str(
        InputError("a.csv: is \x1b]0;x\x07\x9b31m\ud800\n\tb " + "x" * 5000 + "; expected a number")
    )
    assert len(sentence) <= MOST_LETTERS
    assert sentence.isprintable()
    assert sentence.startswith("a.csv: is ?]0;x??31m? b xxx")
    assert sentence.endswith("xxx; expected a number")


def test_a_name_that_left_has_a_sentence_and_another_one_none() -> None:
    assert instead("command", "devices") == "devices left in 0.2: take record --devices"
    assert instead("command", "device") == ""


@pytest.mark.parametrize("command", [name for kind, name in LEFT if kind == "command"])
def test_a_command_that_left_says_what_to_take(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 2
    assert capsys.readouterr().err == f"error: {instead('command', command)}\n"
