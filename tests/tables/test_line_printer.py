"""The progress of a long command: a bar on a terminal that is gone afterwards, silence elsewhere."""

import sys

import pytest

from shukotsu.tables.line_printer import progress


def test_a_terminal_sees_a_bar_and_afterwards_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress("recordings read", 4) as done:
        done(2)
    said = capsys.readouterr().err
    assert f"\r[{'#' * 15}{' ' * 15}] 2 of 4 recordings read" in said
    assert said.endswith(f"\r{' ' * len('[] 2 of 4 recordings read')}{' ' * 30}\r")


def test_a_pipe_sees_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("recordings read", 4) as done:
        done(2)
    assert capsys.readouterr().err == ""
