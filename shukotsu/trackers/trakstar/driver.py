"""Setting up a trakSTAR on a serial line, which speaks the protocol of Flock of Birds.

It answers little: so its records are looked at instead. Hemispheres, filters and the range stay as the
maker's own program has set them. Source: Flock of Birds Installation and Operation Guide.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.conversation import Conversation
from shukotsu.trackers.record.driver import Driver
from shukotsu.trackers.record.request import RecordingRequest
from shukotsu.trackers.trakstar.decoder import RANGE_INCH, FlockDecoder

POINT, STREAM, POSITION_QUATERNION = b"B", b"@", b"]"
CHANGE_GROUP_MODE = b"P\x23"
ADDRESS = 0xF0
LOOK_S = 1.0
LEAST_HZ = 1.0


class TrakstarDriver(Driver):
    """Driver of trakSTAR and Flock of Birds."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        super().__init__(conversation, request)
        self._stations = request.stations or (1,)
        self._group = len(self._stations) > 1

    def set_up(self) -> StreamSettings:
        """Have it send positions and quaternions; measure how often it does."""
        rate_hz = self._find(self._attempt)
        self.warnings.append(
            "a trakSTAR's settings cannot be read back; its hemisphere and range are as they were"
        )
        return self._settings(rate_hz)

    def start(self) -> Mapping[str, Any]:
        """Have it stream; it has no counters."""
        return {"sent_ns": self._conversation.send(STREAM)}

    def stop(self) -> None:
        """Have it stop: to ask for one record ends a stream."""
        self._conversation.send(POINT)

    def put_back(self) -> None:
        """Have it stop; what it sent before cannot be asked for."""
        self.stop()
        self._conversation.drain(0.1)

    def _attempt(self) -> tuple[float | None, bytes]:
        """Stop it, set its records, let it stream for a while; gives records a second of each receiver."""
        self.stop()
        self._conversation.drain()
        for station in self._stations:
            address = bytes([ADDRESS + station]) if self._group else b""
            self._conversation.send(address + POSITION_QUATERNION)
        if self._group:
            self._conversation.send(CHANGE_GROUP_MODE + b"\x01")
        self._conversation.send(STREAM)
        came, start = b"", time.perf_counter()
        while time.perf_counter() - start < LOOK_S:
            came += self._conversation.receive(0.05)
        self.stop()
        rest, _ = self._conversation.drain()
        records = FlockDecoder(self._settings(LEAST_HZ)).feed(came, final=True).records
        good = int((~records.doubtful).sum())
        rate_hz = good / LOOK_S / len(self._stations)
        return (round(rate_hz, 1) if rate_hz >= LEAST_HZ else None), came + rest

    def _settings(self, rate_hz: float) -> StreamSettings:
        options = {"group": self._group, "range_inch": RANGE_INCH, "warnings": self.warnings}
        return StreamSettings("trakstar", "binary", "inch", rate_hz, self._stations, {}, {}, options)
