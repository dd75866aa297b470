"""Read an archive in two passes: first losses, doubtful records and clock, then records with times and flags.

All flags follow from the first pass and therefore do not depend on block boundaries. Device time is the frame
counter times a period that is fitted to the host's clock. Bytes may arrive late but never early, so the
fitted line is the one below all arrivals with the smallest mean distance: an edge of their convex hull.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter as Count
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import count_of
from shukotsu.tracker.archive import Archive, open_archive
from shukotsu.tracker.records import Records, StreamSettings
from shukotsu.tracker.stream import JITTER_S, Losses, RecordBlock, Tally, blocks_of

SHORTEST_FIT_S = 30.0
"""Shortest recording whose period is fitted: in a shorter one, scattered delays affect the slope more than
the typical error of a crystal (about 1e-4)."""
LARGEST_DRIFT = 2e-3
"""Largest relative deviation from the nominal rate; beyond it, the device runs at another rate."""
MOST_KEPT = 8
"""Number of blocks of records, 50 MB, up to which they are kept; longer archives are decoded again."""
SOURCE_FAILURES = b"abcdefgABCDEFG"


@dataclass(frozen=True)
class DeviceClock:
    """Device time: time_s = (frame - first_frame) * period_s.

    fitted : whether period_s was fitted to the host's clock; else it is nominal. measured_rate_hz : frames
    per second by the host's clock, NaN if the recording is too short.
    """

    first_frame: int
    period_s: float
    fitted: bool
    measured_rate_hz: float

    def time_s(self, frame: Integers) -> Array:
        """Return the device time of frames (N,) in s from the first frame, (N,)."""
        return np.asarray((frame - self.first_frame) * self.period_s)


def fit_clock(frame: Integers, host_ns: Integers, rate_hz: float, first_frame: int) -> DeviceClock:
    """Fit the frame counter's period to the host's clock.

    Parameters
    ----------
    frame : array, shape (N,)
        Frames of arrivals, not decreasing; at least one.
    host_ns : array, shape (N,)
        The host's times of arrivals.
    rate_hz : float
        Nominal rate.
    first_frame : int
        Frame at which device time is 0.

    Returns
    -------
    DeviceClock
        With the nominal period if the recording is shorter than SHORTEST_FIT_S or drifts by more than
        LARGEST_DRIFT.

    """
    x, y = (frame - first_frame) / rate_hz, (host_ns - host_ns[0]).astype(float) * 1e-9
    if x[-1] - x[0] < SHORTEST_FIT_S:
        return DeviceClock(first_frame, 1 / rate_hz, False, math.nan)
    slope = _slope_below(x, y)
    measured_rate_hz = rate_hz / slope if slope > 0 else math.nan
    fitted = abs(slope - 1) <= LARGEST_DRIFT
    return DeviceClock(first_frame, (slope if fitted else 1.0) / rate_hz, fitted, measured_rate_hz)


def _slope_below(x: Array, y: Array) -> float:
    """Return the slope of the line below all points (x, y) with the smallest mean distance; x ascending."""
    hull: list[int] = []
    late = y - x
    second = np.floor(x).astype(np.int64)  # to save time, only the earliest arrival of each second is used
    edges = np.flatnonzero(np.diff(second, prepend=second[0] - 1)).tolist()
    for start, stop in itertools.pairwise([*edges, len(x)]):
        point = int(start + np.argmin(late[start:stop]))
        while len(hull) >= 2:
            a, b = hull[-2:]
            if (y[b] - y[a]) * (x[point] - x[a]) < (y[point] - y[a]) * (x[b] - x[a]):
                break  # b lies below the line from a to the point
            hull.pop()
        hull.append(point)
    right = max(1, int(np.searchsorted(x[hull], x.mean())))
    a, b = hull[right - 1], hull[right]
    return float((y[b] - y[a]) / (x[b] - x[a]))


@dataclass
class Sightings:
    """Records of one kind: their number by station, and the first and last frame with one."""

    records: Count[int] = field(default_factory=Count)
    first: int = 0
    last: int = 0

    def add(self, records: Records, which: Bools) -> None:
        """Count the records selected by `which` (N,); frames must not decrease."""
        frame = records.frame[which]
        if len(frame):
            self.first = self.first if self.records else int(frame[0])
            self.last = int(frame[-1])
            self.records.update(records.station[which].tolist())


@dataclass
class Survey:
    """Summary of an archive.

    losses : counts of good and lost records. clock : None without records. gaps : (G, 4) station (0: no
    station has records), first and last frame without a good record, whether the receiver was absent.
    partial_frames : frames, ascending, that lack some receivers' records. skipped : (byte offset, number of
    bytes, frame before). doubtful, out_of_order, distorted : such records; errors : error letter -> good
    records with it. blocks : decoded blocks of a short archive.
    """

    settings: StreamSettings
    tally: Tally
    losses: Losses
    clock: DeviceClock | None = None
    gaps: Integers = field(default_factory=lambda: np.empty((0, 4), np.int64))
    partial_frames: Integers = field(default_factory=lambda: np.empty(0, np.int64))
    doubtful: Sightings = field(default_factory=Sightings)
    out_of_order: Sightings = field(default_factory=Sightings)
    errors: dict[str, Sightings] = field(default_factory=dict)
    distorted: Sightings = field(default_factory=Sightings)
    skipped: list[tuple[int, int, int]] = field(default_factory=list)
    blocks: list[RecordBlock] = field(default_factory=list)

    @property
    def records(self) -> dict[int, int]:
        """Good records of each station."""
        return {station: heard.records for station, heard in sorted(self.losses.stations.items())}

    def add(self, block: RecordBlock) -> Integers:
        """Count a block's faults other than losses; return frames and host times (ns) of arrivals, (2, N)."""
        records, good = block.records, block.good
        for skip in block.skipped:
            row = int(np.searchsorted(records.offset, skip.offset)) - 1
            first = skip.offset
            frame = int(records.frame[row]) if row >= 0 else self.losses.newest_frame
            if self.skipped and sum(self.skipped[-1][:2]) == skip.offset:  # continues across two blocks
                first, _, frame = self.skipped.pop()
            self.skipped.append((first, skip.offset + skip.size - first, frame))
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
    """Read the whole archive once. Raises InputError if it has no settings."""
    tally, survey = Tally(), None
    lacking: list[tuple[Integers, Integers]] = []
    arrivals: list[Integers] = []
    for block in blocks_of(archive, tally):
        survey = survey or Survey(block.settings, tally, Losses(block.settings))
        survey.blocks = [*survey.blocks, block] if len(arrivals) < MOST_KEPT else []
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


@dataclass(frozen=True)
class FlaggedRecords:
    """Records of a block with device time (N,).

    usable : (N,) whether station and frame number are reliable. flags : reports of the tracker, (N,) by name:
    "device-error" (its error letter, a to g or A to G, means that the pose is wrong), "device-warning"
    (another letter, I: self-test errors, u: outside the mapped area), "distorted" (metal distorts its field).
    """

    records: Records
    time_s: Array
    usable: Bools
    flags: Mapping[str, Bools]


def flagged_records(archive: Archive, survey: Survey) -> Iterator[FlaggedRecords]:
    """Yield the archive's records with times and flags by the survey; blocks without records are left out."""
    if survey.clock is None:
        return
    for block in survey.blocks or blocks_of(archive, Tally()):
        records = block.records
        if len(records):
            source = np.isin(records.error, list(SOURCE_FAILURES))
            flags = {
                "device-error": source,
                "device-warning": (records.error != 0) & ~source,
                "distorted": (records.distortion > 0) & ~records.doubtful,
            }
            yield FlaggedRecords(records, survey.clock.time_s(records.frame), block.good, flags)


NAMED_PLACES, CLOCK_JUMP_S = 3, 0.1
"""Number of places named per kind (others are counted), and the least reported jump of the host's clock."""


def findings(survey: Survey) -> list[str]:
    """Return a sentence for each fault of a recording."""
    return [*_lost(survey), *_damage(survey)]


def _at(survey: Survey, frame: int) -> str:
    if survey.clock is None:
        return f"frame {frame}"
    return f"{float(survey.clock.time_s(np.array([frame]))[0]):.2f} s"


def _lost(survey: Survey) -> Iterator[str]:
    """Describe what is missing: in the file, for all receivers, and for each."""
    tally = survey.tally
    if survey.clock is None:
        yield "the tracker sent no pose record"
    if tally.unreadable_bytes:
        yield (
            f"{tally.unreadable_bytes} bytes of the file are not complete entries and were left out "
            "(the recorder was killed or the file was cut off or damaged)"
        )
    if tally.spoilt_bytes:
        yield f"{tally.spoilt_bytes} bytes have a wrong checksum (the file was damaged); left out"
    if tally.missing_rows:
        yield f"{tally.missing_rows} entries of the recorder are missing (the file was damaged)"
    if tally.summary is None:
        yield "the recording was not closed by the recorder, so up to its last second may be missing"
    whole, losses = survey.gaps[survey.gaps[:, 0] == 0], survey.losses
    frames = losses.all.frame - losses.first_frame + 1
    if len(whole):
        yield (
            f"{losses.all.lost} of {count_of(frames, 'frame', 'are')} missing for all receivers "
            f"(at {_places(survey, whole[:, 1], whole[:, 2] - whole[:, 1] + 1)})"
        )
    if len(survey.partial_frames):
        yield (
            f"{len(survey.partial_frames)} of {count_of(frames, 'frame', 'lack')} a receiver "
            f"(at {_places(survey, survey.partial_frames)})"
        )
    ends_s = losses.silent_ends_s(survey.tally.started_ns, survey.tally.ended_ns)
    for silent_s, where in zip(ends_s, ("after the start", "before the end"), strict=True):
        if silent_s and survey.clock is not None:
            yield f"the tracker sent no pose record for {silent_s:.2f} s {where}"
    for station in survey.settings.stations:
        if station not in survey.records:
            yield f"receiver {station} was active and sent nothing"
    for station, first, last, absent in survey.gaps:
        if absent:
            seconds = (last - first + 1) / survey.settings.rate_hz
            yield f"receiver {station} sent nothing for {seconds:.1f} s, from {_at(survey, first)} on"


def _damage(survey: Survey) -> Iterator[str]:
    """Describe undecodable bytes, impossible records, the tracker's own errors, and clock deviations."""
    if survey.skipped:
        _, sizes, frames = np.array(survey.skipped).T
        yield (
            f"{count_of(int(sizes.sum()), 'byte', 'are')} not part of a record and left out, at "
            f"{count_of(len(sizes), 'place')} ({_places(survey, frames)})"
        )
    misfit = "have a frame or receiver that does not fit their neighbours"
    for seen, what in ((survey.doubtful, "have impossible numbers"), (survey.out_of_order, misfit)):
        if seen.records.total():
            yield f"{seen.records.total()} records {what} ({_seen_text(survey, seen)}); not used"
    for letter, seen in survey.errors.items():
        count, where = seen.records.total(), _seen_text(survey, seen)
        yield f"the tracker reported error {letter!r} with {count} records ({where})"
    metal = survey.distorted
    if metal.records.total():
        worst, count = metal.records.most_common(1)[0]
        share = 100 * count / max(1, survey.records.get(worst, 0))
        yield (
            f"the tracker reported that metal distorts its field ({_seen_text(survey, metal)}; "
            f"receiver {worst} in {share:.1f} % of its records)"
        )
    clock = survey.clock
    if clock is not None and not np.isnan(clock.measured_rate_hz) and not clock.fitted:
        yield (
            f"frames came at {clock.measured_rate_hz:.3f} Hz by the host's clock, not at "
            f"{survey.settings.rate_hz:g} Hz; time is taken from the frame counter at the nominal rate"
        )
    moved_s = survey.tally.utc_offset_range_ns * 1e-9
    if moved_s > CLOCK_JUMP_S:
        yield f"the host's clock was set by {moved_s:.2f} s during the recording; device time is not affected"


def _seen_text(survey: Survey, sightings: Sightings) -> str:
    stations = sorted(sightings.records)
    named = "receiver" if len(stations) == 1 else "receivers"
    first, last = _at(survey, sightings.first), _at(survey, sightings.last)
    when = f"at {first}" if first == last else f"from {first} to {last}"
    return f"{named} {', '.join(map(str, stations))}, {when}"


def _places(survey: Survey, frames: Integers, counts: Integers | None = None) -> str:
    """Format the longest gaps in order, with their duration if above jitter; counts : frames in each."""
    seconds = np.zeros(len(frames)) if counts is None else counts / survey.settings.rate_hz
    named = [
        _at(survey, frames[row]) + (f" for {seconds[row]:.2f} s" if seconds[row] > JITTER_S else "")
        for row in np.sort(np.argsort(-seconds, kind="stable")[:NAMED_PLACES])
    ]
    more = len(frames) - NAMED_PLACES
    return ", ".join(named) + (f" and {more} more" if more > 0 else "")


def describe(path: Path) -> list[str]:
    """Describe a raw capture, line by line. Raises InputError if it is not a raw capture."""
    archive = open_archive(path)
    survey = survey_archive(archive)
    lines = [f"a raw capture of this project, {survey.tally.received_bytes} bytes from the tracker"]
    lines += [f"{key}: {value}" for key, value in archive.about.items()]
    settings = survey.settings
    items = next(iter(settings.items.values()), ())
    lines.append(
        f"{settings.family} in {settings.mode}, {settings.rate_hz:g} Hz, positions in {settings.unit}, "
        f"stations {', '.join(map(str, settings.stations))}, "
        f"output list {','.join(map(str, items)) or 'fixed'}"
    )
    if survey.clock is not None:
        first, last = survey.losses.first_frame, survey.losses.all.frame
        seconds = float(survey.clock.time_s(np.array([last + 1]))[0])
        lines.append(f"frames {first} to {last}, {seconds:.2f} s")
        rates = ", ".join(f"{station}: {count}" for station, count in survey.records.items())
        lines.append(f"records of each station: {rates}")
    return [*lines, *findings(survey)]
