"""What all drivers share: finding the tracker on its line, comparing what it says is set."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.record.conversation import Conversation
from shukotsu.trackers.record.request import RecordingRequest

OTHER_BAUDS = (115200, 57600, 38400, 19200, 9600)
LEAST_COSINE = 0.9999


class TrackerDriver:
    """Base of a family's driver. warnings : what the user should know of the tracker, once it is set up."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        self.warnings: list[str] = []
        self._complaints: list[str] = []  # of the tracker, while it was set up
        self._conversation = conversation
        self._request = request
        self._port_name = conversation.port.name

    def _find(self, attempt: Callable[[], tuple[str | None, bytes]]) -> str:
        """Identify the tracker at the rate of the port or, where there is a serial line, at another.

        attempt() : what identifies the tracker, and what was heard at all. Raises InputError where nothing
        answers, or something that is not this tracker.
        """
        port = self._conversation.port
        first_baud, heard_at_first = port.baud, b""
        tries_others = port.line_baud is not None and first_baud is not None
        bauds = list(dict.fromkeys((first_baud, *OTHER_BAUDS))) if tries_others else [first_baud]
        for baud in bauds:
            if baud != first_baud and baud is not None:
                port.set_baud(baud)
            identity, heard = attempt()
            if identity is None and heard:  # a busy host may have read the answer too late
                identity, heard = attempt()
            if identity is not None:
                if baud != first_baud:
                    self.warnings.append(
                        f"it answered at {baud} baud and not at {first_baud}; {baud} is used"
                    )
                return identity
            heard_at_first = heard_at_first or heard
        title = FAMILIES[self._request.family].title
        if heard_at_first:
            shown = heard_at_first[:24].decode("latin-1").encode("ascii", "backslashreplace").decode()
            raise InputError(
                f"{port.name}: what answers is no {title} (it sent {shown!r}); check --tracker and --port"
            )
        tried = f" at {', '.join(map(str, bauds))} baud" if tries_others else ""
        raise InputError(
            f"{port.name}: nothing answers{tried}; check that the {title} is switched on (just switched "
            "on? it takes 10 s), its cable (on RS-232 a null-modem one), that its USB is not "
            "connected too (that ends RS-232), and --port"
        )

    def _silence(self, first: bytes, again: bytes) -> bytes:
        """Send what stops a stream until it is silent, at most three times; return what was heard."""
        heard = b""
        for command, cap_s in ((first, 5.0), (again, 2.0), (again, 2.0)):
            self._conversation.send(command)
            piece, silent = self._conversation.drain(cap_s=cap_s)
            heard += piece
            if silent:
                break
        return heard

    def _require(self, what: str, reported: Any, sent: Any) -> None:
        """Raise InputError where a setting is not what was sent; reported : None where it does not say."""
        if same_value(reported, sent):
            return
        says = "says nothing about it" if reported is None else f"says {shown(reported)}"
        complained = f" (it complained: {', '.join(self._complaints)})" if self._complaints else ""
        raise InputError(
            f"{self._port_name}: the tracker did not take its {what}: sent was {shown(sent)}, and when "
            f"asked it {says}{complained}; switch it off and on, and try again"
        )


def same_value(reported: Any, sent: Any) -> bool:
    """Whether a value that was read is the one that was sent, numbers to 0.01."""
    if not (isinstance(reported, tuple) and isinstance(sent, tuple)):
        return bool(reported == sent)
    pairs = zip(reported, sent, strict=False)
    return len(reported) == len(sent) and all(abs(a - b) < 0.01 for a, b in pairs)


def shown(value: Any) -> str:
    """Format a setting for people."""
    if isinstance(value, tuple):
        return ", ".join(f"{round(part, 4):g}" for part in value) or "nothing"
    return str(value)


def same_direction(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two vectors point the same way, to 0.8 degrees; never where one has no length."""
    lengths = math.hypot(*a) * math.hypot(*b)
    return lengths > 0 and sum(x * y for x, y in zip(a, b, strict=True)) / lengths > LEAST_COSINE


def is_zero(values: Sequence[float]) -> bool:
    """Whether an offset or a rotation is none."""
    return all(abs(value) < 1e-4 for value in values)


def is_default_alignment(values: Sequence[float]) -> bool:
    """Whether an alignment (origin, a point on x, one on y: 9 numbers) is the transmitter's own frame.

    The points may be at any distance: it differs between trackers and with the unit.
    """
    along_x, along_y = same_direction(values[3:6], (1, 0, 0)), same_direction(values[6:9], (0, 1, 0))
    return math.hypot(*values[:3]) < 1e-3 and along_x and along_y
