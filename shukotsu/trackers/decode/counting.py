"""Frame numbers that only grow: the tracker's counter, of 32 bits, or its clock, unwrapped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.trackers.protocols.records import NONE, Bools, Records, Wholes, concatenated, empty_records
from shukotsu.trackers.protocols.stream_settings import StreamSettings

LONGEST_GAP_S = 86_400.0
"""A count or clock that jumps by more than a day was not running: it was set anew."""


class Counter:
    """Numbers the records of one stream, piece by piece, and holds back those that later ones decide."""

    def __init__(self, settings: StreamSettings) -> None:
        self._settings = settings
        self._rank = np.full(256, 0, np.int64)
        self._rank[list(settings.stations)] = np.arange(len(settings.stations))
        self._active = np.isin(np.arange(256), settings.stations)
        self._limit = int(LONGEST_GAP_S * settings.rate_hz)
        self._held = empty_records()
        self._held_host_ns = np.empty(0, np.int64)
        self._last: tuple[int, int, int] | None = None  # counter, frame, station of the last good one

    def number(self, records: Records, host_ns: Wholes, *, final: bool) -> tuple[Records, Wholes, Bools]:
        """Return the records that can be numbered, their arrivals, and which do not fit their neighbours."""
        records = concatenated([self._held, records])
        host_ns = np.concatenate([self._held_host_ns, host_ns])
        odd = np.zeros(len(records), bool)
        count = len(records) if final else max(0, len(records) - 2)
        frame = self._counted(records, odd, count) if count else records.frame
        self._held, self._held_host_ns = records.take(slice(count, None)), host_ns[count:]
        return replace(records.take(slice(count)), frame=frame[:count]), host_ns[:count], odd[:count]

    def _counted(self, records: Records, odd: Bools, count: int) -> Wholes:
        """Unwrap what the tracker counts; of the first `count` records marks those that do not fit as odd."""
        counter, station, earlier = self._counters(records), records.station, int(self._last is not None)
        if self._last is not None:
            counter, station = np.append(self._last[0], counter), np.append(self._last[2], station)
        odd |= self._misfits(counter, station, earlier)[earlier:]
        good = np.flatnonzero(~odd[:count]) + earlier
        frame = np.full(len(counter), 0 if self._last is None else self._last[1])
        if len(good):
            step = _signed(np.diff(counter[good], prepend=counter[0 if earlier else good[0]]))
            step[(step < 0) | (step > self._limit)] = 1
            frame[good] = (frame[0] if earlier else counter[good[0]]) + np.cumsum(step)
            last = good[-1]
            self._last = (int(counter[last]), int(frame[last]), int(station[last]))
        # A count that is damaged takes that of the record before, for something must stand there.
        return np.asarray(np.maximum.accumulate(frame)[earlier:])

    def _counters(self, records: Records) -> Wholes:
        """Count modulo 2^32, shape (N,): the tracker's frame count, or its clock."""
        if (records.frame != NONE).any():
            return records.frame & 0xFFFFFFFF
        # Its clock is floor(frame * 1000 / rate) [ms], so the frame is the next whole one.
        ticks = np.ceil((records.device_ms & 0xFFFFFFFF) * (self._settings.rate_hz / 1000) - 1e-6)
        return np.asarray(ticks.astype(np.int64) & 0xFFFFFFFF)

    def _misfits(self, counter: Wholes, station: Wholes, earlier: int) -> Bools:
        """Records that do not fit between their neighbours, (N,); the first `earlier` are good.

        Where a record cannot follow the one before, that of the two is wrong without which all fit. Where all
        fit without either, the first is right if it was due; where without neither, the tracker counts anew.
        The good one before a record and the two behind it decide, and nothing else.
        """
        wrong, before, end = np.zeros(len(counter), bool), -1, len(counter) - 1
        breaks = np.flatnonzero(~self._follows(counter, station, np.arange(end), np.arange(end) + 1))
        for first in breaks.tolist():
            if wrong[first]:
                continue
            if not first or not wrong[first - 1]:
                before = first - 1
            second_fits = before < 0 or self._follows(counter, station, before, first + 1)
            first_fits = first + 1 == end or self._follows(counter, station, first, first + 2)
            first_is_right = first < earlier or (
                first_fits and self._was_due(counter, station, before, first)
            )
            if second_fits and not first_is_right:
                wrong[first] = True
            elif first_fits:
                wrong[first + 1], before = True, first
        return wrong

    def _follows(self, counter: Wholes, station: Wholes, first: Wholes | int, second: Wholes | int) -> Bools:
        """Whether records can come after others: of a later frame, or a later station of the same."""
        step = _signed(counter[second] - counter[first])
        later = (step > 0) | ((step == 0) & (station[second] > station[first]))
        return np.asarray(later & (step <= self._limit))

    def _was_due(self, counter: Wholes, station: Wholes, before: int, row: int) -> bool:
        """Whether a record is the very next after another (-1: the first of a frame), none left out."""
        passed = int(self._rank[station[row]])
        if before >= 0:
            frames = _signed(counter[row] - counter[before])
            passed += frames * len(self._settings.stations) - self._rank[station[before]] - 1
        return bool(passed == 0 and self._active[station[row]])


def _signed(difference: Wholes) -> Wholes:
    """Differences of 32-bit counts, the short way round."""
    return (difference + 0x80000000 & 0xFFFFFFFF) - 0x80000000
