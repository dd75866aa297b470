"""What ends a recording from outside, and that the program then ends in its own way."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

IGNORED = (signal.SIGTSTP, signal.SIGTTOU)
"""Ctrl-Z would leave the tracker's bytes to a buffer that is soon full."""


class Stop:
    """Whether somebody asked for the end.

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
def signals_ask(stop: Stop) -> Iterator[None]:
    """Have signals ask for the end instead of ending the program, within the `with`."""

    def ask(number: int, frame: Any) -> None:
        del frame
        stop.ask(signal.Signals(number).name)

    before = {number: signal.signal(number, ask) for number in ENDING}
    before |= {number: signal.signal(number, signal.SIG_IGN) for number in IGNORED}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
