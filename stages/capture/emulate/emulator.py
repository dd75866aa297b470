"""A device on its line, in time: what was due is measured, spoilt, and handed out as the line carries it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stages.capture.emulate.device import Cycle, Device
from stages.capture.emulate.faults import Edit, LineFault, When, damaged
from stages.capture.emulate.line import Line
from stages.capture.emulate.truth import CUT, LOST, SENT, Truth

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Behaviour:
    """What the emulator does beside what the device would.

    silent : never answer. gone_at : break off in the middle of a record of that cycle. faults and seed :
    of the line.
    """

    silent: bool = False
    gone_at: When | None = None
    faults: tuple[LineFault, ...] = ()
    seed: int = 0


class Emulator:
    """Device, line and clock. Time is the caller's, in ns from any beginning, and never goes back.

    truth : keeps what was done, where that is wanted. write : takes bytes towards the client and gives how
    many were taken.
    """

    def __init__(
        self,
        device: Device,
        line: Line,
        behaviour: Behaviour,
        truth: Truth | None,
        write: Callable[[bytes], int],
        now_ns: int,
    ) -> None:
        self.device = device
        self._line, self._behaviour, self._truth, self._write = line, behaviour, truth, write
        self._rate = device.rate
        self._from_cycle, self._from_ns = device.cycle, now_ns
        self.gone = False
        """Whether the device has vanished and its port must close."""

    @property
    def due_ns(self) -> int:
        """When the next cycle is to be measured."""
        passed = self.device.cycle - self._from_cycle
        return self._from_ns + passed * SECOND_NS * self._rate.denominator // self._rate.numerator

    def receive(self, data: bytes, now_ns: int) -> None:
        """Hand the client's bytes to the device and its answer to the line."""
        if self._behaviour.silent or not data:
            return
        self.run(now_ns)
        reply = self.device.receive(data)
        self._line.buffered = self.device.buffered
        self._follow_rate()
        if reply:
            self._line.put(reply)
            self._line.run(now_ns / SECOND_NS, self._write)

    def run(self, now_ns: int) -> None:
        """Let every cycle pass that is due, and the line carry what it can."""
        while not self.gone and self.due_ns <= now_ns:
            due_ns = self.due_ns
            self._line.run(due_ns / SECOND_NS, self._write)
            cycle = self.device.next_cycle()
            self._follow_rate()
            if cycle.data and not self._behaviour.silent:
                self._send(cycle, due_ns)
                self._line.run(due_ns / SECOND_NS, self._write)
        self._line.run(now_ns / SECOND_NS, self._write)

    @property
    def waiting(self) -> int:
        """Bytes that the line has not carried yet."""
        return len(self._line)

    def _follow_rate(self) -> None:
        if self.device.rate != self._rate:
            self._from_ns, self._from_cycle = self.due_ns, self.device.cycle
            self._rate = self.device.rate

    def _send(self, cycle: Cycle, due_ns: int) -> None:
        if not cycle.starts:  # a text of the device itself
            self._line.put(cycle.data)
            return
        gone_at = self._behaviour.gone_at
        if gone_at is not None and cycle.since >= gone_at.begins(float(self._rate)):
            half = (cycle.starts[1] if len(cycle.starts) > 1 else len(cycle.data)) // 2
            self._keep(CUT, cycle, due_ns, half)
            self._line.put(cycle.data[:half])
            self.gone = True
            return
        if not self._line.has_room(len(cycle.data)):
            self._keep(LOST, cycle, due_ns, len(cycle.data))
            return
        data = cycle.data
        edits: list[tuple[int, Edit]] = []
        if self._behaviour.faults:
            data, edits = damaged(
                data,
                cycle.starts,
                self._behaviour.faults,
                cycle.since,
                float(self._rate),
                self._behaviour.seed,
            )
        self._keep(SENT, cycle, due_ns, len(data))
        if self._truth is not None:
            for place, edit in edits:
                self._truth.edit(edit, cycle, due_ns, self._line.offset + place)
        self._line.put(data)

    def _keep(self, kind: str, cycle: Cycle, due_ns: int, size: int) -> None:
        if self._truth is not None:
            self._truth.cycle(kind, cycle, due_ns, self._line.offset, size)
