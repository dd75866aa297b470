"""Emulate what all trackers share: receivers in a world, counters, the stream cut into cycles. No I/O here.

A device lives in cycles: `cycle` is the number of the next one since power-up. Time is what its caller
makes of them.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from shukotsu.trackers.emulate.encoding import Block, Framing, Measured, encode
from shukotsu.trackers.emulate.faults import Plug
from shukotsu.trackers.emulate.pose_sources import Motion
from shukotsu.trackers.families import FAMILIES, loaded
from shukotsu.trackers.protocols.records import Array, Bools, Wholes
from shukotsu.trackers.protocols.stream_settings import MM_PER_UNIT

WRAP = 1 << 32
BLOCK_CYCLES = 120
FOLLOWING = (0.0, 0.0, 0.0)
"""The hemisphere that stands for "keep track of the receiver": no position flips."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


class RefusedError(Exception):
    """The device does not do it; `code` is the manual's error number."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(frozen=True)
class World:
    """Hold what surrounds the device: where receivers truly are, which are plugged in, and when that changes.

    A receiver whose first event is that it is plugged in is out until then. restart_s : how long the device
    is deaf after power-up.
    """

    motion: Motion
    plugged: frozenset[int]
    plugs: tuple[Plug, ...] = ()
    restart_s: float = 8.0


@dataclass(frozen=True)
class Cycle:
    """Hold the bytes of one cycle; since : cycles since the stream first started; starts : of each record."""

    since: int
    data: bytes = b""
    starts: tuple[int, ...] = ()


@dataclass
class StationSettings:
    """Hold one station's settings; all but the hemisphere move nothing, and are only answered when asked."""

    items: tuple[int, ...]
    stylus: int = 0
    enabled: bool = True
    hemisphere: tuple[float, ...] = (1.0, 0.0, 0.0)
    alignment: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    boresight: tuple[float, ...] = (0.0, 0.0, 0.0)
    tip: tuple[float, ...] = (0.0, 0.0, 0.0)


class EmulatedDevice(ABC):
    """A tracker; families differ in commands and records.

    binary, unit : whether records are binary, and positions in centimetres (1) or inches (0).
    position_filter, attitude_filter : are answered when asked for; motions are taken for what they gave.
    """

    def __init__(
        self, world: World, stations: dict[int, StationSettings], position_filter: tuple[float, ...]
    ) -> None:
        self.world = world
        self.stations = stations
        self.position_filter = self.attitude_filter = position_filter
        self.binary = self.unit = 0
        self.cycle = 0
        self.streaming = False
        self.first_stream: int | None = None
        """The cycle of the first start of continuous output: fault times count from there."""
        self.deaf_until: int | None = None
        self._counted_from = 0
        self._typed = bytearray()
        self._ahead: tuple[int, Block] | None = None  # a block that was encoded ahead, and its first cycle

    @property
    @abstractmethod
    def rate(self) -> Fraction:
        """Cycles a second."""

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answer."""

    def ready_text(self) -> bytes:
        """Return what the device sends when it has started."""
        return b""

    @abstractmethod
    def _encoded(self, measured: Measured, *, single: bool = False) -> Block:
        """Encode cycles, streamed or in answer to a single poll."""

    def turns(self, cycles: Wholes, taking_part: Bools) -> Bools:
        """Tell which of the stations that take part (T, S) send a record in which cycle: all in each."""
        del cycles
        return taking_part

    def pose_counts(self, cycles: Wholes, taking_part: Bools) -> Wholes:
        """Tell which step of the motion each cycle since its beginning (T,) measures."""
        del taking_part
        return cycles

    def next_cycle(self) -> Cycle:
        """Let one cycle pass; give what it sent."""
        number, since = self.cycle, self.since_start(self.cycle)
        if self.deaf_until is not None and number >= self.deaf_until:
            self.deaf_until, self._counted_from = None, number
            self.cycle += 1
            return Cycle(since, self.ready_text())
        if self.streaming and (self._ahead is None or number - self._ahead[0] >= len(self._ahead[1])):
            cycles = number + np.arange(BLOCK_CYCLES)
            self._ahead = (number, self._encoded(self._measured(cycles, self._taking_part(cycles))))
        self.cycle += 1
        if not self.streaming or self._ahead is None:
            return Cycle(since)
        return Cycle(since, *self._ahead[1].cycle(number - self._ahead[0]))

    def since_start(self, cycle: int) -> int:
        """Cycles since the first start of continuous output; -1 before it."""
        return -1 if self.first_stream is None else cycle - self.first_stream

    def start_stream(self) -> None:
        """Begin continuous output with the next cycle."""
        if self.first_stream is None:
            self.first_stream = self.cycle
            self.leave_block()
        self.streaming = True

    def single(self) -> bytes:
        """One record of every active station, now."""
        self.leave_block()
        measured = self._measured(np.array([self.cycle]), self.active(), single=True)
        return self._encoded(measured, single=True).data.tobytes()

    def reset_counters(self) -> None:
        """Let the counters and the motion begin at 0 with the next cycle."""
        self._counted_from = self.cycle

    def start_up(self) -> None:
        """Go deaf as after power-up; afterwards the device says that it is ready."""
        self.streaming = False
        self.deaf_until = self.cycle + round(self.world.restart_s * self.rate)

    def active(self) -> tuple[int, ...]:
        """Stations that are plugged in now and take part."""
        return self._taking_part(np.array([self.cycle]))

    def detected(self) -> tuple[int, ...]:
        """Stations that are plugged in now."""
        plugged = self._plugged(np.array([self.cycle]))[0]
        return tuple(s for s, there in zip(self.stations, plugged.tolist(), strict=True) if there)

    def _taking_part(self, cycles: Wholes) -> tuple[int, ...]:
        """Stations that are switched on, and plugged in in any of the cycles."""
        ever = self._plugged(cycles).any(axis=0)
        return tuple(
            s
            for s, at in zip(self.stations, np.atleast_1d(ever), strict=True)
            if at and self.stations[s].enabled
        )

    def leave_block(self) -> None:
        """Drop what was encoded ahead, as before a setting changes."""
        self._ahead = None

    def _plugged(self, cycles: Wholes) -> Bools:
        """Tell which stations of the device are plugged in, (T, S)."""
        since = cycles - (WRAP if self.first_stream is None else self.first_stream)
        plugged = np.tile(np.isin(list(self.stations), list(self.world.plugged)), (len(cycles), 1))
        rate_hz = float(self.rate)
        changed: set[int] = set()
        for plug in sorted(self.world.plugs, key=lambda plug: plug.time.cycle(rate_hz)):
            column = list(self.stations).index(plug.station)
            if plug.is_in and plug.station not in changed:
                plugged[:, column] = False
            changed.add(plug.station)
            plugged[since >= plug.cycle(rate_hz), column] = plug.is_in
        return plugged

    def _measured(self, cycles: Wholes, stations: tuple[int, ...], *, single: bool = False) -> Measured:
        """Measure cycles."""
        passed = cycles - self._counted_from
        taking_part = self._plugged(cycles)[:, np.isin(list(self.stations), stations)]
        position_mm, quaternion = self.world.motion.poses(self.pose_counts(passed, taking_part), stations)
        sending = taking_part if single else self.turns(passed, taking_part)
        present = sending & np.isfinite(position_mm).all(-1) & np.isfinite(quaternion).all(-1)
        position_mm = np.nan_to_num(position_mm)
        for column, station in enumerate(stations):
            position_mm[:, column] *= _side(position_mm[:, column], self.stations[station].hemisphere)
        return Measured(
            stations,
            passed % WRAP,
            passed * 1000 * self.rate.denominator // self.rate.numerator % WRAP,
            position_mm / MM_PER_UNIT["cm" if self.unit else "inch"],
            np.nan_to_num(quaternion),
            present,
        )


class OutputListDevice(EmulatedDevice):
    """A tracker whose records hold what an output list asks for."""

    earlier_list: tuple[int, ...]
    """Output list of a device that is found streaming: not what a recorder asks for."""

    @abstractmethod
    def framing(self, *, single: bool) -> Framing:
        """Return the framing of records, while streaming or in answer to a single poll."""

    def _encoded(self, measured: Measured, *, single: bool = False) -> Block:
        """Encode cycles as the settings of the moment say."""
        lists = {number: station.items for number, station in self.stations.items()}
        return encode(measured, lists, self.framing(single=single), binary=bool(self.binary))

    def power_up_streaming(self) -> None:
        """Be as an earlier client left it: streaming in binary, centimetres, an output list of its own."""
        self.binary = self.unit = 1
        for station in self.stations.values():
            station.items = self.earlier_list
        self.start_stream()


def emulated_device(family: str, world: World, ports: int, rate_hz: int, **how: str) -> EmulatedDevice:
    """Give an emulated tracker with that many connectors and that rate at power-up; how : what it alone
    has.
    """
    name = FAMILIES[family].emulated_device
    assert name is not None, f"{family} has no emulated device"
    device: EmulatedDevice = loaded(name)(world, family=family, ports=ports, rate_hz=rate_hz, **how)
    return device


def _side(position_mm: Array, hemisphere: Sequence[float]) -> Array:
    """Sign with which positions (T, 3) are reported, (T, 1): -1 where they are outside the hemisphere."""
    if tuple(hemisphere) == FOLLOWING:
        return np.ones((len(position_mm), 1))
    return np.where(position_mm @ np.array(hemisphere) < 0, -1.0, 1.0)[:, None]


def parsed_numbers(
    texts: Sequence[str], present: Sequence[float], *, not_a_number: int, too_large: int
) -> tuple[float, ...]:
    """Read a command's numbers; one that is left out keeps its present value.

    Raises RefusedError with those codes.
    """
    values = list(present)
    for place, text in enumerate(texts):
        if text and not _NUMBER.fullmatch(text):
            raise RefusedError(not_a_number)
        if text and not math.isfinite(float(text)):
            raise RefusedError(too_large)
        values[place] = float(text) if text else values[place]
    return tuple(values)
