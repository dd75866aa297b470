"""Lines for the terminal: permanent ones, and one that is rewritten in place."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

BAR_LETTERS = 30


class LinePrinter:
    """Printer of lines on a stream; a stream that closes meanwhile is ignored and the work continues.

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
        """Print a line over the one shown before, or below it where the stream is not a terminal."""
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
        except OSError:  # otherwise the rest of the buffer fails again when the program ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        except ValueError:
            self._stream = None


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Draw a progress bar on a terminal; elsewhere nothing is printed.

    Parameters
    ----------
    what : str
        What is counted, a plural.
    total : int
        Number of them in all.

    Yields
    ------
    callable
        Takes the number that is done.

    """
    printer = LinePrinter(sys.stderr)

    def tell(done: int) -> None:
        if printer.in_place and total > 1:
            printer.show(f"[{'#' * (BAR_LETTERS * done // total):{BAR_LETTERS}}] {done} of {total} {what}")

    tell(0)
    try:
        yield tell
    finally:
        printer.clear()
