"""First pass over an archive: the clock, and everything that is lost or doubtful, with its place."""

from __future__ import annotations

from collections import Counter as Count
from dataclasses import dataclass, field

import numpy as np

from shukotsu.trackers.archive import Archive
from shukotsu.trackers.decode.clock import DeviceClock, fit_clock
from shukotsu.trackers.decode.losses import Losses
from shukotsu.trackers.decode.stream import Block, Tally, blocks_of
from shukotsu.trackers.protocols.records import Bools, Records, Wholes
from shukotsu.trackers.protocols.stream_settings import StreamSettings


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

    def add(self, records: Records, which: Bools) -> None:
        """Count some of the records, of which frames do not fall."""
        frame = records.frame[which]
        if len(frame):
            self.first = self.first if self.records else int(frame[0])
            self.last = int(frame[-1])
            self.records.update(records.station[which].tolist())


@dataclass
class Survey:
    """What is in an archive.

    losses : the count of good records and of what lies between them. clock : None where there is no record.
    gaps : (G, 4) station, first and last frame that have no good record of it (station 0: of none at all),
    whether the receiver was absent. partial_frames : ascending, that lack a lost record while others are
    there. skipped : (byte offset, bytes, frame before). doubtful, out_of_order, distorted : the records that
    are so; errors : letter -> the good records with it.
    """

    settings: StreamSettings
    tally: Tally
    losses: Losses
    clock: DeviceClock | None = None
    gaps: Wholes = field(default_factory=lambda: np.empty((0, 4), np.int64))
    partial_frames: Wholes = field(default_factory=lambda: np.empty(0, np.int64))
    doubtful: Sightings = field(default_factory=Sightings)
    out_of_order: Sightings = field(default_factory=Sightings)
    errors: dict[str, Sightings] = field(default_factory=dict)
    distorted: Sightings = field(default_factory=Sightings)
    skipped: list[tuple[int, int, int]] = field(default_factory=list)

    @property
    def records(self) -> dict[int, int]:
        """Good records of each station."""
        return {station: heard.records for station, heard in sorted(self.losses.stations.items())}

    @property
    def frames(self) -> int:
        """Frames from the first to the last of which something came."""
        return self.losses.all.frame - self.losses.first_frame + 1 if self.losses.cycles else 0

    def add(self, block: Block) -> Wholes:
        """Count what a block has beside losses; return frames and times [ns] of arrivals, (2, N)."""
        records, good = block.records, block.good
        for skip in block.skipped:
            row = int(np.searchsorted(records.offset, skip.offset)) - 1
            frame = int(records.frame[row]) if row >= 0 else self.losses.newest_frame
            if self.skipped and sum(self.skipped[-1][:2]) == skip.offset:  # one stretch, cut by blocks
                offset, size, frame = self.skipped.pop()
                self.skipped.append((offset, size + skip.size, frame))
            else:
                self.skipped.append((skip.offset, skip.size, frame))
        self.doubtful.add(records, records.doubtful)
        self.out_of_order.add(records, block.out_of_order & ~records.doubtful)
        self.distorted.add(records, (records.distortion > 0) & good)
        for code in np.unique(records.error[good & (records.error > 0)]).tolist():
            sightings = self.errors.setdefault(chr(code), Sightings())
            sightings.add(records, (records.error == code) & good)
        arrived = np.flatnonzero(np.diff(block.host_ns, append=-1))
        arrived = arrived[good[arrived]]
        return np.stack([records.frame[arrived], block.host_ns[arrived]])


def survey_archive(archive: Archive) -> Survey:
    """Read the whole archive once. Raises InputError where it holds no settings."""
    tally, survey = Tally(), None
    lacking: list[tuple[Wholes, Wholes]] = []
    arrivals: list[Wholes] = []
    for block in blocks_of(archive, tally):
        survey = survey or Survey(block.settings, tally, Losses(block.settings))
        arrivals.append(survey.add(block))
        lacking.append(survey.losses.add(block))
    assert survey is not None, "an archive gives a block at least"
    survey.losses, *last = survey.losses.closed()
    gaps, survey.partial_frames = (np.concatenate(each) for each in zip(*lacking, last, strict=True))
    survey.gaps = gaps[np.lexsort((gaps[:, 1], gaps[:, 0]))][:, [0, 1, 2, 5]]
    frame, host_ns = np.concatenate(arrivals, 1)
    if len(frame):
        survey.clock = fit_clock(frame, host_ns, survey.settings.rate_hz, survey.losses.first_frame)
    return survey
