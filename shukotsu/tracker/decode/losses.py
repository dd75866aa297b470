"""The one count of what a stream lacks: for the recorder while it comes, for the decoder from the archive."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from shukotsu.tracker.decode.stream import Block
from shukotsu.tracker.protocols.records import Wholes
from shukotsu.tracker.protocols.stream_settings import StreamSettings

ABSENT_S = 1.0
"""A receiver that others outlive by more was unplugged (it takes about a second to be found again)."""

JITTER_S = 0.1
"""Arrivals are so much apart though nothing is lost."""

STOP_FRAMES = 2
"""A stop cuts the cycle in which it comes, and some trackers answer it with a last frame so much later."""

NOTHING, NO_ROWS = np.empty(0, np.int64), np.empty((3, 0), np.int64)


@dataclass
class Heard:
    """One receiver so far, or all: its newest record and in which cycle; its good and its lost records."""

    frame: int
    cycle: int
    host_ns: int
    records: int = 0
    lost: int = 0


class Losses:
    """Counts a stream's good records and what lies between them, however it is cut into pieces.

    Frames are lost of which nothing came, from the first to the last one that did. A record is lost where its
    receiver lacks frames; but where others have ABSENT_S of these, it was absent. A cycle is partial that
    lacks a lost record. The newest cycle waits for the next one.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self.stations: dict[int, Heard] = {}
        self.all = Heard(-1, -1, 0)
        self.cycles = self.first_frame = self.first_ns = 0
        self._limit = max(1, round(ABSENT_S * settings.rate_hz))
        self._newest = NO_ROWS
        self._recent = NOTHING  # frames of the last cycles, which may still turn out to be partial
        self._lacking = np.empty(0, bool)  # which of these are so by now
        self._partial_cycles = 0

    @property
    def partial_cycles(self) -> int:
        """Return how many cycles lack a lost record."""
        return self._partial_cycles + int(np.count_nonzero(self._lacking))

    def closed(self) -> tuple[Losses, Wholes, Wholes]:
        """Return the count if nothing follows, and what that finds (see `add`)."""
        losses = deepcopy(self)
        return losses, *losses._add(NO_ROWS, final=True)

    def silent_ends_s(self, start_ns: int, end_ns: int) -> tuple[float, float]:
        """Return how long [s] nothing came after the start and before the end; 0: less than ABSENT_S."""
        first_ns, last_ns = (self.first_ns, self.all.host_ns) if self.cycles else (end_ns, end_ns)
        before_s, after_s = (first_ns - start_ns) * 1e-9, (end_ns - last_ns) * 1e-9
        return before_s * (before_s > ABSENT_S), after_s * (after_s > ABSENT_S)

    @property
    def newest_frame(self) -> int:
        """Return the newest good frame; 0 where there is none."""
        return int(self._newest[0, -1]) if self._newest.size else 0

    def add(self, block: Block) -> tuple[Wholes, Wholes]:
        """Count a block's good records.

        Return the gaps that have ended, (G, 6): station (0: of none at all), first and last frame without a
        good record of it, when [ns] those around had come, whether it was absent; and the partial frames.
        """
        rows = np.stack([block.records.frame, block.records.station, block.host_ns])
        return self._add(rows[:, block.good], final=False)

    def _add(self, rows: Wholes, *, final: bool) -> tuple[Wholes, Wholes]:
        """Count records in turn, (3, N); `final` says that none follow."""
        rows = np.concatenate([self._newest, rows], 1)
        newest = int(np.searchsorted(rows[0], rows[0, -1])) if rows.shape[1] else 0
        taken = rows.shape[1] if final else newest
        rows, self._newest = rows[:, :taken].copy(), rows[:, taken:]
        frame, station, host_ns = rows
        if not taken:
            return np.empty((0, 6), np.int64), NOTHING
        if not self.cycles:
            self.first_frame, self.first_ns = int(frame[0]), int(host_ns[0])
            self.all = Heard(self.first_frame - 1, -1, self.first_ns)
        before, last = int(frame[newest - 1]) if newest else self.all.frame, int(frame[-1])
        if final and last - before - 1 <= STOP_FRAMES:
            frame[newest:] = before + 1
        self._recent = np.append(self._recent, np.unique(frame))
        new = len(self._recent) - len(self._lacking)
        self._lacking = np.append(self._lacking, np.zeros(new, bool))
        self.cycles += new
        gaps = [self._gaps(0, self.all, rows)]
        end = rows[:, -1:] if final else NO_ROWS  # a cycle that is cut lacks nothing
        for number in sorted({*station.tolist(), *(self.stations if final else ())}):
            heard = self.stations.setdefault(number, Heard(self.first_frame - 1, -1, self.first_ns))
            gaps.append(self._gaps(number, heard, rows[:, station == number], end))
        self.all.frame = last
        old = max(0, len(self._recent) - (0 if final else self._limit))
        partial = self._recent[:old][self._lacking[:old]]
        self._partial_cycles += len(partial)
        self._recent, self._lacking = self._recent[old:], self._lacking[old:]
        return np.concatenate(gaps), partial

    def _gaps(self, station: int, heard: Heard, rows: Wholes, end: Wholes = NO_ROWS) -> Wholes:
        """Return the gaps of a station up to its records and the end; count what came and what is lost."""
        count = rows.shape[1]
        heard.records += count
        frame, _, host_ns = np.concatenate([[[heard.frame], [0], [heard.host_ns]], rows, end], 1)
        first_cycle = self.cycles - len(self._recent)
        cycle = np.append(heard.cycle, first_cycle + np.searchsorted(self._recent, frame[1:]))
        at = np.flatnonzero(np.diff(frame) > 1)
        absent = cycle[at + 1] - cycle[at] - 1 >= self._limit
        lost = at[~absent]
        heard.lost += int((frame[lost + 1] - frame[lost] - 1).sum())
        changes = np.zeros(len(self._recent) + 1, np.int64)
        np.add.at(changes, cycle[lost] + 1 - first_cycle, 1)
        np.add.at(changes, cycle[lost + 1] - first_cycle, -1)
        self._lacking |= np.cumsum(changes)[:-1] > 0
        heard.frame, heard.cycle, heard.host_ns = (int(each[count]) for each in (frame, cycle, host_ns))
        ends = (frame[at] + 1, frame[at + 1] - 1, host_ns[at], host_ns[at + 1])
        return np.stack([np.full(len(at), station), *ends, absent], -1).astype(np.int64)
