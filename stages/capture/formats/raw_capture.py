"""A raw capture as samples: decoded, stations mapped to segments, what the tracker said kept as marks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from schemas.layout import Layout
from stages.capture.samples import ReadingOptions, Samples, segments_of_stations
from trackers.archive import open_archive
from trackers.decode.findings import findings
from trackers.decode.records_table import UNUSABLE, FlaggedRecords, flagged_records
from trackers.decode.stream import Block
from trackers.decode.survey import survey_archive

_KEPT = ("device-error", "device-warning", "distorted")
"""Flags of records that become flags of poses under the same name."""

_KEPT_BYTES = 16 << 20
"""A capture that is no longer is decoded once, and stays in memory."""


def read_capture(path: Path, layout: Layout, _options: ReadingOptions) -> Iterator[Samples]:
    """Read a raw capture part by part; the last part has no samples, but what is to be said of the whole.

    A record whose station or frame cannot be believed is left out and counted. Raises InputError where the
    file is no capture, holds no pose or none of a station that the layout names.
    """
    archive = open_archive(path)
    kept: list[Block] | None = [] if archive.size_bytes <= _KEPT_BYTES else None
    survey = survey_archive(archive, kept)
    losses = tuple(findings(survey))
    wanted = [layout.segments[name].receiver for name in layout.measured]
    there: set[int] = set()
    for part in flagged_records(archive, survey, kept):
        columns = _kept(part)
        there.update(int(number) for number in np.unique(columns[0]))
        known = np.isin(columns[0], [number for number in wanted if number is not None])
        if known.any():
            yield _samples(path, layout, [column[known] for column in columns])
    if not there:
        raise InputError(f"{path}: holds no pose ({'; '.join(losses)}); record again")
    left_out = _left_out(path, there, layout)
    nothing = (*(np.empty(0, np.int64) for _ in range(4)), np.empty((0, 7)), np.empty((0, len(_KEPT)), bool))
    yield replace(
        _samples(path, layout, nothing),
        notes=(*left_out, *losses),
        losses=losses,
        missing_frames=survey.missing_frames,
        hemispheres=_hemispheres(survey.settings.hemisphere, layout),
    )


def _hemispheres(
    vectors: Mapping[int, tuple[float, float, float]], layout: Layout
) -> dict[int, tuple[float, float, float]]:
    """The half of space of each segment's receiver, by the segment's index."""
    index_of = {layout.segments[name].receiver: index for index, name in enumerate(layout.measured)}
    return {index_of[station]: vector for station, vector in vectors.items() if station in index_of}


def _samples(path: Path, layout: Layout, columns: Sequence[npt.NDArray[Any]]) -> Samples:
    station, frame, time_s, offset, numbers, marks = columns
    place = _place(path, offset)
    return Samples(
        layout.measured,
        segments_of_stations(station, layout, place),
        frame,
        time_s,
        numbers,
        place,
        {name: marks[:, column] for column, name in enumerate(_KEPT)},
    )


def _left_out(path: Path, there: set[int], layout: Layout) -> list[str]:
    """A note on the stations that came and that the layout does not name; InputError where it names none."""
    named = {number for s in layout.measured if (number := layout.segments[s].receiver) is not None}
    if not there & named:
        has = ", ".join(map(str, sorted(there)))
        known = ", ".join(map(str, sorted(named))) or "none: its segments have no `receiver:`"
        raise InputError(f"{path}: has the receivers {has}; layout {layout.name} names {known}")
    others = ", ".join(map(str, sorted(there - named)))
    return [f"receiver {others}: not in layout {layout.name}; left out"] if others else []


def _kept(part: FlaggedRecords) -> tuple[npt.NDArray[np.generic], ...]:
    """Station, frame, time, offset, (N, 7) numbers and (N, 3) marks of the records that can be believed."""
    good = np.flatnonzero(~part.flagged(*UNUSABLE))
    records = part.records
    marks = np.stack([part.flagged(name) for name in _KEPT], -1)
    numbers = np.concatenate([records.position_mm, records.quaternion], -1)
    columns = (records.station, records.frame, part.time_s, records.offset, numbers, marks)
    return tuple(column[good] for column in columns)


def _place(path: Path, offset: npt.NDArray[np.int64]) -> Callable[[int], str]:
    def place(sample: int) -> str:
        return f"{path}: byte {offset[sample]} of the stream"

    return place
