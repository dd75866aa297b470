"""The terminal of a recording, a view rewritten in place and keys; and a request to stop.

All is put back however the program ends.
"""

from __future__ import annotations

import shutil
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO

from shukotsu.trackers.record.keyboard import keyboard_of

_CLEAR_LINE, _CLEAR_BELOW = "\x1b[K", "\x1b[J"
_HIDE_CURSOR, _SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"


def _signals(*names: str) -> list[signal.Signals]:
    """Give those of the signals that this system has."""
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


STOP_SIGNALS = _signals("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")

IGNORED_SIGNALS = _signals("SIGTSTP", "SIGTTOU")
"""Ctrl-Z would leave the tracker's bytes to a buffer that is soon full."""


class Terminal:
    """Shows on `out` and reads keys from `keyboard`, where there is one; use it with `with`.

    in_place : whether `out` is a terminal, where lines can be rewritten. A terminal that goes away while it
    is used is no error: the recording goes on without it.
    """

    def __init__(self, out: TextIO, keyboard: TextIO | None) -> None:
        self.in_place = out.isatty()
        self._out: TextIO | None = out
        self._keyboard = keyboard_of(keyboard)
        self._shown = 0
        self._hidden = False

    def __enter__(self) -> Terminal:
        self._keyboard.open()
        return self

    def __exit__(self, *_: object) -> None:
        if self._hidden:
            self._write(_SHOW_CURSOR)
        self._keyboard.close()

    @property
    def rows(self) -> int:
        """Lines that a view may have."""
        return shutil.get_terminal_size().lines - 1

    def say(self, text: str) -> None:
        """Write a line that stays."""
        self._shown = 0
        self._write(f"{text}\n")

    def show(self, lines: Sequence[str]) -> None:
        """Write the view over the one before."""
        width = shutil.get_terminal_size().columns
        up = f"\x1b[{self._shown}A" if self._shown else _HIDE_CURSOR
        self._hidden = True
        self._write(up + "".join(f"{line[:width]}{_CLEAR_LINE}\n" for line in lines) + _CLEAR_BELOW)
        self._shown = len(lines)

    def pressed(self) -> str:
        """Give the keys that were pressed since the last call."""
        return self._keyboard.pressed()

    def _write(self, text: str) -> None:
        if self._out is None:
            return
        try:
            self._out.write(text)
            self._out.flush()
        except (OSError, ValueError):
            self._out = None


class StopRequest:
    """Tell whether somebody asked for the end.

    reason : who, the first time; "" while nobody did.
    """

    def __init__(self) -> None:
        self.reason = ""

    def ask(self, reason: str) -> None:
        """Ask for the end; a second reason does not replace the first."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


@contextmanager
def stop_on_signals(stop: StopRequest) -> Iterator[None]:
    """Have signals ask for the end instead of ending the program, within the `with`."""

    def ask(number: int, frame: Any) -> None:
        del frame
        stop.ask(signal.Signals(number).name)

    before = {number: signal.signal(number, ask) for number in STOP_SIGNALS}
    before |= {number: signal.signal(number, signal.SIG_IGN) for number in IGNORED_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
