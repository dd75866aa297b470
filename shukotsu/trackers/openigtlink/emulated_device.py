"""An OpenIGTLink server made of software: tools whose stamps are even, in any kind of message."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from shukotsu.skeleton.rotations import matrix
from shukotsu.trackers.emulate.device import FOLLOWING, EmulatedDevice, StationSettings, World
from shukotsu.trackers.emulate.encoding import Block, Measured
from shukotsu.trackers.openigtlink.messages import TOOL_BYTES, framed
from shukotsu.trackers.protocols.records import Array, Bytes
from shukotsu.trackers.protocols.stream_settings import MM_PER_UNIT

FIRST_STAMP_S = 1_700_000_000


class EmulatedServer(EmulatedDevice):
    """A server of tools 1 to 16, `Tool1ToTracker` and so on; TDATA and QTDATA wait to be asked for."""

    def __init__(
        self, world: World, family: str, ports: int, rate_hz: int, message: str = "transform"
    ) -> None:
        del family
        stations = {n: StationSettings((), hemisphere=FOLLOWING) for n in range(1, ports + 1)}
        super().__init__(world, stations, ())
        self._rate, self._kind = Fraction(rate_hz), message.upper().encode()
        self.unit = 1
        if self._kind not in TOOL_BYTES:
            self.start_stream()

    @property
    def rate(self) -> Fraction:
        """Frames a second."""
        return self._rate

    def receive(self, data: bytes) -> bytes:
        """Start or stop sending tracking data; other messages are nothing to it."""
        if b"STT_" + self._kind in data:
            self.start_stream()
        self.streaming &= b"STP_" + self._kind not in data
        return b""

    def _encoded(self, measured: Measured, *, single: bool = False) -> Block:
        """Encode cycles: a message a tool, or one of all tools that are there."""
        del single
        tools, there = _numbers(measured, self._kind), measured.present
        stamp_ns = FIRST_STAMP_S * 10**9 + measured.frame * 1_000_000_000 // int(self._rate)
        names = [b"Tool%dToTracker" % station for station in measured.stations]
        if self._kind in TOOL_BYTES:
            heads = np.frombuffer(b"".join(name.ljust(20, b"\0") + b"\1\0" for name in names), np.uint8)
            tools = np.concatenate([np.broadcast_to(heads.reshape(-1, 22), (*tools.shape[:2], 22)), tools], 2)
            names = [b"Tracker"] * len(measured)
        else:
            tools, there = tools.reshape(-1, 1, tools.shape[2]), there.reshape(-1, 1)
            names, stamp_ns = names * len(measured), np.repeat(stamp_ns, len(names))
        parts, counts = [b""] * len(there), there.sum(1)
        for count in np.unique(counts[counts > 0]):
            rows = np.flatnonzero(counts == count)
            bodies = tools[rows][there[rows]].reshape(len(rows), -1)
            messages = framed(self._kind, [names[row] for row in rows], bodies, stamp_ns[rows])
            for row, message in zip(rows.tolist(), messages, strict=True):
                parts[row] = message.tobytes()
        sizes = np.array([len(part) for part in parts]).reshape(len(measured), -1)
        return Block(np.frombuffer(b"".join(parts), np.uint8), sizes)


def _numbers(measured: Measured, kind: bytes) -> Bytes:
    """Bytes of the poses' numbers, (T, S, bytes)."""
    position_mm: Array = measured.position * MM_PER_UNIT["cm"]
    if kind in (b"TRANSFORM", b"TDATA"):
        columns = matrix(measured.quaternion).swapaxes(-1, -2).reshape(*position_mm.shape[:2], 9)
        numbers = np.concatenate([columns, position_mm], -1)
    else:
        numbers = np.concatenate([position_mm, np.roll(measured.quaternion, -1, -1)], -1)
    return numbers.astype(">f4").view(np.uint8)
