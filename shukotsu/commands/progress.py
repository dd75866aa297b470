"""A line on a terminal that says how far a long command is; nothing where nobody looks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from shukotsu.files.line_printer import LinePrinter

WIDTH = 30


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function of how many of `total` are done: it draws a bar on the terminal, gone at the end."""
    printer = LinePrinter(sys.stderr)

    def tell(done: int) -> None:
        if printer.in_place and total > 1:
            printer.show(f"[{'#' * (WIDTH * done // total):{WIDTH}}] {done} of {total} {what}")

    tell(0)
    try:
        yield tell
    finally:
        printer.clear()
