"""What all emulated trackers share: receivers in a world, counters, the stream cut into cycles. No I/O here.

A device lives in cycles: `cycle` is the number of the next one since power-up. Time is what its caller
makes of them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from stages.capture.emulate.encode import Block, Measured
from stages.capture.emulate.faults import BitErrors, Conditions, Plug, SensorFault, Stylus, Unplug
from stages.capture.emulate.frames import StationFrames, side, smeared
from stages.capture.emulate.poses_source import PoseSource

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Wholes = npt.NDArray[np.int64]

WRAP = 1 << 32
BLOCK_CYCLES = 120


@dataclass(frozen=True)
class World:
    """What surrounds the device: where receivers truly are, which are plugged in, and what goes wrong.

    start_frame : the frame count at power-up. restart_s : how long the device is deaf after power-up.
    """

    motion: PoseSource
    plugged: frozenset[int]
    sensor_faults: tuple[SensorFault, ...] = ()
    bit_errors: tuple[BitErrors, ...] = ()
    start_frame: int = 0
    restart_s: float = 8.0

    def sorted_out(self) -> World:
        """Give the world with plugs in the order of time, and a receiver that is plugged in first, out."""
        plugs = [fault for fault in self.sensor_faults if isinstance(fault, Plug | Unplug)]
        plugs.sort(key=lambda fault: fault.when.begins(240.0))
        others = [fault for fault in self.sensor_faults if not isinstance(fault, Plug | Unplug)]
        first: dict[int, SensorFault] = {}
        for plug in plugs:
            first.setdefault(plug.station, plug)
        absent = {station for station, fault in first.items() if isinstance(fault, Plug)}
        return replace(self, plugged=self.plugged - absent, sensor_faults=(*plugs, *others))


@dataclass(frozen=True)
class Cycle:
    """What one cycle sent: bytes, first byte of each record, counters (-1 where nothing was sent)."""

    number: int
    since: int
    data: bytes = b""
    starts: tuple[int, ...] = ()
    stations: tuple[int, ...] = ()
    frame: int = -1
    device_ms: int = -1


@dataclass(frozen=True)
class _Cached:
    """A block that was encoded ahead, and the sides after each of its cycles for where it is left."""

    first: int
    block: Block
    bounds: Wholes
    sides: dict[int, Array]


class Device(ABC):
    """A tracker; families differ in commands and records."""

    ports: int

    def __init__(self, world: World) -> None:
        self.world = world.sorted_out()
        self.cycle = 0
        self.streaming = False
        self.first_stream: int | None = None
        """The cycle of the first start of continuous output: fault times count from there."""
        self.deaf_until: int | None = None
        self._power_up_counters()
        self._sides: dict[int, float] = {}
        self._cached: _Cached | None = None
        self._bits_cleared = -1
        self._presses = {
            fault.when.begins(float(self.rate)): fault.station
            for fault in self.world.sensor_faults
            if isinstance(fault, Stylus)
        }

    @property
    @abstractmethod
    def rate(self) -> Fraction:
        """Cycles a second."""

    @property
    def buffered(self) -> bool:
        """Whether cycles wait in the FIFO for a line that is busy."""
        return True

    @property
    @abstractmethod
    def all_stations(self) -> tuple[int, ...]:
        """Stations that the device has connectors for."""

    @abstractmethod
    def enabled(self, station: int) -> bool:
        """Whether the client lets the station take part."""

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answer."""

    @abstractmethod
    def ready_text(self) -> bytes:
        """What the device says when it has started."""

    @abstractmethod
    def frames_of(self, station: int) -> StationFrames:
        """The reference frames of a station."""

    @abstractmethod
    def hemisphere_of(self, station: int) -> tuple[float, ...]:
        """Its hemisphere."""

    @abstractmethod
    def new_share(self) -> float:
        """Share of a new sample that the position filter takes in; 1 is no filter."""

    @abstractmethod
    def mounting(self) -> Array:
        """How the transmitter is mounted, quaternion (4,)."""

    @abstractmethod
    def mm_per_unit(self) -> float:
        """Millimetres of the unit that is sent and received."""

    @abstractmethod
    def encoded(self, measured: Measured, *, single: bool) -> Block:
        """Encode cycles as the settings of the moment say."""

    @abstractmethod
    def button_toggles(self, station: int) -> bool:
        """Whether a press of the station's stylus starts and stops continuous output."""

    def turns(self, cycles: Wholes, taking_part: Flags) -> Flags:
        """Which of the stations that take part (T, S) send a record in which cycle: all in each."""
        del cycles
        return taking_part

    def pose_counts(self, cycles: Wholes, taking_part: Flags) -> Wholes:
        """Which step of the motion each cycle since its beginning (T,) measures."""
        del taking_part
        return cycles

    def next_cycle(self) -> Cycle:
        """Let one cycle pass; give what it sent."""
        number, since = self.cycle, self.since_start(self.cycle)
        if self.deaf_until is not None:
            return self._starting(number)
        if since in self._presses and self.button_toggles(self._presses[since]):
            self.leave_block()
            self.streaming = not self.streaming
        if not self.streaming:
            self.cycle += 1
            return Cycle(number, since)
        cached = self._cached
        if cached is None or not 0 <= number - cached.first < len(cached.block.frame):
            cached = self._ahead(BLOCK_CYCLES)
        self.cycle += 1
        return _cycle_of(cached, number, since)

    def since_start(self, cycle: int) -> int:
        """Cycles since the first start of continuous output; -1 before it."""
        return -1 if self.first_stream is None else cycle - self.first_stream

    def start_stream(self) -> None:
        """Begin continuous output with the next cycle."""
        if self.first_stream is None:
            self.first_stream = self.cycle
            self.leave_block()
        if not self.streaming:
            self._sides = {}
        self.streaming = True

    def single(self) -> bytes:
        """One record of every active station, now."""
        self.leave_block()
        measured, _ = self._measured(np.array([self.cycle]), self.active(), single=True)
        if not self.streaming:  # the filter settles until the next poll
            self._sides = {}
        return self.encoded(measured, single=True).data.tobytes()

    def reset_counters(self, *, frames: bool, timestamp: bool) -> None:
        """Let the counters begin at 0 with the next cycle; the motion begins again with the frame count."""
        if frames:
            self._frames_from, self._poses_from = (self.cycle, 0), self.cycle
        if timestamp:
            self._ms_from = (self.cycle, Fraction(0))

    def restart(self) -> None:
        """Go deaf as after power-up; afterwards the device says that it is ready."""
        self.streaming = False
        self._cached = None
        self._sides = {}
        self.deaf_until = self.cycle + round(self.world.restart_s * self.rate)

    def active(self) -> tuple[int, ...]:
        """Stations that are plugged in now and take part."""
        return tuple(station for station in self.detected() if self.enabled(station))

    def detected(self) -> tuple[int, ...]:
        """Stations that are plugged in now."""
        plugged = self._conditions(np.array([self.cycle]), self.all_stations).plugged[0]
        return tuple(s for s, there in zip(self.all_stations, plugged.tolist(), strict=True) if there)

    def failed_channels(self) -> tuple[int, ...]:
        """Stations whose built-in test has failed and was not cleared since."""
        since = self.since_start(self.cycle)
        begun = [(fault.when.begins(float(self.rate)), fault.station) for fault in self.world.bit_errors]
        return tuple(sorted({s for first, s in begun if self._bits_cleared < first <= since}))

    def clear_bit_errors(self) -> None:
        """Forget the failures so far."""
        self._bits_cleared = max(self._bits_cleared, self.since_start(self.cycle))

    def orientation(self, station: int) -> Array:
        """Where the station points now without its boresight, quaternion (4,); NaN where it is not seen."""
        cycles, active = np.array([self.cycle]), self.active()
        counts = self.pose_counts(cycles - self._poses_from, self._conditions(cycles, active).plugged)
        _, quaternion = self.world.motion.poses(counts, (station,))
        frames = replace(self.frames_of(station))
        frames.reset_boresight()
        turned: Array = frames.seen(np.zeros((1, 3)), quaternion[0], self.mounting())[1][0]
        return turned

    def keep_time(self, before: Fraction) -> None:
        """To be called after the rate changed from `before`: the timestamp goes on from where it is."""
        first, ms = self._ms_from
        self._ms_from = (self.cycle, ms + (self.cycle - first) * 1000 / before)

    def _power_up_counters(self) -> None:
        start = self.world.start_frame
        self._frames_from = (self.cycle, start)  # a cycle and the frame count in it
        self._ms_from = (self.cycle, start * 1000 / self.rate)  # a cycle and the exact timestamp in it
        self._poses_from = self.cycle

    def _starting(self, number: int) -> Cycle:
        assert self.deaf_until is not None
        if number < self.deaf_until:
            self.cycle += 1
            return Cycle(number, -1)
        self.deaf_until = None
        self._power_up_counters()
        self.cycle += 1
        return Cycle(number, -1, self.ready_text())

    def leave_block(self) -> None:
        """Drop what was encoded ahead, as before a setting changes; the filter goes on from where it is."""
        cached, self._cached = self._cached, None
        if cached is not None:
            done = min(self.cycle - cached.first, len(cached.block.frame))
            if done > 0:
                self._sides.update({s: float(values[done - 1]) for s, values in cached.sides.items()})

    def _ahead(self, count: int) -> _Cached:
        self.leave_block()
        cycles = self.cycle + np.arange(count)
        plugged = self._conditions(cycles, self.all_stations).plugged
        stations = tuple(
            s
            for s, column in zip(self.all_stations, plugged.T, strict=True)
            if column.any() and self.enabled(s)
        )
        measured, sides = self._measured(cycles, stations, single=False)
        block = self.encoded(measured, single=False)
        self._cached = _Cached(self.cycle, block, block.bounds, sides)
        return self._cached

    def _conditions(self, cycles: Wholes, stations: Sequence[int]) -> Conditions:
        shape = (len(cycles), len(stations))
        start = self.first_stream
        conditions = Conditions(
            tuple(stations),
            float(self.rate),
            np.full(len(cycles), -1) if start is None else np.maximum(cycles - start, -1),
            np.tile(np.isin(stations, list(self.world.plugged)).astype(bool), (len(cycles), 1)),
            np.zeros(shape, bool),
            np.zeros(shape, np.int64),
            np.zeros(len(cycles), np.int64),
            np.zeros(len(cycles), bool),
        )
        for fault in self.world.sensor_faults:
            fault.apply(conditions)
        return conditions

    def _measured(
        self, cycles: Wholes, stations: tuple[int, ...], *, single: bool
    ) -> tuple[Measured, dict[int, Array]]:
        """Measure cycles; gives also the filtered side of every station after each (see frames.smeared)."""
        conditions = self._conditions(cycles, stations)
        taking_part = conditions.plugged
        counts = self.pose_counts(cycles - self._poses_from, taking_part)
        position, quaternion = self.world.motion.poses(counts, stations)
        sending = taking_part if single else self.turns(cycles - self._poses_from, taking_part)
        present = sending & np.isfinite(position).all(-1) & np.isfinite(quaternion).all(-1)
        position, quaternion = np.nan_to_num(position), np.nan_to_num(quaternion)
        sides = self._filtered_sides(position, stations)
        position = position * sides[..., None]
        mounting = self.mounting()
        for s, station in enumerate(stations):
            frames = self.frames_of(station)
            position[:, s], quaternion[:, s] = frames.seen(position[:, s], quaternion[:, s], mounting)
        measured = Measured(
            stations,
            self._frames(cycles),
            self._milliseconds(cycles),
            position / self.mm_per_unit(),
            quaternion,
            present,
            self._letters(conditions),
            conditions.distortion,
            conditions.button.astype(np.int64),
            conditions.sync.astype(np.int64),
        )
        return measured, {station: sides[:, s] for s, station in enumerate(stations)}

    def _filtered_sides(self, position_mm: Array, stations: Sequence[int]) -> Array:
        if not stations:
            return np.ones(position_mm.shape[:2])
        now = [side(position_mm[:, s], self.hemisphere_of(n)) for s, n in enumerate(stations)]
        sides = np.stack(now, -1)
        before = np.array([self._sides.get(n, float(sides[0, s])) for s, n in enumerate(stations)])
        share = self.new_share()
        return sides if share == 1 else smeared(sides, before, share)

    def _frames(self, cycles: Wholes) -> Wholes:
        first, count = self._frames_from
        return (cycles - first + count) % WRAP

    def _milliseconds(self, cycles: Wholes) -> Wholes:
        first, ms = self._ms_from
        step = 1000 / self.rate
        common = math.lcm(ms.denominator, step.denominator)
        passed = (cycles - first) * (step.numerator * (common // step.denominator))
        return (passed + ms.numerator * (common // ms.denominator)) // common % WRAP

    def _letters(self, conditions: Conditions) -> npt.NDArray[np.uint8]:
        """Error letters (T, S): the source's; in capitals, or I, while the built-in test has failed."""
        first = [
            fault.when.begins(float(self.rate))
            for fault in self.world.bit_errors
            if fault.when.begins(float(self.rate)) > self._bits_cleared
        ]
        failed = conditions.since >= min(first, default=np.iinfo(np.int64).max)
        source = conditions.source
        coil = (source >= ord("a")) & (source <= ord("g"))
        letters = np.where(failed & coil, source - 32, np.where(failed & (source == 0), ord("I"), source))
        return np.tile(letters[:, None], (1, len(conditions.stations))).astype(np.uint8)


def _cycle_of(cached: _Cached, number: int, since: int) -> Cycle:
    at = number - cached.first
    block = cached.block
    sizes = block.sizes[at]
    sent = sizes > 0
    ends = np.cumsum(sizes[sent])
    data = block.data[cached.bounds[at] : cached.bounds[at + 1]].tobytes()
    return Cycle(
        number,
        since,
        data,
        (0, *ends[:-1].tolist()) if len(ends) else (),
        tuple(s for s, there in zip(block.stations, sent.tolist(), strict=True) if there),
        int(block.frame[at]),
        int(block.device_ms[at]),
    )
