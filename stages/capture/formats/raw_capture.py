"""A raw capture as samples: decoded, stations mapped to segments, what the tracker said kept as marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from schemas.layout import Layout
from stages.capture.archive import open_archive
from stages.capture.decode.findings import findings
from stages.capture.decode.records_table import UNUSABLE, FlaggedRecords, flagged_records
from stages.capture.decode.survey import survey_archive
from stages.capture.samples import ReadingOptions, Samples, segments_of_stations

_KEPT = ("device-error", "device-warning", "distorted")
"""Flags of records that become flags of poses under the same name."""


def read_capture(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a raw capture; a record whose station or frame cannot be believed is left out and counted.

    Raises InputError where the file is no capture, holds no pose or a station that the layout does not name.
    """
    archive = open_archive(path)
    survey = survey_archive(archive)
    losses = findings(survey)
    parts = [_kept(part, options) for part in flagged_records(archive, survey)]
    if not sum(len(part[0]) for part in parts):
        raise InputError(f"{path}: holds no pose ({'; '.join(losses)}); record again")
    station, frame, time_s, offset, numbers, marks = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    known, left_out = _known_stations(path, station, layout)
    place = _place(path, offset[known])
    names = (*_KEPT, "hemisphere-flip", "hemisphere-repaired")
    return Samples(
        layout.measured,
        segments_of_stations(station[known], layout, place),
        frame[known],
        time_s[known],
        numbers[known],
        place,
        {name: marks[known, column] for column, name in enumerate(names)},
        (*left_out, *losses),
        tuple(losses),
        survey.missing_frames,
    )


def _known_stations(
    path: Path, station: npt.NDArray[np.int64], layout: Layout
) -> tuple[npt.NDArray[np.bool_], list[str]]:
    """Which records, (N,), are of receivers that the layout names, and a note on the others."""
    numbers = [layout.segments[name].receiver for name in layout.measured]
    wanted = [number for number in numbers if number is not None]
    known = np.isin(station, wanted)
    if not known.any():
        has = ", ".join(map(str, np.unique(station)))
        named = ", ".join(map(str, sorted(wanted))) or "none: its segments have no `receiver:`"
        raise InputError(f"{path}: has the receivers {has}; layout {layout.name} names {named}")
    others = ", ".join(map(str, np.unique(station[~known])))
    return known, [f"receiver {others}: not in layout {layout.name}; left out"] if others else []


def _kept(part: FlaggedRecords, options: ReadingOptions) -> tuple[npt.NDArray[np.generic], ...]:
    """Station, frame, time, offset, (N, 7) numbers and (N, 5) marks of the records that can be believed."""
    good = np.flatnonzero(~part.flagged(*UNUSABLE))
    records = part.records
    flipped = part.flagged("hemisphere-flipped")
    wrong = part.flagged("hemisphere-transit")
    position_mm = records.position_mm
    if options.repair_hemisphere:
        position_mm = np.where(flipped[:, None], -position_mm, position_mm)
    else:
        wrong = wrong | flipped
        flipped = np.zeros(len(flipped), bool)
    marks = np.stack([*(part.flagged(name) for name in _KEPT), wrong, flipped & ~wrong], -1)
    numbers = np.concatenate([position_mm, records.quaternion], -1)
    columns = (records.station, records.frame, part.time_s, records.offset, numbers, marks)
    return tuple(column[good] for column in columns)


def _place(path: Path, offset: npt.NDArray[np.int64]) -> Callable[[int], str]:
    def place(sample: int) -> str:
        return f"{path}: byte {offset[sample]} of the stream"

    return place
