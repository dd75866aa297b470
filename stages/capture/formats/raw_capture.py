"""A raw capture as samples: decoded, stations mapped to segments, what the tracker said kept as flags."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.stages.capture.samples import Samples, segments_of_stations
from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.findings import findings
from shukotsu.trackers.decode.records_table import UNUSABLE, FlaggedRecords, flagged_records
from shukotsu.trackers.decode.survey import survey_archive
from shukotsu.trackers.families import FAMILIES

_KEPT = ("device-error", "device-warning", "distorted")
"""Flags of records that become flags of poses under the same name."""


def read_capture(path: Path, layout: Layout, _mapping: FileMapping | None) -> Iterator[Samples]:
    """Read a raw capture part by part; the first part has what is to be said of the whole.

    A record whose station or frame cannot be believed is left out and counted. Raises InputError where the
    file is no capture, holds no pose or none of a station that the layout names.
    """
    archive = open_archive(path)
    survey = survey_archive(archive)
    losses = tuple(findings(survey))
    if not survey.records:
        raise InputError(f"{path}: holds no pose ({'; '.join(losses)}); record again")
    named = {number for s in layout.measured if (number := layout.segments[s].receiver) is not None}
    notes = (*_left_out(path, set(survey.records), named, layout), *losses)
    missing_frames = survey.losses.all.lost
    tracker = FAMILIES[survey.settings.family].title
    any_known = False
    for part in flagged_records(archive, survey):
        known = np.isin(part.records.station, list(named)) & ~part.flagged(*UNUSABLE)
        if known.any():
            any_known = True
            samples = _samples(path, layout, part, np.flatnonzero(known))
            yield replace(samples, notes=notes, losses=losses, missing_frames=missing_frames, tracker=tracker)
            notes, losses, missing_frames = (), (), 0
    if not any_known:
        raise InputError(f"{path}: holds no pose that can be believed ({'; '.join(losses)}); record again")


def _left_out(path: Path, there: set[int], named: set[int], layout: Layout) -> list[str]:
    """A note on the stations that came and that the layout does not name; InputError where it names none."""
    if not there & named:
        has = ", ".join(map(str, sorted(there)))
        known = ", ".join(map(str, sorted(named))) or "none: its segments have no `receiver:`"
        raise InputError(f"{path}: has the receivers {has}; layout {layout.name} names {known}")
    others = ", ".join(map(str, sorted(there - named)))
    return [f"receiver {others}: not in layout {layout.name}; left out"] if others else []


def _samples(path: Path, layout: Layout, part: FlaggedRecords, rows: npt.NDArray[np.int64]) -> Samples:
    """Those records of a part as samples."""
    records = part.records.take(rows)

    def place(_: int) -> str:
        return str(path)

    return Samples(
        layout.measured,
        segments_of_stations(records.station, layout, place),
        records.frame,
        part.time_s[rows],
        np.concatenate([records.position_mm, records.quaternion], -1),
        place,
        {name: part.flagged(name)[rows] for name in _KEPT},
        orientation="device",
    )
