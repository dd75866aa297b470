"""Read an archive as blocks of records with unwrapped counters and arrival times, and count lost records."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Bools, Integers
from shukotsu.errors import InputError
from shukotsu.tracker import records as protocol
from shukotsu.tracker.archive import END, EVENT, RECEIVED, SETTINGS, Archive, Piece
from shukotsu.tracker.liberty import BinaryDecoder
from shukotsu.tracker.records import Records, StreamSettings
from shukotsu.tracker.viper_decoder import ViperDecoder

LONGEST_GAP_S = 86_400.0
"""Largest jump of a counter or clock; a larger one means that it was reset."""
BLOCK_BYTES = 4 << 20
DECODERS: Mapping[str, Callable[[StreamSettings], protocol.PiecewiseDecoder]]
DECODERS = {"liberty": BinaryDecoder, "patriot": BinaryDecoder, "viper": lambda _: ViperDecoder()}


@dataclass(frozen=True)
class RecordBlock:
    """Records of one section of the stream.

    records : offsets count from the first byte after the settings; frames are unwrapped.
    host_ns : (N,) host time at which the record's last byte had arrived.
    out_of_order : (N,) whether its station or frame does not fit between its neighbours'.
    """

    settings: StreamSettings
    records: Records
    host_ns: Integers
    out_of_order: Bools
    skipped: tuple[protocol.Skipped, ...]

    @property
    def good(self) -> Bools:
        """Whether each record's frame, station and numbers are plausible, (N,)."""
        return np.asarray(~(self.records.doubtful | self.out_of_order))


@dataclass
class Tally:
    """Other content of an archive than records; filled while its blocks are read.

    started_ns, ended_ns : start and end of the stream by the host's clock.
    """

    summary: Mapping[str, Any] | None = None
    spoilt_bytes: int = 0
    unreadable_bytes: int = 0
    missing_rows: int = 0
    received_bytes: int = 0
    started_ns: int = 0
    ended_ns: int = 0
    first_utc_offset_ns: int | None = None
    utc_offset_range_ns: int = 0


class PieceReader:
    """Reader of an archive's rows: bytes received after the settings are decoded, other rows are tallied.

    decoder : None before the settings. Raises InputError if the settings occur twice or cannot be read.
    """

    def __init__(self, path: Path, tally: Tally) -> None:
        self.path, self.tally = path, tally
        self.decoder: ChunkDecoder | None = None

    def add(self, piece: Piece) -> None:
        """Process the next piece."""
        tally = self.tally
        tally.spoilt_bytes += piece.spoilt_bytes
        tally.unreadable_bytes += piece.unreadable_bytes
        tally.missing_rows += piece.missing_rows
        if len(piece.kind):
            if tally.first_utc_offset_ns is None:
                tally.first_utc_offset_ns = int(piece.utc_offset_ns[0])
            moved_ns = int(np.abs(piece.utc_offset_ns - tally.first_utc_offset_ns).max())
            tally.utc_offset_range_ns = max(tally.utc_offset_range_ns, moved_ns)
        for kind, data, host_ns in zip(piece.kind.tolist(), piece.data, piece.host_ns.tolist(), strict=True):
            if kind == SETTINGS:
                if self.decoder is not None:
                    raise InputError(
                        f"{self.path}: contains the tracker's settings twice; expected one recording"
                    )
                self.decoder = ChunkDecoder(protocol.settings_from_json(self._entry(data), str(self.path)))
                tally.started_ns = host_ns
            elif kind == EVENT:
                event = self._entry(data).get("event")
                if event == "started":
                    tally.started_ns = host_ns
                elif event == "stopped":
                    tally.ended_ns = host_ns
            elif kind == END:
                tally.summary = self._entry(data)
                tally.ended_ns = tally.ended_ns or host_ns
            elif kind == RECEIVED:
                tally.received_bytes += len(data)
                if self.decoder is not None:
                    self.decoder.add(data, host_ns)

    def _entry(self, data: bytes) -> dict[str, Any]:
        """Parse an entry of the recorder. Raises InputError if it is not a JSON object."""
        try:
            loaded = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{self.path}: an entry of the recorder in it is not JSON ({error})") from error
        if not isinstance(loaded, dict):
            raise InputError(f"{self.path}: an entry of the recorder in it is {loaded!r}; expected an object")
        return loaded


def blocks_of(archive: Archive, tally: Tally, block_bytes: int = BLOCK_BYTES) -> Iterator[RecordBlock]:
    """Decode an archive block by block, and fill `tally`.

    Raises InputError if the archive has no settings, has them twice, or has settings that cannot be read.
    """
    reader = PieceReader(archive.path, tally)
    for piece in archive.pieces():
        reader.add(piece)
        if reader.decoder is not None and reader.decoder.waiting_bytes >= block_bytes:
            yield reader.decoder.decode(final=False)
    if reader.decoder is None:
        raise InputError(
            f"{archive.path}: ends before the tracker was set up, so it has no poses; record again"
        )
    yield reader.decoder.decode(final=True)


class ChunkDecoder:
    """Decoder of the chunks of bytes received after the settings."""

    def __init__(self, settings: StreamSettings) -> None:
        self.settings = settings
        self.waiting_bytes = 0
        self._decoder = DECODERS[settings.family](settings)
        self._counter = Counter(settings)
        self._waiting: list[bytes] = []
        self._length = 0
        self._ends: list[int] = []
        self._arrivals: list[int] = []

    def add(self, data: bytes, host_ns: int) -> None:
        """Add a chunk; host_ns : the host's time of its arrival."""
        self._waiting.append(data)
        self.waiting_bytes += len(data)
        self._length += len(data)
        self._ends.append(self._length)
        self._arrivals.append(host_ns)

    def decode(self, *, final: bool) -> RecordBlock:
        """Decode the waiting chunks; final : whether they are the last, so that no bytes are kept."""
        decoded = self._decoder.feed(b"".join(self._waiting), final=final)
        self._waiting, self.waiting_bytes = [], 0
        records = decoded.records
        arrival = np.searchsorted(self._ends, records.offset + records.size)
        host_ns = np.array(self._arrivals, np.int64)[arrival]
        first = bisect_left(self._ends, self._decoder.offset)
        del self._ends[:first], self._arrivals[:first]
        records, host_ns, out_of_order = self._counter.number(records, host_ns, final=final)
        return RecordBlock(self.settings, records, host_ns, out_of_order, decoded.skipped)


class Counter:
    """Assigns frame numbers to a stream's records, piece by piece; the last two wait for later records."""

    def __init__(self, settings: StreamSettings) -> None:
        self._settings = settings
        self._rank = {station: rank for rank, station in enumerate(settings.stations)}
        self._limit = int(LONGEST_GAP_S * settings.rate_hz)
        self._held = protocol.empty_records()
        self._held_host_ns = np.empty(0, np.int64)
        self._last: tuple[int, int, int] | None = None  # counter, frame, station of the last good record

    def number(self, records: Records, host_ns: Integers, *, final: bool) -> tuple[Records, Integers, Bools]:
        """Return the records that can be numbered, their arrival times, and which contradict neighbours."""
        records = protocol.concatenate_records([self._held, records])
        host_ns = np.concatenate([self._held_host_ns, host_ns])
        odd = np.zeros(len(records), bool)
        count = len(records) if final else max(0, len(records) - 2)
        frame = self._counted(records, odd, count) if count else records.frame
        self._held, self._held_host_ns = records.take(slice(count, None)), host_ns[count:]
        return replace(records.take(slice(count)), frame=frame[:count]), host_ns[:count], odd[:count]

    def _counted(self, records: Records, odd: Bools, count: int) -> Integers:
        """Unwrap the tracker's frame counter, or else its clock; mark records that do not fit in `odd`.

        count : number of records, from the first, that can be decided.
        """
        counter = records.frame & 0xFFFFFFFF
        if not (records.frame != protocol.NONE).any():
            # The clock is floor(frame * 1000 / rate) in ms, so the frame is found by rounding up.
            ticks = np.ceil((records.device_ms & 0xFFFFFFFF) * (self._settings.rate_hz / 1000) - 1e-6)
            counter = ticks.astype(np.int64) & 0xFFFFFFFF
        station, earlier = records.station, int(self._last is not None)
        if self._last is not None:
            counter, station = np.append(self._last[0], counter), np.append(self._last[2], station)
        odd |= self._misfits(counter, station, earlier)[earlier:]
        good = np.flatnonzero(~odd[:count]) + earlier
        frame = np.full(len(counter), 0 if self._last is None else self._last[1])
        if len(good):
            step = _signed_difference(np.diff(counter[good], prepend=counter[0 if earlier else good[0]]))
            step[(step < 0) | (step > self._limit)] = 1
            frame[good] = (frame[0] if earlier else counter[good[0]]) + np.cumsum(step)
            last = good[-1]
            self._last = (int(counter[last]), int(frame[last]), int(station[last]))
        # Records with a damaged counter get the frame of the previous record as a placeholder.
        return np.asarray(np.maximum.accumulate(frame)[earlier:])

    def _misfits(self, counter: Integers, station: Integers, earlier: int) -> Bools:
        """Return which records do not fit between their neighbours, (N,); the first `earlier` are good.

        If a record cannot follow the previous one, one of the two is wrong: the one without which the others
        fit. If the others fit without either of them, the first one is kept if it was due; if removing one
        does not help, the counter restarted and both are kept. The decision uses only the last good record
        before the two and the next record after each.
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
            was_due = first_fits and self._was_due(counter, station, before, first)
            if second_fits and first >= earlier and not was_due:
                wrong[first] = True
            elif first_fits:
                wrong[first + 1], before = True, first
        return wrong

    def _follows(
        self, counter: Integers, station: Integers, first: Integers | int, second: Integers | int
    ) -> Bools:
        """Return whether records can follow others: in a later frame, or a later station of the same one."""
        step = _signed_difference(counter[second] - counter[first])
        later = (step > 0) | ((step == 0) & (station[second] > station[first]))
        return np.asarray(later & (step <= self._limit))

    def _was_due(self, counter: Integers, station: Integers, before: int, row: int) -> bool:
        """Return whether record `row` is the next one expected after `before` (-1: the first of a frame)."""
        passed = self._rank.get(int(station[row]), 0)
        if before >= 0:
            frames = int(_signed_difference(counter[row] - counter[before]))
            passed += frames * len(self._settings.stations) - self._rank.get(int(station[before]), 0) - 1
        return passed == 0 and int(station[row]) in self._rank


def _signed_difference(difference: Integers) -> Integers:
    """Return differences of 32-bit counters modulo 2^32, as signed numbers."""
    return (difference + 0x80000000 & 0xFFFFFFFF) - 0x80000000


ABSENT_S = 1.0
"""Silence of a receiver, while others send, after which it counts as unplugged, not as losing records."""
JITTER_S = 0.1
"""Largest interval between arrivals without loss."""
STOP_FRAMES = 2
"""Number of frames by which some trackers' last frame follows the cycle that a stop cut short."""
NOTHING, NO_ROWS = np.empty(0, np.int64), np.empty((3, 0), np.int64)


@dataclass
class Heard:
    """Counts of good and lost records of one receiver or of all, and the newest record's frame and cycle."""

    frame: int
    cycle: int
    host_ns: int
    records: int = 0
    lost: int = 0


class Losses:
    """Counts of good and lost records of a stream, independent of how it is cut into pieces.

    A frame between the first and the last is lost if no receiver has a record of it. A record is lost if its
    receiver lacks the frame, unless the receiver is absent: it lacks all cycles of the others for ABSENT_S or
    longer. A cycle is partial if a record of it is lost. The newest cycle is counted when the next one
    begins.
    """

    def __init__(self, settings: StreamSettings) -> None:
        self.stations: dict[int, Heard] = {}
        self.all = Heard(-1, -1, 0)
        self.cycles = self.first_frame = self.first_ns = 0
        self._limit = max(1, round(ABSENT_S * settings.rate_hz))
        self._newest = NO_ROWS
        self._recent = NOTHING  # frames of the last cycles, which may still turn out to be partial
        self._lacking = np.empty(0, bool)  # which of them are already known to be partial
        self.partial_cycles = 0

    def closed(self) -> tuple[Losses, Integers, Integers]:
        """Return the counts as if the stream ended here, with the gaps and partial frames that this adds."""
        losses = deepcopy(self)
        return losses, *losses._add(NO_ROWS, final=True)

    def silent_ends_s(self, start_ns: int, end_ns: int) -> tuple[float, float]:
        """Return the silence after the start and before the end in s; 0 if shorter than ABSENT_S."""
        first_ns, last_ns = (self.first_ns, self.all.host_ns) if self.cycles else (end_ns, end_ns)
        before_s, after_s = (first_ns - start_ns) * 1e-9, (end_ns - last_ns) * 1e-9
        return before_s if before_s > ABSENT_S else 0.0, after_s if after_s > ABSENT_S else 0.0

    @property
    def newest_frame(self) -> int:
        """Newest frame with a good record; 0 without records."""
        return int(self._newest[0, -1]) if self._newest.size else 0

    def add(self, block: RecordBlock) -> tuple[Integers, Integers]:
        """Count a block's good records; return the gaps that have ended, and new partial frames.

        Columns of the gaps, (G, 6): station (0: no station has records), first and last frame without a good
        record, arrival times in ns of the records before and after, whether the station was absent.
        """
        rows = np.stack([block.records.frame, block.records.station, block.host_ns])
        return self._add(rows[:, block.good], final=False)

    def _add(self, rows: Integers, *, final: bool) -> tuple[Integers, Integers]:
        """Count records (frame, station, host_ns), (3, N); final : whether none follow."""
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
        end = rows[:, -1:] if final else NO_ROWS  # records missing from a cut cycle are not lost
        for number in sorted({*station.tolist(), *(self.stations if final else ())}):
            heard = self.stations.setdefault(number, Heard(self.first_frame - 1, -1, self.first_ns))
            gaps.append(self._gaps(number, heard, rows[:, station == number], end))
        self.all.frame = last
        old = max(0, len(self._recent) - (0 if final else self._limit))
        partial = self._recent[:old][self._lacking[:old]]
        self.partial_cycles += len(partial)
        self._recent, self._lacking = self._recent[old:], self._lacking[old:]
        return np.concatenate(gaps), partial

    def _gaps(self, station: int, heard: Heard, rows: Integers, end: Integers = NO_ROWS) -> Integers:
        """Count a station's good and lost records; return its gaps up to these records and the end."""
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
