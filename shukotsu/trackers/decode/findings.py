"""A survey in sentences for people: what came, what is lost and where, what to look at."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.losses import JITTER_S
from shukotsu.trackers.decode.survey import Sightings, Survey, survey_archive
from shukotsu.trackers.protocols.records import Wholes

NAMED_PLACES, CLOCK_JUMP_S = 3, 0.1
"""Places of a kind that are named (more are counted); the host's clock was moved by more."""


def findings(survey: Survey) -> list[str]:
    """Return a sentence for everything that is not as it should be; none for a faultless recording."""
    parts = (_ending, _lost, _damage, _device, _clocks)
    return [sentence for part in parts for sentence in part(survey)]


def _at(survey: Survey, frame: int) -> str:
    if survey.clock is None:
        return f"frame {frame}"
    return f"{float(survey.clock.time_s(np.array([frame]))[0]):.2f} s"


def _ending(survey: Survey) -> Iterator[str]:
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


def _lost(survey: Survey) -> Iterator[str]:
    whole, losses = survey.gaps[survey.gaps[:, 0] == 0], survey.losses
    frames = losses.all.frame - losses.first_frame + 1
    if len(whole):
        yield (
            f"{losses.all.lost} of {frames} frames are missing for all receivers "
            f"(at {_places(survey, whole[:, 1], whole[:, 2] - whole[:, 1] + 1)})"
        )
    if len(survey.partial_frames):
        yield (
            f"{len(survey.partial_frames)} of {frames} frames lack a receiver "
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
            yield f"{sightings.records.total()} records {what} ({_sighted(survey, sightings)}); not used"


def _device(survey: Survey) -> Iterator[str]:
    for letter, sightings in survey.errors.items():
        yield (
            f"the tracker reported error {letter!r} with {sightings.records.total()} records "
            f"({_sighted(survey, sightings)})"
        )
    metal = survey.distorted
    if metal.records.total():
        worst, count = metal.records.most_common(1)[0]
        share = 100 * count / max(1, survey.records.get(worst, 0))
        yield (
            f"the tracker saw its field distorted by metal ({_sighted(survey, metal)}; "
            f"receiver {worst} in {share:.1f} % of its records)"
        )


def _sighted(survey: Survey, sightings: Sightings) -> str:
    stations = sorted(sightings.records)
    named = "receiver" if len(stations) == 1 else "receivers"
    first, last = _at(survey, sightings.first), _at(survey, sightings.last)
    when = f"at {first}" if first == last else f"from {first} to {last}"
    return f"{named} {', '.join(map(str, stations))}, {when}"


def _clocks(survey: Survey) -> Iterator[str]:
    clock = survey.clock
    if clock is not None and not np.isnan(clock.measured_rate_hz) and not clock.fitted:
        yield (
            f"frames came at {clock.measured_rate_hz:.3f} Hz by the host's clock, not at "
            f"{survey.settings.rate_hz:g} Hz; time is taken from the frame counter at the nominal rate"
        )
    moved_s = survey.tally.utc_offset_range_ns * 1e-9
    if moved_s > CLOCK_JUMP_S:
        yield f"the host's calendar clock was moved by {moved_s:.2f} s meanwhile; device time is not touched"


def _places(survey: Survey, frames: Wholes, counts: Wholes | None = None) -> str:
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
