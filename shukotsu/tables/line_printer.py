"""Print lines on the terminal: permanent ones, and one that is rewritten in place."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

BAR_LETTERS = 30


class LinePrinter:
    """Printer of lines on a stream; if the stream is closed, further lines are dropped without an error.

    in_place : whether the stream is a terminal, on which a line can be rewritten.
    """

    def __init__(self, stream: TextIO) -> None:
        self.in_place = stream.isatty()
        self._stream: TextIO | None = stream
        self._shown = ""

    def say(self, line: str) -> None:
        """Print a permanent line."""
        self.clear()
        self._write(f"{line}\n")

    def show(self, line: str) -> None:
        """Print a line over the previous one, or below it if the stream is not a terminal."""
        if not self.in_place:
            self._write(f"{line}\n")
            return
        before, self._shown = len(self._shown), line[: shutil.get_terminal_size().columns - 1]
        self._write(f"\r{self._shown:{before}}")

    def clear(self) -> None:
        """Remove the line that is shown."""
        if self._shown:
            self._write(f"\r{' ' * len(self._shown)}\r")
            self._shown = ""

    def _write(self, text: str) -> None:
        if self._stream is None:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:  # otherwise the buffered text would fail again when the program ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        except ValueError:
            self._stream = None


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Draw a progress bar on a terminal; elsewhere nothing is printed.

    Parameters
    ----------
    what : str
        Plural noun for what is counted.
    total : int
        Total number.

    Yields
    ------
    callable
        Function that draws the bar, given the number completed.

    """
    printer = LinePrinter(sys.stderr)

    def draw(done: int) -> None:
        if printer.in_place and total > 1:
            printer.show(f"[{'#' * (BAR_LETTERS * done // total):{BAR_LETTERS}}] {done} of {total} {what}")

    draw(0)
    try:
        yield draw
    finally:
        printer.clear()
