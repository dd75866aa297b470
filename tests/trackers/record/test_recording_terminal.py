"""The terminal: rewritten in place, keys without Return, and everything put back."""

import io
import re

from shukotsu.trackers.record.recording_terminal import Terminal


class Tty(io.StringIO):
    """Text that says it is a terminal."""

    def isatty(self) -> bool:
        """It is none."""
        return True


def test_a_view_is_written_over_the_one_before() -> None:
    out = Tty()
    with Terminal(out, io.StringIO()) as terminal:
        terminal.say("setting up")
        terminal.show(["one", "two"])
        terminal.show(["three", "four"])
    written = out.getvalue()
    assert terminal.in_place
    assert written.startswith("setting up\n")
    assert written.count("\x1b[2A") == 1, "two lines up, before the second view"
    assert re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", written) == "setting up\none\ntwo\nthree\nfour\n"
    assert written.count("\x1b[?25l") == written.count("\x1b[?25h") == 1, "the cursor is back"


def test_a_terminal_that_went_away_is_no_error() -> None:
    out = Tty()
    with Terminal(out, io.StringIO()) as terminal:
        out.close()
        terminal.show(["one"])
        terminal.say("two")
        assert terminal.pressed() == ""
