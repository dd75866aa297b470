"""A device on its line, in time: what was due is measured, spoilt, and handed out as the line carries it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shukotsu.trackers.emulate.device import Cycle, EmulatedDevice
from shukotsu.trackers.emulate.faults import LineFault, StreamTime, damaged

SECOND_NS = 1_000_000_000
FIFO_BYTES = 2300
"""What the device keeps for a line that is busy; what does not fit is lost a whole cycle at a time.

Source: LIBERTY User Manual URM03PH156 (USB FIFO); that RS-232 loses whole cycles too is assumed.
"""


@dataclass(frozen=True)
class Behaviour:
    """Hold what the emulator does beside what the device would.

    line_bytes_per_s : what the line carries; None is without limit, so that only the reader is one.
    fifo_bytes : what the device keeps meanwhile. silent : never answer. gone_at : break off in the middle of
    a record of that cycle. faults and seed : of the line.
    """

    line_bytes_per_s: float | None = None
    fifo_bytes: int = FIFO_BYTES
    silent: bool = False
    gone_at: StreamTime | None = None
    faults: tuple[LineFault, ...] = ()
    seed: int = 0


class Emulator:
    """Device, line and clock. Time is the caller's, in ns from any beginning, and never goes back.

    write : takes bytes towards the client and gives how many were taken.
    """

    def __init__(
        self, device: EmulatedDevice, behaviour: Behaviour, write: Callable[[bytes], int], now_ns: int
    ) -> None:
        self.device = device
        self._behaviour, self._write = behaviour, write
        self._rate = device.rate
        self._from_cycle, self._from_ns = device.cycle, now_ns
        self._waiting = bytearray()
        self._ready_bytes = 0.0  # at the head of what waits, that the line has had the time to carry
        self._carried_s = 0.0
        self.gone = False
        """Whether the device has vanished and its port must close."""

    @property
    def due_ns(self) -> int:
        """Tell when the next cycle is to be measured."""
        passed = self.device.cycle - self._from_cycle
        return self._from_ns + passed * SECOND_NS * self._rate.denominator // self._rate.numerator

    @property
    def is_busy(self) -> bool:
        """Tell whether cycles are sent, or wait for the line."""
        return self.device.streaming or bool(self._waiting)

    def receive(self, data: bytes, now_ns: int) -> None:
        """Hand the client's bytes to the device and its answer to the line; a reply always has room."""
        if self._behaviour.silent or not data:
            return
        self.run(now_ns)
        self._waiting += self.device.receive(data)
        self._follow_rate()
        self._carry(now_ns)

    def run(self, now_ns: int) -> None:
        """Let every cycle pass that is due, and the line carry what it can."""
        while not self.gone and self.due_ns <= now_ns:
            due_ns = self.due_ns
            self._carry(due_ns)
            cycle = self.device.next_cycle()
            self._follow_rate()
            if cycle.data and not self._behaviour.silent:
                self._send(cycle)
                self._carry(due_ns)
        self._carry(now_ns)

    def _carry(self, now_ns: int) -> None:
        """Let the line carry what it can until then."""
        now_s, bytes_per_s = now_ns / SECOND_NS, self._behaviour.line_bytes_per_s
        allowed = len(self._waiting)
        if bytes_per_s is not None:
            self._ready_bytes += max(0.0, now_s - self._carried_s) * bytes_per_s
            self._ready_bytes = min(self._ready_bytes, float(allowed))
            allowed = int(self._ready_bytes)
        self._carried_s = max(self._carried_s, now_s)
        if allowed:
            taken = self._write(bytes(self._waiting[:allowed]))
            del self._waiting[:taken]
            self._ready_bytes -= taken

    def _follow_rate(self) -> None:
        if self.device.rate != self._rate:
            self._from_ns, self._from_cycle = self.due_ns, self.device.cycle
            self._rate = self.device.rate

    def _send(self, cycle: Cycle) -> None:
        behaviour, rate_hz = self._behaviour, float(self._rate)
        if not cycle.starts:  # a text of the device itself
            self._waiting += cycle.data
        elif behaviour.gone_at is not None and cycle.since >= behaviour.gone_at.cycle(rate_hz):
            self._waiting += cycle.data[: [*cycle.starts, len(cycle.data)][1] // 2]
            self.gone = True
        elif not self._waiting or len(self._waiting) + len(cycle.data) <= behaviour.fifo_bytes:
            self._waiting += damaged(
                cycle.data, cycle.starts, behaviour.faults, cycle.since, rate_hz, behaviour.seed
            )
