"""A line on a terminal that says how far a long command is; nothing where nobody looks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

WIDTH = 30


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function of how many of `total` are done: it draws a bar on the terminal, removed at the end.

    Where standard error is no terminal, nothing is written.
    """
    shown = sys.stderr.isatty() and total > 1

    def tell(done: int) -> None:
        if shown:
            bar = "#" * (WIDTH * done // total)
            print(f"\r[{bar:{WIDTH}}] {done} of {total} {what}", end="", file=sys.stderr, flush=True)

    tell(0)
    try:
        yield tell
    finally:
        if shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
