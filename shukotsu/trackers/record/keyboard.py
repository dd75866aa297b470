"""Keys without Return, where the system has a way: a terminal of Unix, or the console of Windows."""

from __future__ import annotations

import os
import select
from codecs import getincrementaldecoder
from importlib import import_module
from importlib.util import find_spec
from typing import Any, TextIO

_STDERR, _PROCESSED_TERMINAL = -12, 7
"""Windows: the handle's number, and the mode in which a console obeys what moves the cursor."""


class Keyboard:
    """A keyboard that gives nothing, as of a program in the background, or one that is read from a pipe."""

    def pressed(self) -> str:
        """Give the keys that were pressed since the last call."""
        return ""

    def open(self) -> None:
        """Have keys come one by one."""

    def close(self) -> None:
        """Set it back."""


class TerminalKeyboard(Keyboard):
    """The terminal of a program in its foreground; one that goes away gives nothing any more."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._termios = import_module("termios")
        self._before: list[Any] = []
        self._decoder = getincrementaldecoder("utf-8")("replace")

    def open(self) -> None:
        """Have keys come one by one."""
        self._before = self._termios.tcgetattr(self._descriptor)
        import_module("tty").setcbreak(self._descriptor, self._termios.TCSANOW)

    def pressed(self) -> str:
        """Give the keys that were pressed since the last call."""
        if not select.select([self._descriptor], [], [], 0)[0]:
            return ""
        try:
            return self._decoder.decode(os.read(self._descriptor, 64))
        except OSError:
            return ""

    def close(self) -> None:
        """Set it back."""
        try:
            self._termios.tcsetattr(self._descriptor, self._termios.TCSANOW, self._before)
        except self._termios.error:  # it is gone
            return


class ConsoleKeyboard(Keyboard):
    """The console of Windows."""

    def __init__(self) -> None:
        self._console = import_module("msvcrt")

    def open(self) -> None:
        """Have the console obey what moves a terminal's cursor: older ones do not by themselves."""
        kernel = getattr(import_module("ctypes"), "windll").kernel32  # noqa: B009
        kernel.SetConsoleMode(kernel.GetStdHandle(_STDERR), _PROCESSED_TERMINAL)

    def pressed(self) -> str:
        """Give the keys that were pressed since the last call."""
        keys = ""
        while self._console.kbhit():
            keys += self._console.getwch()
        return keys


def keyboard_of(stream: TextIO | None) -> Keyboard:
    """Give the keyboard behind a stream; one of a program in the background would stop it for trying."""
    if stream is None:
        return Keyboard()
    try:
        descriptor = stream.fileno()
        if not os.isatty(descriptor):
            return Keyboard()
        if find_spec("msvcrt") is not None:
            return ConsoleKeyboard()
        return TerminalKeyboard(descriptor) if os.tcgetpgrp(descriptor) == os.getpgrp() else Keyboard()
    except (OSError, ValueError, AttributeError):
        return Keyboard()
