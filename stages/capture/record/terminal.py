"""The terminal: a view rewritten in place, keys without Return, and all put back however the program ends."""

from __future__ import annotations

import os
import select
import shutil
import termios
import tty
from collections.abc import Sequence
from types import TracebackType
from typing import Any, TextIO

_CLEAR_LINE, _CLEAR_BELOW = "\x1b[K", "\x1b[J"
_HIDE_CURSOR, _SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"


class Terminal:
    """Shows on `out` and reads keys from `keyboard`; use it with `with`.

    in_place : whether `out` is a terminal, where lines can be rewritten. A terminal that goes away while it
    is used is no error: the recording goes on without it.
    """

    def __init__(self, out: TextIO, keyboard: TextIO) -> None:
        self.in_place = out.isatty()
        self._out: TextIO | None = out
        self._keys = _foreground_terminal(keyboard)
        self._before: list[Any] = []
        self._shown = 0
        self._hidden = False

    def __enter__(self) -> Terminal:
        if self._keys is not None:
            self._before = termios.tcgetattr(self._keys)
            tty.setcbreak(self._keys, termios.TCSANOW)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._hidden:
            self._write(_SHOW_CURSOR)
        if self._keys is not None:
            try:
                termios.tcsetattr(self._keys, termios.TCSANOW, self._before)
            except termios.error:  # it is gone
                return

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
        if self._keys is None or not select.select([self._keys], [], [], 0)[0]:
            return ""
        try:
            return os.read(self._keys, 64).decode("ascii", "replace")
        except OSError:
            return ""

    def _write(self, text: str) -> None:
        if self._out is None:
            return
        try:
            self._out.write(text)
            self._out.flush()
        except (OSError, ValueError):
            self._out = None


def _foreground_terminal(keyboard: TextIO) -> int | None:
    """Give the descriptor where keys can be read: a program in the background would be stopped for trying."""
    try:
        descriptor = keyboard.fileno()
        return descriptor if os.tcgetpgrp(descriptor) == os.getpgrp() else None
    except (OSError, ValueError, AttributeError):
        return None
