"""Lines for people: those that stay, and one that is rewritten in place on a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

BAR_LETTERS = 30


class LinePrinter:
    """Prints on a stream. One that goes away meanwhile is no error: the work goes on without it.

    in_place : whether the stream is a terminal, where a line can be rewritten.
    """

    def __init__(self, stream: TextIO) -> None:
        self.in_place = stream.isatty()
        self._stream: TextIO | None = stream
        self._shown = ""

    def say(self, line: str) -> None:
        """Print a line that stays."""
        self.clear()
        self._write(f"{line}\n")

    def show(self, line: str) -> None:
        """Print a line over the one shown before; elsewhere than on a terminal below it."""
        if not self.in_place:
            self._write(f"{line}\n")
            return
        before, self._shown = len(self._shown), line[: shutil.get_terminal_size().columns - 1]
        self._write(f"\r{self._shown:{before}}")

    def clear(self) -> None:
        """Take the shown line away."""
        if self._shown:
            self._write(f"\r{' ' * len(self._shown)}\r")
            self._shown = ""

    def _write(self, text: str) -> None:
        if self._stream is None:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:  # what is left in its buffer must not fail again at the program's end
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        except ValueError:
            self._stream = None


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function of how many of `total` are done: it draws a bar on the terminal, gone at the end."""
    printer = LinePrinter(sys.stderr)

    def tell(done: int) -> None:
        if printer.in_place and total > 1:
            printer.show(f"[{'#' * (BAR_LETTERS * done // total):{BAR_LETTERS}}] {done} of {total} {what}")

    tell(0)
    try:
        yield tell
    finally:
        printer.clear()
