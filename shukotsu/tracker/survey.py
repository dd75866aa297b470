"""An archive in two passes: losses, doubtful records and the clock; then records with times and flags.

All flags follow from the first pass and therefore do not depend on block boundaries. Device time: the frame
counter is the clock, and the host's clock is fitted to it. Bytes arrive late and never early, so the fitted
line is the one below all arrivals with the least mean distance, an edge of their convex hull.
"""

from __future__ import annotations

import itertools
from collections import Counter as Count
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import count_of
from shukotsu.tracker.archive import Archive, open_archive
from shukotsu.tracker.records import Records, StreamSettings
from shukotsu.tracker.stream import JITTER_S, Losses, RecordBlock, Tally, blocks_of

SHORTEST_FIT_S = 30.0
"""Below this, the scatter of delays exceeds the typical error of a crystal (about 1e-4) in the slope."""
LARGEST_DRIFT = 2e-3
"""A device whose rate is farther from the nominal one than this does not run at that rate."""
FLAGS = {
    "doubtful": "framed as a record should be, but its numbers cannot be right",
    "out-of-order": "its frame or station does not fit between its neighbours'",
    "device-error": "the tracker's error letter says that the pose is wrong (a to g, A to G)",
    "device-warning": "its error letter is another one (I: self-test errors, u: unmapped place)",
    "distorted": "the tracker saw its field distorted by metal",
}
"""What a record's flags say; bit i of the number stands for the i-th."""
MOST_KEPT = 8
"""Blocks of records, 50 MB: a longer archive is decoded again rather than kept."""
BIT = {flag: np.uint16(1 << bit) for bit, flag in enumerate(FLAGS)}

UNUSABLE = ("doubtful", "out-of-order")
"""Records whose station and frame number are unreliable."""
SOURCE_FAILURES = b"abcdefgABCDEFG"


@dataclass(frozen=True)
class DeviceClock:
    """time_s = (frame - first_frame) * period_s; the host's clock showed host_ns at 0.

    fitted : whether period_s was fitted to the host's clock, or is the nominal one.
    measured_rate_hz : frames a second by the host's clock, NaN where the recording is too short to tell.
    """

    first_frame: int
    period_s: float
    host_ns: int
    fitted: bool
    measured_rate_hz: float

    def time_s(self, frame: Integers) -> Array:
        """Device time of frames, (N,) in and out, s from the first frame."""
        return np.asarray((frame - self.first_frame) * self.period_s)


def fit_clock(frame: Integers, host_ns: Integers, rate_hz: float, first_frame: int) -> DeviceClock:
    """Fit the host's clock to the frame counter; time starts at `first_frame`.

    frame, host_ns : (N,) of arrivals, frames not falling; at least one.
    """
    host_first = int(host_ns[0])
    x, y = (frame - first_frame) / rate_hz, (host_ns - host_first).astype(float) * 1e-9
    slope, fitted, measured = 1.0, False, float("nan")
    if x[-1] - x[0] >= SHORTEST_FIT_S:
        slope = _slope_below(x, y)
        measured = rate_hz / slope if slope > 0 else float("nan")
        fitted = abs(slope - 1) <= LARGEST_DRIFT
    slope = slope if fitted else 1.0
    offset_ns = round(float((y - slope * x).min()) * 1e9)
    return DeviceClock(first_frame, slope / rate_hz, host_first + offset_ns, fitted, measured)


def _slope_below(x: Array, y: Array) -> float:
    """Return the slope of the line below all points with the least mean distance, x ascending, (N,) each."""
    hull: list[int] = []
    late = y - x
    second = np.floor(x).astype(np.int64)  # only the earliest arrival of each can lie on the hull
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
    """Records of one kind: how many of each station, and the first and last frame in which one stood."""

    records: Count[int] = field(default_factory=Count)
    first: int = 0
    last: int = 0

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
    are so; errors : letter -> the good records with it. blocks : as decoded, of a short archive.
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
    """Records of a block: time_s (N,) device time, flags (N,) bits as in FLAGS, host_ns (N,) of arrival."""

    records: Records
    time_s: Array
    host_ns: Integers
    flags: npt.NDArray[np.uint16]

    def flagged(self, *names: str) -> Bools:
        """Whether a record has any of the flags, shape (N,)."""
        mask = np.bitwise_or.reduce([BIT[name] for name in names])
        return np.asarray((self.flags & mask) != 0)


def flagged_records(archive: Archive, survey: Survey) -> Iterator[FlaggedRecords]:
    """Yield the archive's records with what the survey found; blocks without a record are left out."""
    if survey.clock is None:
        return
    for block in survey.blocks or blocks_of(archive, Tally()):
        if len(block.records):
            time_s = survey.clock.time_s(block.records.frame)
            records, flags = block.records, np.zeros(len(block.records), np.uint16)
            source = np.isin(records.error, list(SOURCE_FAILURES))
            flags[records.doubtful] |= BIT["doubtful"]
            flags[block.out_of_order] |= BIT["out-of-order"]
            flags[source] |= BIT["device-error"]
            flags[(records.error != 0) & ~source] |= BIT["device-warning"]
            flags[(records.distortion > 0) & ~records.doubtful] |= BIT["distorted"]
            yield FlaggedRecords(records, time_s, block.host_ns, flags)


NAMED_PLACES, CLOCK_JUMP_S = 3, 0.1
"""Number of places named per kind (others are counted), and the least reported jump of the host's clock."""


def findings(survey: Survey) -> list[str]:
    """Return a sentence for each fault; none for a faultless recording."""
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
            f"{tally.unreadable_bytes} bytes of the file are no whole entry and were left out "
            "(the recorder was killed or the file was cut off or damaged)"
        )
    if tally.spoilt_bytes:
        yield f"{tally.spoilt_bytes} bytes do not have their checksum (the file was damaged); left out"
    if tally.missing_rows:
        yield f"{tally.missing_rows} entries of the recorder are missing (the file was damaged)"
    if tally.summary is None:
        yield "the recording was not ended by the recorder, so up to its last second may be missing"
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
    """Describe undecodable bytes, impossible records, errors reported by the tracker, and clocks that
    deviate.
    """
    if survey.skipped:
        _, sizes, frames = np.array(survey.skipped).T
        yield (
            f"{sizes.sum()} bytes at {len(sizes)} places were no record and were skipped "
            f"(at {_places(survey, frames)})"
        )
    for sightings, what in (
        (survey.doubtful, "hold numbers that cannot be right"),
        (survey.out_of_order, "have a frame or receiver that fits no neighbour"),
    ):
        if sightings.records.total():
            yield f"{sightings.records.total()} records {what} ({_seen_text(survey, sightings)}); not used"

    for letter, sightings in survey.errors.items():
        yield (
            f"the tracker reported error {letter!r} with {sightings.records.total()} records "
            f"({_seen_text(survey, sightings)})"
        )
    metal = survey.distorted
    if metal.records.total():
        worst, count = metal.records.most_common(1)[0]
        share = 100 * count / max(1, survey.records.get(worst, 0))
        yield (
            f"the tracker saw its field distorted by metal ({_seen_text(survey, metal)}; "
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
        yield f"the host's calendar clock was moved by {moved_s:.2f} s meanwhile; device time is not touched"


def _seen_text(survey: Survey, sightings: Sightings) -> str:
    stations = sorted(sightings.records)
    named = "receiver" if len(stations) == 1 else "receivers"
    first, last = _at(survey, sightings.first), _at(survey, sightings.last)
    when = f"at {first}" if first == last else f"from {first} to {last}"
    return f"{named} {', '.join(map(str, stations))}, {when}"


def _places(survey: Survey, frames: Integers, counts: Integers | None = None) -> str:
    """Format the longest places in turn, and how long they are beyond jitter; counts : frames of each."""
    seconds = np.zeros(len(frames)) if counts is None else counts / survey.settings.rate_hz
    named = [
        _at(survey, frames[row]) + (f" for {seconds[row]:.2f} s" if seconds[row] > JITTER_S else "")
        for row in np.sort(np.argsort(-seconds, kind="stable")[:NAMED_PLACES])
    ]
    more = len(frames) - NAMED_PLACES
    return ", ".join(named) + (f" and {more} more" if more > 0 else "")


def describe(path: Path) -> list[str]:
    """Return what is in a raw capture, a line each. Raises InputError where it is none."""
    archive = open_archive(path)
    survey = survey_archive(archive)
    lines = [f"a raw capture of this project, {survey.tally.received_bytes} bytes of the tracker"]
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
