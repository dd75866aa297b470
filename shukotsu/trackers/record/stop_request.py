"""A request to end a recording, by a signal or by the program itself."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

STOP_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
IGNORED_SIGNALS = ("SIGTSTP", "SIGTTOU")
"""Ctrl-Z would leave the tracker's bytes to a buffer that is soon full."""


class StopRequest:
    """Whether somebody asked for the end. reason : who, the first time; "" while nobody did."""

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

    def ask(number: int, _frame: Any) -> None:
        stop.ask(signal.Signals(number).name)

    handlers = dict.fromkeys(STOP_SIGNALS, ask) | dict.fromkeys(IGNORED_SIGNALS, signal.SIG_IGN)
    there = {getattr(signal, name): handler for name, handler in handlers.items() if hasattr(signal, name)}
    before = {number: signal.signal(number, handler) for number, handler in there.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
