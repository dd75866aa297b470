"""The progress of a long command: a bar on a terminal that is gone afterwards, silence elsewhere."""

import io
import sys

import pytest

from shukotsu.tables.line_printer import LinePrinter, progress


def test_a_terminal_sees_a_bar_and_afterwards_none(
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


def test_a_line_is_written_over_the_one_before_and_one_that_stays_below() -> None:
    out = io.StringIO()
    out.isatty = lambda: True  # type: ignore[method-assign]
    printer = LinePrinter(out)
    printer.show("240 Hz")
    printer.show("24 Hz")
    printer.say("note")
    assert out.getvalue() == f"\r240 Hz\r24 Hz \r{' ' * 5}\rnote\n"
    out.close()
    printer.say("a terminal that went away is no error")
