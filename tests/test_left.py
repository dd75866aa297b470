"""What left the program is refused by its name, with what to take instead."""

from __future__ import annotations

import pytest

from shukotsu.__main__ import main
from shukotsu.left import LEFT, instead


def test_a_name_that_left_has_a_sentence_and_another_one_none() -> None:
    """The name, since when, and what to take."""
    assert instead("command", "devices") == "devices left in 0.2: take record --devices"
    assert instead("command", "device") == ""


@pytest.mark.parametrize("command", [name for kind, name in LEFT if kind == "command"])
def test_a_command_that_left_says_what_to_take(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, and the exit code of bad input."""
    assert main([command, "--help"]) == 2
    assert capsys.readouterr().err == f"error: {instead('command', command)}\n"
