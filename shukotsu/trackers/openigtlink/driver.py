"""Joining the stream of an OpenIGTLink server, which may send without being asked.

Which tools there are, how often they are sent and whether they are stamped cannot be asked: it is looked at.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.trackers.decode.findings import doubts_on_time
from shukotsu.trackers.openigtlink.decoder import MessageDecoder
from shukotsu.trackers.openigtlink.messages import framed
from shukotsu.trackers.protocols.records import Records, Wholes
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.driver import Driver
from shukotsu.trackers.record.port import PortGoneError

LOOK_S = 1.5
RATES_HZ = (0.1, 9999.0)

EVEN = 0.25
"""Frames are even in time where nearly all steps differ by less of a period from it."""

NEARLY_ALL = 0.9
_FASTEST = bytes(36)
"""What a start asks for: no least time between frames, no name of a frame of reference."""


class OpenIGTLinkDriver(Driver):
    """Driver of OpenIGTLink servers."""

    def set_up(self) -> StreamSettings:
        """Ask for tracking data, which servers may send without; look at what comes."""
        self._ask(b"STT_TDATA", b"STT_QTDATA", body=_FASTEST)
        settings = self._look()
        self.warnings += doubts_on_time(settings.options)
        return settings

    def start(self) -> Mapping[str, Any]:
        """Let it go on."""
        return {}

    def stop(self) -> None:
        """Take back what was asked for; some servers hang up then."""
        with suppress(PortGoneError):
            self._ask(b"STP_TDATA", b"STP_QTDATA")

    put_back = stop

    def _ask(self, *kinds: bytes, body: bytes = b"") -> None:
        bodies = np.frombuffer(body, np.uint8)[None]
        messages = [framed(kind, [b""], bodies, np.zeros(1, np.int64)).tobytes() for kind in kinds]
        self._conversation.send(b"".join(messages))

    def _look(self) -> StreamSettings:
        """Listen for a while; gives what came as settings. Raises InputError where that was no pose."""
        chunks, end = [], time.monotonic() + LOOK_S
        while (left := end - time.monotonic()) > 0:
            chunks += self._conversation.listen(min(left, 0.1))
        settings = StreamSettings("openigtlink", "binary", "mm", RATES_HZ[1], (), {}, {}, {"stamps": True})
        decoder = MessageDecoder(settings)
        records = decoder.feed(b"".join(chunk.data for chunk in chunks), final=True).records
        ends = np.cumsum([len(chunk.data) for chunk in chunks])
        if not len(records):
            raise InputError(
                f"{self._port_name}: in {LOOK_S:g} s no pose came, and {ends.max(initial=0)} bytes of other "
                "kinds; check that the server sends TRANSFORM, POSITION, TDATA or QTDATA, and --port"
            )
        arrival = np.searchsorted(ends, records.offset + records.size)
        came_ns = np.array([chunk.host_ns for chunk in chunks], np.int64)[arrival]
        rate_hz, stamps = _pace(records, came_ns)
        names = dict(enumerate(sorted(decoder.names.values(), key=_natural), 1))
        options = {**stamps, "joined": True, "names": {str(number): name for number, name in names.items()}}
        return replace(settings, rate_hz=rate_hz, stations=tuple(names), options=options)


def _pace(records: Records, came_ns: Wholes) -> tuple[float, dict[str, bool]]:
    """Give frames a second, whether stamps are of use, and whether frames are even in time by them."""
    one = [np.flatnonzero(records.station == station) for station in np.unique(records.station)]
    step_ns = np.concatenate([np.diff(records.stamp_ns[rows]) for rows in one])
    if not records.stamp_ns.all() or not len(step_ns) or not np.median(step_ns) > 0:
        rows = max(one, key=len)
        span_s = max(LOOK_S if len(rows) < 2 else np.ptp(came_ns[rows]) * 1e-9, 1e-3)
        return _bounded(max(len(rows) - 1, 1) / span_s), {"stamps": False}
    near = np.abs(step_ns / np.median(step_ns) - 1) < 0.5
    period_ns = step_ns[near].mean()
    even = np.mean(np.abs(step_ns / period_ns - 1) < EVEN)
    return _bounded(1e9 / period_ns), {"stamps": True, "steady": bool(even > NEARLY_ALL)}


def _bounded(rate_hz: float) -> float:
    return round(min(max(rate_hz, RATES_HZ[0]), RATES_HZ[1]), 1)


def _natural(name: str) -> list[tuple[int, str]]:
    """Sort key: numbers in a name by their value."""
    parts = re.split(r"(\d{1,18})", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
