"""The progress of a long command: a bar on terminals that is erased at the end, and nothing elsewhere."""

import io
import sys

import pytest

from shukotsu.tables.line_printer import LinePrinter, progress


def test_a_terminal_shows_a_bar_that_is_erased_at_the_end(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("recordings read", 4) as done:
        done(2)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress("recordings read", 4) as done:
        done(2)
    printed = capsys.readouterr().err
    assert f"\r[{'#' * 15}{' ' * 15}] 2 of 4 recordings read" in printed
    assert printed.endswith(f"\r{' ' * len('[] 2 of 4 recordings read')}{' ' * 30}\r")


def test_a_line_overwrites_the_previous_one_and_a_note_stays() -> None:
    out = io.StringIO()
    out.isatty = lambda: True  # type: ignore[method-assign]
    printer = LinePrinter(out)
    printer.show("240 Hz")
    printer.show("24 Hz")
    printer.say("note")
    assert out.getvalue() == f"\r240 Hz\r24 Hz \r{' ' * 5}\rnote\n"
    out.close()
    printer.say("a closed terminal is not an error")
