"""Setting up a trakSTAR on a serial line, which speaks the protocol of Flock of Birds.

It answers little: so its records are looked at instead. Hemispheres, filters and the range stay as the
maker's own program has set them. Source: Flock of Birds Installation and Operation Guide.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from schemas.errors import InputError
from stages.capture.record.conversation import Conversation
from stages.capture.record.finding import find
from stages.capture.record.wishes import FORWARD, Wishes
from stages.capture.trackers.flock import DEFAULT_RANGE_INCH, FlockDecoder
from stages.capture.trackers.settings import StreamSettings

POINT, STREAM, POSITION_QUATERNION = b"B", b"@", b"]"
CHANGE_GROUP_MODE = b"P\x23"
ADDRESS = 0xF0
LOOK_S = 1.0
LEAST_HZ = 1.0


class TrakstarDriver:
    """Driver of trakSTAR and Flock of Birds (see `wishes.Driver`)."""

    def __init__(self, talk: Conversation, wishes: Wishes) -> None:
        if wishes.mode == "ascii":
            raise InputError("--ascii: a trakSTAR sends binary only; leave it out")
        if wishes.hemisphere != FORWARD or wishes.no_filters:
            raise InputError("--hemisphere, --no-filters: set them with the trakSTAR's own program")
        self.warnings: list[str] = []
        self._talk = talk
        self._stations = wishes.stations or (1,)
        self._group = len(self._stations) > 1

    def set_up(self) -> StreamSettings:
        """Have it send positions and quaternions; measure how often it does."""
        rate_hz = find(self._talk, "trakstar", self._attempt, self.warnings)
        self.warnings.append(
            "a trakSTAR's settings cannot be read back; its hemisphere and range are as they were"
        )
        return self._settings(rate_hz)

    def start(self) -> Mapping[str, Any]:
        """Have it stream; it has no counters."""
        return {"sent_ns": self._talk.send(STREAM)}

    def stop(self) -> None:
        """Have it stop: to ask for one record ends a stream."""
        self._talk.send(POINT)

    def put_back(self) -> None:
        """Have it stop; what it sent before cannot be asked for."""
        self.stop()
        self._talk.drain(0.1)

    def _attempt(self) -> tuple[float | None, bytes]:
        """Stop it, set its records, let it stream for a while; gives records a second of each receiver."""
        self.stop()
        self._talk.drain()
        for station in self._stations:
            address = bytes([ADDRESS + station]) if self._group else b""
            self._talk.send(address + POSITION_QUATERNION)
        if self._group:
            self._talk.send(CHANGE_GROUP_MODE + b"\x01")
        self._talk.send(STREAM)
        came, start = b"", time.monotonic()
        while time.monotonic() - start < LOOK_S:
            came += self._talk.receive(0.05)
        self.stop()
        rest, _ = self._talk.drain()
        records = FlockDecoder(self._settings(LEAST_HZ)).feed(came, final=True).records
        good = int((~records.doubtful).sum())
        rate_hz = good / LOOK_S / len(self._stations)
        return (round(rate_hz, 1) if rate_hz >= LEAST_HZ else None), came + rest

    def _settings(self, rate_hz: float) -> StreamSettings:
        options = {
            "record": "position-quaternion",
            "group": self._group,
            "range_inch": DEFAULT_RANGE_INCH,
            "inverse": True,
            "warnings": self.warnings,
        }
        return StreamSettings("trakstar", "binary", "inch", rate_hz, self._stations, {}, {}, options)
