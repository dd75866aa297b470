"""Frames of trackers that do not count them: cycles, told by stations and missing bytes, and by the arrivals.

What did not come shows in the arrivals alone. Bytes that were late come at once when they come, and with them
the stream is as early as before; where all that follows a gap is later than what came before it, the
difference was lost.
"""

from __future__ import annotations

import numpy as np

from shukotsu.trackers.protocols.records import NONE, Array, Records, Wholes
from shukotsu.trackers.protocols.stream_settings import StreamSettings

JITTER_S = 0.1
"""Arrivals are so much apart though nothing is lost; or two periods, where these are longer."""

LONGEST_GAP_S = 86_400.0
"""A count or clock that jumps by more than a day was not running: it was set anew."""

WINDOW_S = 1.0
"""What comes so long before and behind a gap in the arrivals tells how late the host was."""

OWN_PACE = 0.05
"""A pace that differs by less from the nominal one cannot be told from it in so short a time."""


class Cycles:
    """Numbers the records of one stream, piece by piece; those behind a gap wait until it is decided."""

    def __init__(self, settings: StreamSettings) -> None:
        self._stations = np.sort(np.array(settings.stations or (1,)))
        self._period_ns = 1e9 / settings.rate_hz
        self._shortest_ns = max(JITTER_S * 1e9, 2 * self._period_ns)
        self._window_ns = max(WINDOW_S * 1e9, 4 * self._period_ns)
        self._end = 0  # first byte behind the newest good record
        self._station = 0
        self._cycle = 0
        self._past = np.empty(
            (2, 0)
        )  # of good records, the newest one among them: arrival [ns], place [cycles]

    def number(self, records: Records, host_ns: Wholes, *, final: bool) -> tuple[Wholes, int]:
        """Give the frames of records, (N,), and of how many of them they are decided.

        A doubtful record is as good as missing; it has the frame of the good one before.
        """
        good = np.flatnonzero(~records.doubtful)
        old, before = self._past.shape[1], int(self._past[1, -1]) if self._past.size else 0
        arrival = np.maximum.accumulate(np.append(self._past[0], host_ns[good]))
        place = np.append(self._past[1], before + self._places(records.take(good)))
        decided = len(good)
        for row in np.flatnonzero(np.diff(arrival) > self._shortest_ns) + 1:
            if row < old:
                continue
            if not final and arrival[-1] < arrival[row] + self._window_ns:
                decided = int(row) - old
                break
            place[row:] += self._lost(arrival, place, int(row))
        frame = np.append(before, place[old:].astype(np.int64))[np.cumsum(~records.doubtful)]
        if decided:
            newest = good[decided - 1]
            self._end = int(records.offset[newest] + records.size[newest])
            self._station, self._cycle = int(records.station[newest]), int(records.cycle[newest])
            known = arrival[: old + decided]
            recent = int(np.searchsorted(known, known[-1] - 2 * self._window_ns))
            self._past = np.stack([known, place[: old + decided]])[:, recent:]
        return frame, len(records) if decided == len(good) else int(good[decided])

    def _places(self, records: Records) -> Array:
        """Cycles since that of the newest known record, and how far each record is in its own, (N,)."""
        if (records.cycle != NONE).any():  # the source says which records belong together
            known = self._cycle if self._past.size else int(records.cycle[0])
            return np.asarray(records.cycle - known, float)
        count = len(self._stations)
        station = np.append(self._station, records.station)
        rank = np.minimum(np.searchsorted(self._stations, station), count - 1)
        missing = records.offset - np.append(self._end, records.offset + records.size)[:-1]
        lost = np.round(missing / np.maximum(records.size, 1))
        turns = np.round((rank[:-1] + 1 + lost - rank[1:]) / count)
        step = np.maximum(np.where(lost > 0, turns, 0), np.diff(station) <= 0)
        if not self._past.size:  # the first record begins the count
            step[:1] = 0
        return np.asarray(np.cumsum(step) + rank[1:] / count)

    def _lost(self, arrival: Array, place: Array, row: int) -> int:
        """Cycles that did not come: all that follows a gap is so much later than what came before it.

        Their period is that of the two windows before where it clearly is not the nominal one.
        """
        period_ns, late = self._period_ns, arrival - place * self._period_ns
        edges = arrival[row - 1] - self._window_ns * np.array([2, 1])
        first, second = (int(edge) for edge in np.searchsorted(arrival, edges))
        behind = int(np.searchsorted(arrival, arrival[row] + self._window_ns, side="right"))
        if first < second:
            a, b = first + int(np.argmin(late[first:second])), second + int(np.argmin(late[second:row]))
            own_ns = (arrival[b] - arrival[a]) / (place[b] - place[a])
            clear = arrival[b] - arrival[a] > self._window_ns / 2 and abs(own_ns / period_ns - 1) > OWN_PACE
            period_ns = own_ns if clear else period_ns
        late = arrival - place * period_ns
        lost_ns = late[row:behind].min() - late[second:row].min()
        return round(lost_ns / period_ns) if self._shortest_ns < lost_ns < LONGEST_GAP_S * 1e9 else 0


class Stamps:
    """Numbers the frames of a source that tells their times, piece by piece.

    Of settings.options: `steady`: whether frames come at the nominal rate so evenly that one that is missing
    shows; otherwise only a gap of JITTER_S (two periods, if longer) does.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self._period_ns = round(1e9 / settings.rate_hz)
        jitter_ns = 1.5 * self._period_ns
        if not settings.options.get("steady"):
            jitter_ns = max(JITTER_S * 1e9, 2 * self._period_ns)
        self._shortest_ns = jitter_ns
        self._last: tuple[int, int, int, int] | None = None  # cycle, stamp, frame, time of the newest record

    def number(self, records: Records) -> tuple[Wholes, Wholes]:
        """Give the frames of records and their times since the first [ns], (N,).

        A stamp that goes back, or on by more than a day, is of a clock that was set: a period has passed.
        """
        if not len(records):
            return records.frame, records.stamp_ns
        if self._last is None:
            self._last = (int(records.cycle[0]), int(records.stamp_ns[0]), 0, 0)
        cycle, stamp_ns, frame, time_ns = self._last
        is_first = np.diff(records.cycle, prepend=cycle) != 0
        step_ns = np.diff(records.stamp_ns[is_first], prepend=stamp_ns)
        step_ns[(step_ns <= 0) | (step_ns > LONGEST_GAP_S * 1e9)] = self._period_ns
        steps = np.where(step_ns > self._shortest_ns, np.rint(step_ns / self._period_ns), 1).astype(np.int64)
        row = np.cumsum(is_first)
        frames = np.cumsum(np.append(frame, steps))[row]
        times_ns = np.cumsum(np.append(time_ns, step_ns))[row]
        stamp_ns = int(np.append(stamp_ns, records.stamp_ns[is_first])[-1])
        self._last = (int(records.cycle[-1]), stamp_ns, int(frames[-1]), int(times_ns[-1]))
        return frames, times_ns
