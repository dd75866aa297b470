"""Finding a tracker on its line: at the rate that was said or, where there is a line, at another."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from schemas.errors import InputError
from stages.capture.record.conversation import Conversation

OTHER_BAUDS = (115200, 57600, 38400, 19200, 9600)
NAMES = {
    "liberty": "LIBERTY",
    "patriot": "PATRIOT",
    "fastrak": "FASTRAK",
    "viper": "VIPER",
    "trakstar": "trakSTAR",
}

Found = TypeVar("Found")
Attempt = Callable[[], tuple[Found | None, bytes]]
"""Tries to find the tracker; gives what it found, and what was heard at all."""


def find(talk: Conversation, family: str, attempt: Attempt[Found], warnings: list[str]) -> Found:
    """Give what `attempt` finds; notes in `warnings` where that is at another rate than was said.

    Raises InputError where nothing answers, or something that is not this tracker.
    """
    port = talk.port
    asked = port.baud
    bauds = [asked]
    if port.tries_other_bauds:
        bauds += [baud for baud in OTHER_BAUDS if baud != asked]
    heard_at_first = b""
    for baud in bauds:
        if baud != asked and baud is not None:
            port.set_baud(baud)
        found, heard = attempt()
        if found is not None:
            if baud != asked:
                warnings.append(f"it answered at {baud} baud and not at {asked}; {baud} is used")
            return found
        heard_at_first = heard_at_first or heard
    tracker = NAMES[family]
    if heard_at_first:
        shown = heard_at_first[:24].decode("latin-1").encode("ascii", "backslashreplace").decode()
        raise InputError(
            f"{port.name}: what answers is no {tracker} (it sent {shown!r}); check --tracker and --port"
        )
    tried = f" at {', '.join(str(baud) for baud in bauds)} baud" if port.tries_other_bauds else ""
    raise InputError(
        f"{port.name}: nothing answers{tried}; check that the {tracker} is switched on (just switched "
        "on? it takes 10 s), its cable (on RS-232 a null-modem one), that its USB is not "
        "connected too (that ends RS-232), and --port"
    )
