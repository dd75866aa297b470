"""Count while a recording is made: rates, missing frames, errors, distortion. No I/O here."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.decode.stream import Block
from shukotsu.trackers.protocols.records import Wholes
from shukotsu.trackers.protocols.stream_settings import StreamSettings

WINDOW_S = 2.0
"""Rates are over so long."""

ABSENT_S = 0.5
"""A receiver that is not heard for longer is absent; what is missing for less counts as lost frames."""

SILENT_S = 1.0
"""A tracker of which nothing is heard for longer is silent."""

LAG_WINDOW_S = 10
"""The lag is against the fastest arrival of so long: host and tracker clocks part slowly."""

STATIONS = 256


@dataclass
class Receiver:
    """One receiver so far.

    lost_before_last : how many of `lost` are directly before its newest record.
    margin : p . h / |p|, the sine of how far it is within its half of space; NaN where the tracker follows
    it or it has no position. absences : (from, to) seconds since the start; to is None while it is absent.
    """

    records: int = 0
    lost: int = 0
    lost_before_last: int = 0
    doubtful: int = 0
    errors: int = 0
    error: int = 0
    distortion: int = 0
    worst_distortion: int = 0
    margin: float = np.nan
    least_margin: float = np.nan
    last_frame: int | None = None
    last_host_ns: int = 0
    absences: list[tuple[float, float | None]] = field(default_factory=list)

    @property
    def is_absent(self) -> bool:
        """Whether others are heard and it is not."""
        return bool(self.absences) and self.absences[-1][1] is None


@dataclass(frozen=True)
class Row:
    """One receiver at a moment; rate_hz None where it is absent, missing_percent of the last WINDOW_S."""

    station: int
    rate_hz: float | None
    missing_percent: float
    error: str
    distortion: int
    margin: float
    absent_s: float


@dataclass(frozen=True)
class Moment:
    """All receivers at a moment, and what concerns the stream as a whole."""

    rows: tuple[Row, ...]
    bytes_per_s: float
    lag_ms: float | None
    silent_s: float
    skipped_bytes: int
    partial_cycles: int


class Statistics:
    """Counts what comes; start_ns is the host's monotonic time at which the stream was started."""

    def __init__(self, settings: StreamSettings, start_ns: int) -> None:
        self.receivers = {station: Receiver() for station in settings.stations}
        self.skipped_bytes = 0
        self.partial_cycles = 0
        self.lost_cycles = 0
        self.cycles = 0
        self.received_bytes = 0
        self._settings = settings
        self._start_ns = start_ns
        self.silences: list[tuple[float, float | None]] = []
        self._heard_ns = start_ns
        self._past: deque[tuple[int, int, Wholes, Wholes]] = deque()
        self._open_cycle = (-1, 0)
        self._before_open = (0, 0)
        self._expected = len(settings.stations)
        self._fastest: deque[tuple[int, float]] = deque()
        self._lag_ns: float | None = None
        self._remember(start_ns)

    def add(self, block: Block, received_bytes: int, now_ns: int) -> None:
        """Count what was decoded of the bytes that came since the last call."""
        self.received_bytes += received_bytes
        self.skipped_bytes += block.skipped_bytes
        self._watch_silence(received_bytes, now_ns)
        good = block.good
        for station in np.unique(block.records.station).tolist():
            rows = np.flatnonzero(block.records.station == station)
            receiver = self.receivers.setdefault(station, Receiver())
            receiver.doubtful += int(np.count_nonzero(~good[rows]))
            self._count(receiver, station, block, rows[good[rows]])
        self._count_cycles(block.records.frame[good])
        self._measure_lag(block, np.flatnonzero(good))
        self._find_absent()
        self._remember(now_ns)

    def moment(self, now_ns: int) -> Moment:
        """Return the present state."""
        then_ns, then_bytes, then_records, then_lost = self._past[0]
        span_s = max((self._past[-1][0] - then_ns) * 1e-9, 1e-9)
        rows = []
        for station, receiver in sorted(self.receivers.items()):
            came = receiver.records - int(then_records[station])
            lost = receiver.lost - int(then_lost[station])
            absent_s = (now_ns - (receiver.last_host_ns or self._start_ns)) * 1e-9
            there = absent_s <= ABSENT_S
            back_s = receiver.absences[-1][1] if receiver.absences else None
            since_back_s = span_s if back_s is None else self._seconds(now_ns) - back_s
            rows.append(
                Row(
                    station,
                    came / min(span_s, max(since_back_s, 1e-9)) if there else None,
                    100 * lost / max(came + lost, 1),
                    chr(receiver.error) if receiver.error else "",
                    receiver.distortion,
                    receiver.margin,
                    0.0 if there else absent_s,
                )
            )
        return Moment(
            tuple(rows),
            (self.received_bytes - then_bytes) / span_s,
            None if self._lag_ns is None else self._lag_ns * 1e-6,
            (now_ns - self._heard_ns) * 1e-9,
            self.skipped_bytes,
            self.partial_cycles,
        )

    def totals(self, now_ns: int) -> dict[str, Any]:
        """Sum up the recording, as JSON types.

        cycles : with the newest one. lost_frames : records that are missing, in all and of each receiver;
        lost_cycles : frames of which nothing came. What is missing directly before the newest frame is no
        loss: a stop cuts the cycle in which it comes, and the tracker answers it with a frame of its own.
        """
        lost = {station: self._lost(receiver) for station, receiver in self.receivers.items()}
        gap, partial = self._before_open
        receivers = {
            str(station): {
                "records": receiver.records,
                "lost_frames": lost[station],
                "doubtful_records": receiver.doubtful,
                "records_with_error": receiver.errors,
                "worst_distortion": receiver.worst_distortion,
                "least_hemisphere_margin": _number(receiver.least_margin),
                "absent_s": [[_number(a), _number(b)] for a, b in receiver.absences],
            }
            for station, receiver in sorted(self.receivers.items())
        }
        return {
            "seconds": (now_ns - self._start_ns) * 1e-9,
            "records": sum(receiver.records for receiver in self.receivers.values()),
            "lost_frames": sum(lost.values()),
            "lost_cycles": self.lost_cycles - gap,
            "cycles": self.cycles + (self._open_cycle[0] >= 0),
            "partial_cycles": self.partial_cycles - partial,
            "skipped_bytes": self.skipped_bytes,
            "received_bytes": self.received_bytes,
            "silent_s": [[_number(a), _number(b)] for a, b in self.silences],
            "receivers": receivers,
        }

    def _lost(self, receiver: Receiver) -> int:
        newest = receiver.last_frame == self._open_cycle[0]
        return receiver.lost - (receiver.lost_before_last if newest else 0)

    def _count(self, receiver: Receiver, station: int, block: Block, rows: Wholes) -> None:
        if not len(rows):
            return
        records, host_ns = block.records, block.host_ns
        frame = records.frame[rows]
        before = frame[0] - 1 if receiver.last_frame is None else receiver.last_frame
        missed = np.maximum(np.diff(frame, prepend=before) - 1, 0)
        absent = missed > ABSENT_S * self._settings.rate_hz
        receiver.lost += int(missed[~absent].sum())
        receiver.lost_before_last = 0 if absent[-1] else int(missed[-1])
        if receiver.is_absent:
            receiver.absences[-1] = (receiver.absences[-1][0], self._seconds(int(host_ns[rows[0]])))
            absent[0] = False  # told already, while nothing came
        for place in np.flatnonzero(absent):
            back = self._seconds(int(host_ns[rows[place]]))
            receiver.absences.append((back - float(missed[place]) / self._settings.rate_hz, back))
        receiver.records += len(rows)
        receiver.last_frame = int(frame[-1])
        receiver.last_host_ns = int(host_ns[rows[-1]])
        errors = records.error[rows]
        receiver.errors += int(np.count_nonzero(errors))
        receiver.error = int(errors[np.flatnonzero(errors)[-1]]) if errors.any() else 0
        receiver.distortion = max(0, int(records.distortion[rows].max()))
        receiver.worst_distortion = max(receiver.worst_distortion, receiver.distortion)
        self._measure_margin(receiver, station, records.position_mm[rows])

    def _measure_margin(self, receiver: Receiver, station: int, position_mm: npt.NDArray[np.float64]) -> None:
        vector = np.array(self._settings.hemisphere.get(station, (0.0, 0.0, 0.0)))
        length = np.linalg.norm(vector)
        if not length:
            return
        with np.errstate(invalid="ignore", divide="ignore"):
            margin = position_mm @ (vector / length) / np.linalg.norm(position_mm, axis=-1)
        receiver.margin = float(margin[-1])
        receiver.least_margin = float(np.fmin.reduce(margin, initial=receiver.least_margin))

    def _count_cycles(self, frame: Wholes) -> None:
        """Count cycles, those of which nothing came, and those that lack a receiver that was there before."""
        if not len(frame):
            return
        frames, counts = np.unique(frame, return_counts=True)
        held, count = self._open_cycle
        if frames[0] == held:
            counts[0] += count
        elif held >= 0:
            frames, counts = np.append(held, frames), np.append(count, counts)
        self._open_cycle = (int(frames[-1]), int(counts[-1]))
        self.cycles += len(frames) - 1
        partial = counts[:-1] < self._expected
        gaps = np.maximum(np.diff(frames) - 1, 0)
        gaps[gaps > ABSENT_S * self._settings.rate_hz] = 0  # told as an absence of every receiver
        self.partial_cycles += int(np.count_nonzero(partial))
        self.lost_cycles += int(gaps.sum())
        if len(gaps):
            self._before_open = (int(gaps[-1]), int(partial[-1]))
        recent = self._open_cycle[0] - ABSENT_S * self._settings.rate_hz
        there = sum((receiver.last_frame or 0) > recent for receiver in self.receivers.values())
        enough = self.cycles > ABSENT_S * self._settings.rate_hz
        self._expected = there if enough else self._expected

    def _measure_lag(self, block: Block, rows: Wholes) -> None:
        if not len(rows):
            return
        delay = block.host_ns[rows] - block.records.frame[rows] * (1e9 / self._settings.rate_hz)
        second = int(block.host_ns[rows[-1]] // 1_000_000_000)
        least = float(delay.min())
        if self._fastest and self._fastest[-1][0] == second:
            least = min(least, self._fastest.pop()[1])
        self._fastest.append((second, least))
        while self._fastest[0][0] < second - LAG_WINDOW_S:
            self._fastest.popleft()
        self._lag_ns = float(delay[-1]) - min(delay for _, delay in self._fastest)

    def _find_absent(self) -> None:
        """Note receivers that others have outlived."""
        latest_ns = max((receiver.last_host_ns for receiver in self.receivers.values()), default=0)
        for receiver in self.receivers.values():
            heard_ns = receiver.last_host_ns or self._start_ns
            if not receiver.is_absent and latest_ns - heard_ns > ABSENT_S * 1e9:
                receiver.absences.append((self._seconds(heard_ns), None))

    def _watch_silence(self, received_bytes: int, now_ns: int) -> None:
        """Note when nothing came at all."""
        open_since = self.silences[-1][0] if self.silences and self.silences[-1][1] is None else None
        if received_bytes:
            self._heard_ns = now_ns
            if open_since is not None:
                self.silences[-1] = (open_since, self._seconds(now_ns))
        elif open_since is None and now_ns - self._heard_ns > SILENT_S * 1e9:
            self.silences.append((self._seconds(self._heard_ns), None))

    def _remember(self, now_ns: int) -> None:
        records, lost = np.zeros(STATIONS, np.int64), np.zeros(STATIONS, np.int64)
        for station, receiver in self.receivers.items():
            records[station], lost[station] = receiver.records, receiver.lost
        self._past.append((now_ns, self.received_bytes, records, lost))
        while len(self._past) > 2 and now_ns - self._past[1][0] >= WINDOW_S * 1e9:
            self._past.popleft()

    def _seconds(self, host_ns: int) -> float:
        return (host_ns - self._start_ns) * 1e-9


def _number(value: float | None) -> float | None:
    """Round for people; JSON knows no NaN."""
    return None if value is None or not np.isfinite(value) else round(value, 3)
