"""Frame numbers that only grow: counters unwrapped, or cycles counted where a tracker has no counter.

LIBERTY, PATRIOT and VIPER count frames in 32 bits; FASTRAK and trakSTAR do not count;
OpenIGTLink may tell times.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.trackers.decode.cycles import LONGEST_GAP_S, Cycles, Stamps
from shukotsu.trackers.protocols.records import (
    NONE,
    Bools,
    Decoded,
    Records,
    Wholes,
    concatenated,
    empty_records,
)
from shukotsu.trackers.protocols.stream_settings import StreamSettings


class Counter:
    """Numbers the records of one stream, piece by piece, and holds back those that later ones decide.

    counts : whether the tracker numbers its frames itself; None before the first record.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self.counts: bool | None = None
        self._settings = settings
        self._cycles, self._stamps = Cycles(settings), Stamps(settings)
        self._rank = np.full(256, 0, np.int64)
        self._rank[list(settings.stations)] = np.arange(len(settings.stations))
        self._active = np.isin(np.arange(256), settings.stations)
        self._limit = int(LONGEST_GAP_S * settings.rate_hz)
        self._held = empty_records()
        self._held_host_ns = np.empty(0, np.int64)
        self._last: tuple[int, int, int] | None = None  # counter, frame, station of the last good one

    def number(self, decoded: Decoded, host_ns: Wholes, *, final: bool) -> tuple[Records, Wholes, Bools]:
        """Give the records that can be numbered, their arrivals, and which do not fit between neighbours."""
        records = concatenated([self._held, decoded.records])
        host_ns = np.concatenate([self._held_host_ns, host_ns])
        if self.counts is None and len(records):
            self.counts = bool(((records.frame != NONE) | (records.device_ms != NONE)).any())
        odd = np.zeros(len(records), bool)
        if self.counts:
            count = len(records) if final else max(0, len(records) - 1)
            frame = self._counted(records, odd, count) if count else records.frame
        elif (records.stamp_ns != NONE).any():
            count = len(records)
            frame, stamp_ns = self._stamps.number(records)
            records = replace(records, stamp_ns=stamp_ns)
        else:
            frame, count = self._cycles.number(records, host_ns, final=final)
        self._held, self._held_host_ns = records.take(slice(count, None)), host_ns[count:]
        return replace(records.take(slice(count)), frame=frame[:count]), host_ns[:count], odd[:count]

    def _counted(self, records: Records, odd: Bools, count: int) -> Wholes:
        """Unwrap what the tracker counts; of the first `count` records marks those that do not fit as odd."""
        counter = self._counters(records)
        odd |= self._spikes(counter)
        frame = self._unwrapped(counter, odd)
        odd |= self._out_of_order(frame, records.station, odd)
        good = np.flatnonzero(~odd[:count])
        if len(good):
            last = good[-1]
            self._last = (int(counter[last]), int(frame[last]), int(records.station[last]))
        return frame

    def _counters(self, records: Records) -> Wholes:
        """Count modulo 2^32, shape (N,): the tracker's frame count, or its clock."""
        if (records.frame != NONE).any():
            return records.frame & 0xFFFFFFFF
        # Its clock is floor(frame * 1000 / rate) [ms], so the frame is the next whole one.
        ticks = np.ceil((records.device_ms & 0xFFFFFFFF) * (self._settings.rate_hz / 1000) - 1e-6)
        return np.asarray(ticks.astype(np.int64) & 0xFFFFFFFF)

    def _spikes(self, counter: Wholes) -> Bools:
        """Counts that fit neither neighbour though these fit each other: a damaged byte, (N,)."""
        before = counter[0] if self._last is None else self._last[0]
        back = _signed(counter - np.concatenate([[before], counter[:-1]]))
        ahead = _signed(np.concatenate([counter[1:], counter[-1:]]) - counter)
        around = _signed(back + ahead)
        odd = ((back < 0) | (ahead < 0)) & (around >= 0) & (around < self._limit)
        odd[0] &= self._last is not None
        return odd

    def _unwrapped(self, counter: Wholes, odd: Bools) -> Wholes:
        good = np.flatnonzero(~odd)
        if self._last is None:
            known = frame = int(counter[good[0]]) if len(good) else 0
        else:
            known, frame = self._last[0], self._last[1]
        step = _signed(np.diff(counter[good], prepend=known))
        step[(step < 0) | (step > self._limit)] = 1
        frames = np.full(len(counter), frame)
        frames[good] = frame + np.cumsum(step)
        # A count that is damaged takes that of the record before, for something must stand there.
        return np.asarray(np.maximum.accumulate(frames))

    def _out_of_order(self, frame: Wholes, station: Wholes, odd: Bools) -> Bools:
        """Stations that do not ascend within a frame, (N,): of two the one without which they do.

        Where they do without either, the first is right if it is the station that was due.
        """
        good = np.flatnonzero(~odd)
        frame, station = frame[good], station[good]
        if self._last is not None:
            frame = np.concatenate([[self._last[1]], frame])
            station = np.concatenate([[self._last[2]], station])
        clash = np.flatnonzero((np.diff(frame) == 0) & (np.diff(station) <= 0))
        first_is_wrong = _ascends(frame, station, clash - 1, clash + 1)
        either = first_is_wrong & _ascends(frame, station, clash, clash + 2)
        first_is_wrong[either & self._was_due(frame, station, clash)] = False
        if self._last is not None:
            first_is_wrong[clash == 0] = False  # that of the piece before was found in order
        wrong = np.where(first_is_wrong, clash, clash + 1) - (self._last is not None)
        found = np.zeros(len(odd), bool)
        found[good[wrong]] = True
        return found

    def _was_due(self, frame: Wholes, station: Wholes, rows: Wholes) -> Bools:
        """Tell whether the station is the active one after that of the record before, or a frame's first."""
        before = np.maximum(rows - 1, 0)
        same = (frame[before] == frame[rows]) & (rows > 0)
        due = np.where(same, self._rank[station[before]] + 1, 0)
        return np.asarray((self._rank[station[rows]] == due) & self._active[station[rows]])


def _ascends(frame: Wholes, station: Wholes, first: Wholes, second: Wholes) -> Bools:
    """Whether the stations of two records ascend, or need not: another frame, or one is not there; (M,)."""
    there = (first >= 0) & (second < len(frame))
    first, second = np.maximum(first, 0), np.minimum(second, len(frame) - 1)
    return np.asarray(~there | (frame[first] != frame[second]) | (station[first] < station[second]))


def _signed(difference: Wholes) -> Wholes:
    """Differences of 32-bit counts, the short way round."""
    return (difference + 0x80000000 & 0xFFFFFFFF) - 0x80000000
