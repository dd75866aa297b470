"""What the user asks of a recording, checked as far as that needs no tracker; and that it shall end."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from shukotsu.errors import InputError
from shukotsu.tracker.families import FAMILIES, check_family
from shukotsu.tracker.liberty_replies import FULL_LIST, SHORT_LIST

LARGEST_STATION = 16
TRACK = (0.0, 0.0, 0.0)
"""Hemisphere of a tracker that follows the receiver."""
STOP_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
IGNORED_SIGNALS = ("SIGTSTP", "SIGTTOU")
"""Ctrl-Z would leave the tracker's bytes to a buffer that is soon full."""


@dataclass(frozen=True)
class RecordingRequest:
    """What a recording shall be like.

    short : only the frame count, position and quaternion of each record. asked_hz : None for the usual rate.
    stations : None for all that are connected. hemisphere : vector of the half of space, TRACK to have the
    tracker follow the receiver. Raises InputError for what the family cannot do.
    """

    family: str
    short: bool = False
    asked_hz: int | None = None
    stations: tuple[int, ...] | None = None
    hemisphere: tuple[float, float, float] = (1.0, 0.0, 0.0)
    no_filters: bool = False

    def __post_init__(self) -> None:
        check_family(self.family, "--tracker")
        if self.asked_hz is not None and len(FAMILIES[self.family].rates_hz) < 2:
            raise InputError(f"--rate: a {self.family} has a rate of its own; leave it out")
        if self.family == "viper" and self.stations is not None:
            raise InputError("--stations: a VIPER sends every sensor that is connected; leave it out")
        if self.family == "viper" and self.short:
            raise InputError("--items: a VIPER has no output lists; leave it out")

    @property
    def items(self) -> tuple[int, ...]:
        """Output list of LIBERTY and PATRIOT."""
        return SHORT_LIST if self.short else FULL_LIST

    @property
    def rate_hz(self) -> int:
        """Frames a second."""
        return self.asked_hz or FAMILIES[self.family].rates_hz[0]


def parse_stations(text: str) -> tuple[int, ...]:
    """Read --stations: numbers and stretches, such as 1-8,12. Raises InputError."""
    stations: set[int] = set()
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            stations.update(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"--stations: is {text!r}; expected numbers such as 1-8,12") from error
    if not stations or min(stations) < 1 or max(stations) > LARGEST_STATION:
        raise InputError(f"--stations: is {text!r}; expected numbers from 1 to {LARGEST_STATION}")
    return tuple(sorted(stations))


def parse_hemisphere(text: str) -> tuple[float, float, float]:
    """Read --hemisphere: three numbers with commas, or `track`. Raises InputError."""
    if text == "track":
        return TRACK
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--hemisphere: is {text!r}; expected x,y,z such as 1,0,0, or track") from error
    if not 0 < math.hypot(x, y, z) < math.inf:
        raise InputError(f"--hemisphere: {text} is no direction; `track` has the tracker follow the receiver")
    return (x, y, z)


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
