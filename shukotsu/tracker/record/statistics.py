"""Counts of a recording while it is made: rates, what is lost, errors, distortion. No I/O here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.tracker.decode.losses import ABSENT_S, JITTER_S, Heard, Losses
from shukotsu.tracker.decode.stream import Block
from shukotsu.tracker.protocols.records import Wholes
from shukotsu.tracker.protocols.stream_settings import StreamSettings


@dataclass
class Receiver:
    """One receiver so far, beside what `Losses` counts.

    margin : p . h / |p|, the sine of how far it is within its half of space; NaN where the tracker follows
    it or it has no position.
    """

    errors: int = 0
    error: int = 0
    distortion: int = 0
    worst_distortion: int = 0
    margin: float = np.nan
    least_margin: float = np.nan
    last_host_ns: int = 0


class Statistics:
    """Counts what comes; start_ns is the host's monotonic time at which the stream was started.

    heard_ns : when the newest bytes were counted. told : receiver, from and to [s since the start] of each
    time that it was absent; 0 where nothing came for longer than jitter.
    """

    def __init__(self, settings: StreamSettings, start_ns: int) -> None:
        self.receivers = {station: Receiver() for station in settings.stations}
        self.skipped_bytes = self.received_bytes = 0
        self.told: list[tuple[int, float, float]] = []
        self._losses = Losses(settings)
        self._settings = settings
        self._start_ns = self.heard_ns = start_ns

    def add(self, block: Block, received_bytes: int, now_ns: int) -> None:
        """Count what was decoded of the bytes that came since the last call."""
        self.received_bytes += received_bytes
        self.skipped_bytes += sum(skip.size for skip in block.skipped)
        self.heard_ns = now_ns if received_bytes else self.heard_ns
        for station in np.unique(block.records.station).tolist():
            receiver = self.receivers.setdefault(station, Receiver())
            rows = np.flatnonzero((block.records.station == station) & block.good)
            if len(rows):
                self._count(receiver, station, block, rows)
        self.told += self._to_tell(self._losses.add(block)[0])

    def absent(self) -> set[int]:
        """Receivers that are silent while others are heard."""
        heard_ns = {s: receiver.last_host_ns or self._start_ns for s, receiver in self.receivers.items()}
        latest_ns = max((receiver.last_host_ns for receiver in self.receivers.values()), default=0)
        return {station for station, last_ns in heard_ns.items() if latest_ns - last_ns > ABSENT_S * 1e9}

    def totals(self, now_ns: int) -> dict[str, Any]:
        """Return the sums of the recording if nothing follows, as JSON types.

        lost_frames : lost records, in all and of each receiver; lost_cycles : lost frames (see `Losses`).
        silent_s, absent_s : from and to [s since the start], None for the end, when nothing came of any and
        of each receiver.
        """
        losses, gaps, _ = self._losses.closed()
        end_s, ends_s = self._seconds(now_ns), losses.silent_ends_s(self._start_ns, now_ns)
        told = [(0, 0.0, ends_s[0]), *self.told, *self._to_tell(gaps), (0, end_s - ends_s[1], end_s)]

        def silent(station: int, newest_ns: float) -> list[list[float | None]]:
            newest_s = min(self._seconds(newest_ns), end_s)
            stretches = [(a, b if a < newest_s else end_s) for s, a, b in told if s == station and b > a]
            return [[_number(a), _number(b) if b < end_s else None] for a, b in stretches]

        receivers = {}
        for station, receiver in sorted(self.receivers.items()):
            heard = losses.stations.get(station, Heard(0, 0, 0))
            receivers[str(station)] = {
                "records": heard.records,
                "lost_frames": heard.lost,
                "records_with_error": receiver.errors,
                "worst_distortion": receiver.worst_distortion,
                "least_hemisphere_margin": _number(receiver.least_margin),
                "absent_s": silent(station, heard.host_ns) if heard.records else [[0.0, None]],
            }
        return {
            "seconds": end_s,
            "records": losses.all.records,
            "lost_frames": sum(heard.lost for heard in losses.stations.values()),
            "lost_cycles": losses.all.lost,
            "cycles": losses.cycles,
            "partial_cycles": losses.partial_cycles,
            "skipped_bytes": self.skipped_bytes,
            "received_bytes": self.received_bytes,
            "silent_s": silent(0, np.inf),
            "receivers": receivers,
        }

    def _to_tell(self, gaps: Wholes) -> list[tuple[int, float, float]]:
        least = JITTER_S * self._settings.rate_hz
        return [
            (station, self._seconds(from_ns), self._seconds(to_ns))
            for station, first, last, from_ns, to_ns, absent in gaps.tolist()
            if absent or (station == 0 and last - first + 1 > least)
        ]

    def _count(self, receiver: Receiver, station: int, block: Block, rows: Wholes) -> None:
        records = block.records
        receiver.last_host_ns = int(block.host_ns[rows[-1]])
        errors = records.error[rows]
        receiver.errors += int(np.count_nonzero(errors))
        receiver.error = int(errors[np.flatnonzero(errors)[-1]]) if errors.any() else 0
        receiver.distortion = max(0, int(records.distortion[rows].max()))
        receiver.worst_distortion = max(receiver.worst_distortion, receiver.distortion)
        vector = np.array(self._settings.hemisphere.get(station, (0.0, 0.0, 0.0)))
        if vector.any():
            position_mm, direction = records.position_mm[rows], vector / np.linalg.norm(vector)
            with np.errstate(invalid="ignore", divide="ignore"):
                margin = position_mm @ direction / np.linalg.norm(position_mm, axis=-1)
            receiver.margin = float(margin[-1])
            receiver.least_margin = float(np.fmin.reduce(margin, initial=receiver.least_margin))

    def _seconds(self, host_ns: float) -> float:
        return (host_ns - self._start_ns) * 1e-9


def _number(value: float | None) -> float | None:
    """Round for people; JSON knows no NaN."""
    return None if value is None or not np.isfinite(value) else round(value, 3)
