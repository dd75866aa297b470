"""First pass over an archive: the clock, and everything that is lost or doubtful, with its place."""

from __future__ import annotations

from collections import Counter as Count
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.archive import Archive
from shukotsu.trackers.decode.clock import DeviceClock, fit_clock
from shukotsu.trackers.decode.stream import Block, Tally, blocks_of
from shukotsu.trackers.protocols.records import Wholes
from shukotsu.trackers.protocols.stream_settings import StreamSettings

SHORT_GAP_S = 1.0
"""A receiver that is silent for longer was unplugged (it takes about a second to be found again)."""


@dataclass
class Sightings:
    """Records of one kind: how many of each station, and the first and last frame in which one stood."""

    records: Count[int] = field(default_factory=Count)
    first: int = 0
    last: int = 0

    @property
    def total(self) -> int:
        """Count the records of all stations."""
        return sum(self.records.values())

    def add(self, station: Wholes, frame: Wholes) -> None:
        """Count records, (N,) stations and frames that do not fall."""
        if not len(station):
            return
        self.first = int(frame[0]) if not self.records else self.first
        self.last = int(frame[-1])
        for number, count in zip(*np.unique(station, return_counts=True), strict=True):
            self.records[int(number)] += int(count)


@dataclass(frozen=True)
class Survey:
    """Hold what is in an archive.

    records : (station) -> good records. clock : None where there is no
    record. gaps : (G, 3) station, first and last frame that have no good record of it; station 0: of none at
    all. partial_frames : ascending, frames that lack a station for less than SHORT_GAP_S while others are
    there. skipped : (byte offset, bytes, frame before). doubtful, out_of_order, distorted : the records that
    are so; errors : letter -> the good records with it.
    """

    settings: StreamSettings
    records: dict[int, int]
    first_frame: int
    last_frame: int
    clock: DeviceClock | None
    gaps: Wholes
    partial_frames: Wholes
    doubtful: Sightings
    out_of_order: Sightings
    errors: dict[str, Sightings]
    distorted: Sightings
    skipped: tuple[tuple[int, int, int], ...]
    tally: Tally

    def gap_ends(self, station: int) -> Wholes:
        """The first frames after the station's gaps, ascending."""
        return np.asarray(self.gaps[self.gaps[:, 0] == station, 2] + 1)

    @property
    def missing_frames(self) -> int:
        """Frames between the first and the last of which no record came."""
        whole = self.gaps[self.gaps[:, 0] == 0]
        return int((whole[:, 2] - whole[:, 1] + 1).sum())

    @property
    def skipped_bytes(self) -> int:
        """Bytes that were no record and no reply."""
        return sum(size for _, size, _ in self.skipped)


def survey_archive(archive: Archive) -> Survey:
    """Read the whole archive once. Raises InputError where it holds no settings."""
    tally = Tally()
    surveyor = _Surveyor()
    for block in blocks_of(archive, tally):
        surveyor.add(block)
    return surveyor.survey(tally)


@dataclass
class _Station:
    """Hold what is remembered of one station from block to block."""

    first: int
    last: int
    records: int


@dataclass
class _Surveyor:
    settings: StreamSettings | None = None
    stations: dict[int, _Station] = field(default_factory=dict)
    last_frame: int | None = None
    arrivals: list[tuple[Wholes, Wholes]] = field(default_factory=list)
    gaps: list[Wholes] = field(default_factory=list)
    doubtful: Sightings = field(default_factory=Sightings)
    out_of_order: Sightings = field(default_factory=Sightings)
    errors: dict[str, Sightings] = field(default_factory=dict)
    distorted: Sightings = field(default_factory=Sightings)
    skipped: list[tuple[int, int, int]] = field(default_factory=list)

    def add(self, block: Block) -> None:
        self.settings = block.settings
        self._skips(block)
        records = block.records
        if not len(records):
            return
        good = block.good
        arrived = np.flatnonzero(np.diff(block.host_ns, append=block.host_ns[-1] + 1))
        arrived = arrived[good[arrived]]
        self.arrivals.append((records.frame[arrived], block.host_ns[arrived]))
        self._frames(records.frame[good])
        for station in np.unique(records.station).tolist():
            self._station(block, station, (records.station == station) & good)
        self._count(block, good)

    def _skips(self, block: Block) -> None:
        for skip in block.skipped:
            row = int(np.searchsorted(block.records.offset, skip.offset)) - 1
            frame = int(block.records.frame[row]) if row >= 0 else self.last_frame or 0
            if self.skipped and sum(self.skipped[-1][:2]) == skip.offset:  # one stretch, cut by blocks
                offset, size, frame = self.skipped.pop()
                self.skipped.append((offset, size + skip.size, frame))
            else:
                self.skipped.append((skip.offset, skip.size, frame))

    def _frames(self, frame: Wholes) -> None:
        """Find the frames that no station has."""
        if not len(frame):
            return
        before = frame[0] if self.last_frame is None else self.last_frame
        self.gaps.append(_jumps(0, frame, int(before)))
        self.last_frame = int(frame[-1])

    def _station(self, block: Block, station: int, rows: npt.NDArray[np.bool_]) -> None:
        frame = block.records.frame[rows]
        if not len(frame):
            return
        known = self.stations.get(station)
        if known is None:
            known = _Station(int(frame[0]), int(frame[0]), 0)
            self.stations[station] = known
        self.gaps.append(_jumps(station, frame, known.last))
        known.last = int(frame[-1])
        known.records += len(frame)

    def _count(self, block: Block, good: npt.NDArray[np.bool_]) -> None:
        records = block.records

        def sighted(sightings: Sightings, which: npt.NDArray[np.bool_]) -> None:
            sightings.add(records.station[which], records.frame[which])

        sighted(self.doubtful, records.doubtful)
        sighted(self.out_of_order, block.out_of_order & ~records.doubtful)
        sighted(self.distorted, (records.distortion > 0) & good)
        for code in np.unique(records.error[good & (records.error > 0)]):
            letter = chr(int(code))
            sighted(self.errors.setdefault(letter, Sightings()), (records.error == code) & good)

    def survey(self, tally: Tally) -> Survey:
        assert self.settings is not None, "an archive gives a block at least"
        nothing = np.empty(0, np.int64)
        frames = np.concatenate([nothing, *(frame for frame, _ in self.arrivals)])
        hosts = np.concatenate([nothing, *(host for _, host in self.arrivals)])
        rate_hz = self.settings.rate_hz
        first = min((known.first for known in self.stations.values()), default=0)
        last = max((known.last for known in self.stations.values()), default=0)
        clock = fit_clock(frames, hosts, rate_hz, first) if len(frames) else None
        gaps = np.concatenate([np.empty((0, 3), np.int64), *self.gaps, self._late_and_early(first, last)])
        return Survey(
            self.settings,
            {station: known.records for station, known in sorted(self.stations.items())},
            first,
            last,
            clock,
            gaps[np.lexsort((gaps[:, 1], gaps[:, 0]))],
            _partial(gaps, SHORT_GAP_S * rate_hz),
            self.doubtful,
            self.out_of_order,
            dict(sorted(self.errors.items())),
            self.distorted,
            tuple(self.skipped),
            tally,
        )

    def _late_and_early(self, first: int, last: int) -> Wholes:
        """Gaps of stations that came after the first frame or went before the last, (G, 3)."""
        found = [
            (station, a, z)
            for station, known in sorted(self.stations.items())
            for a, z in ((first, known.first - 1), (known.last + 1, last))
            if a <= z
        ]
        return np.array(found, np.int64).reshape(-1, 3)


def _jumps(station: int, frame: Wholes, before: int) -> Wholes:
    """Gaps between frames that should follow one another, (G, 3)."""
    earlier = np.concatenate([[before], frame[:-1]])
    rows = np.flatnonzero(frame - earlier > 1)
    return np.stack([np.full(len(rows), station), earlier[rows] + 1, frame[rows] - 1], -1)


def _partial(gaps: Wholes, short: float) -> Wholes:
    """Frames that a station lacks for a short while and others have, ascending."""
    brief = gaps[gaps[:, 2] - gaps[:, 1] < short]
    return np.setdiff1d(_frames(brief[brief[:, 0] > 0]), _frames(brief[brief[:, 0] == 0]))


def _frames(gaps: Wholes) -> Wholes:
    """All frames of gaps (G, 3)."""
    return np.concatenate(
        [np.empty(0, np.int64), *(np.arange(first, last + 1) for _, first, last in gaps.tolist())]
    )
