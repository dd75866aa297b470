"""Read a raw capture as samples: records decoded, stations mapped to segments, tracker reports as flags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.readers.formats.mapped import name_in_file, segments_of
from shukotsu.readers.samples import Samples
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tracker.archive import open_archive
from shukotsu.tracker.families import FAMILIES
from shukotsu.tracker.records import StreamSettings
from shukotsu.tracker.survey import findings, flagged_records, survey_archive


def read_capture(path: Path, layout: Layout, mapping: FileMapping | None) -> Iterator[Samples]:
    """Read a raw capture part by part; the first part has the notes, losses and counts of the whole capture.

    The mapping assigns stations to segments; without a mapping, the layout's `receiver:` numbers do. Records
    with an implausible station or frame are left out and counted. Raises InputError if the file is not a
    capture, has no pose, or none of a segment of the layout.
    """
    archive = open_archive(path)
    survey = survey_archive(archive)
    losses = tuple(findings(survey))
    if not survey.records:
        raise InputError(f"{path}: contains no pose ({'; '.join(losses)}); record again")
    segment_of = segments_of_receivers(path, survey.settings, {*survey.records}, layout, mapping)
    there, named = {*survey.records}, {*segment_of}
    if not there & named:
        has, expected = (", ".join(map(str, sorted(stations))) for stations in (there, named))
        expected = expected or "none: its segments have no `receiver:`"
        raise InputError(f"{path}: has the receivers {has}; layout {layout.name} names {expected}")
    others = ", ".join(map(str, sorted(there - named)))
    notes = (f"receiver {others}: not in layout {layout.name}; left out", *losses) if others else losses
    segment = np.full(max({*survey.records, *segment_of}) + 1, -1)
    segment[list(segment_of)] = list(segment_of.values())
    missing_frames = survey.losses.all.lost
    tracker = FAMILIES[survey.settings.family].title
    empty = True
    for part in flagged_records(archive, survey):
        rows = np.flatnonzero(part.usable)[segment[part.records.station[part.usable]] >= 0]
        if len(rows):
            empty, records = False, part.records.take(rows)
            numbers = np.concatenate([records.position_mm, records.quaternion], -1)
            flags = {name: flagged[rows] for name, flagged in part.flags.items()}
            stations, frame, time_s = segment[records.station], records.frame, part.time_s[rows]
            samples = Samples(layout.measured, stations, frame, time_s, numbers, lambda _: str(path), flags)
            samples = replace(samples, notes=notes, losses=losses, missing_frames=missing_frames)
            yield replace(samples, tracker=tracker, orientation="device")
            notes, losses, missing_frames = (), (), 0
    if empty:
        raise InputError(f"{path}: contains no usable pose ({'; '.join(losses)}); record again")


def segments_of_receivers(
    path: Path, settings: StreamSettings, there: Collection[int], layout: Layout, mapping: FileMapping | None
) -> dict[int, int]:
    """Return the index into `layout.measured` of each station; there : the stations that sent records.

    Raises InputError if the mapping has another unit or other stations than the capture.
    """
    if mapping is not None:
        unit = mapping.config["position_unit"]
        if unit != settings.unit:
            raise InputError(f"{mapping.where}: position_unit: is {unit}, but {path} has {settings.unit}")
        stations = {str(station): station for station in there}
        sources = [name_in_file(mapping, name, [*stations], str(path)) for name in mapping.receivers]
        return dict(zip((stations[name] for name in sources), segments_of(mapping, layout), strict=True))
    numbers = ((layout.segments[name].receiver, index) for index, name in enumerate(layout.measured))
    return {number: index for number, index in numbers if number is not None}
