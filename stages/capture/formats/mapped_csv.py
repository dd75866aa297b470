"""Tables as text by mapping: a row a frame (wide) or a row a receiver and frame (long)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.stages.capture.formats.cells import Cells
from shukotsu.stages.capture.formats.mapped import (
    Integers,
    Track,
    mapped_segments,
    required_mapping,
    samples_of_tracks,
)
from shukotsu.stages.capture.formats.orientation import quaternions
from shukotsu.stages.capture.formats.text_table import TextTable, open_table_text
from shukotsu.stages.capture.samples import Samples, did_you_mean

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}

TIME_OF_DAY = "hh:mm:ss"

_MOST_FRAMES = 2.0**40
"""From the middle of a recording; a hundred years at 240 Hz, and frames are still told apart."""

_LARGEST_RAD = 1.1 * 2 * np.pi


@dataclass(frozen=True)
class _Source:
    """Hold where a receiver's numbers are: titles of columns, and (N,) the rows that are its own."""

    position: Sequence[str]
    orientation: Sequence[str]
    time: str | None
    quality: str | None
    rows: Integers = field(default_factory=lambda: np.arange(0))

    @property
    def titles(self) -> list[str]:
        """All columns."""
        single = [title for title in (self.time, self.quality) if title is not None]
        return [*self.position, *self.orientation, *single]


def read_mapped_csv(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read a table as the mapping's `csv` group says. Raises InputError where the table is another."""
    mapping = required_mapping(path, mapping, "a table that is no tidy recording")
    mapped_segments(mapping, layout)
    table = mapping.details
    text = open_table_text(path, table)
    frame, receiver = (_title(text, table, key, f"{mapping.where}: csv") for key in ("frame", "receiver"))
    sources = _sources(text, mapping)
    titles = [title for title in (frame, receiver) if title is not None]
    cells = text.cells([*titles, *(title for source in sources.values() for title in source.titles)])
    notes: list[str] = []
    every = np.arange(cells.rows)  # one for all receivers
    if receiver is None:
        notes += _shared_columns(sources)
        rows = dict.fromkeys(sources, every)
    else:
        rows = _rows_of_receivers(cells, receiver, mapping, notes)
    sources = {segment: replace(source, rows=rows[segment]) for segment, source in sources.items()}
    notes += _angle_doubts(cells, sources, mapping)
    tracks = {segment: _rows_of_source(cells, source, mapping, every) for segment, source in sources.items()}
    if table["in_step"]:
        placed = _in_step(tracks, None if frame is None else cells.wholes(frame), path, mapping)
    else:
        placed = _on_grid(tracks, path, mapping.rate_hz or np.nan, notes)
    place = cells.place
    del cells, tracks  # text and numbers, more than the file, before all is put together
    pa.default_memory_pool().release_unused()
    return samples_of_tracks(placed, mapping, layout, place, notes)


def _sources(text: TextTable, mapping: FileMapping) -> dict[str, _Source]:
    """Each segment's columns, which with long rows all have in common."""
    table, where = mapping.details, f"{mapping.where}: csv"
    time = _title(text, table, "time", where)
    if table["rows"] == "long":
        return dict.fromkeys(mapping.receivers, _source(text, table, where, time))
    return {
        segment: _source(text, group, f"{mapping.where}: receivers.{segment}", time)
        for segment, group in mapping.receivers.items()
    }


def _source(text: TextTable, group: Mapping[str, Any], where: str, shared_time: str | None) -> _Source:
    position, orientation = (
        [text.column(column, f"{where}.{key}") for column in group[key]]
        for key in ("position", "orientation")
    )
    time = _title(text, group, "time", where) or shared_time
    return _Source(position, orientation, time, _title(text, group, "quality", where))


def _title(text: TextTable, group: Mapping[str, Any], key: str, where: str) -> str | None:
    return text.column(group[key], f"{where}.{key}") if key in group else None


def _rows_of_receivers(
    cells: Cells, name: str, mapping: FileMapping, notes: list[str]
) -> dict[str, Integers]:
    """Rows of each segment by what stands in the receiver column; what no segment names is left out."""
    codes, names = cells.names_in(name)
    counts = dict(zip(names, np.bincount(codes, minlength=len(names)), strict=True))
    rows_of: dict[str, Integers] = {}
    taken: set[str] = set()
    for segment, receiver in mapping.receivers.items():
        value = str(receiver["value"])
        taken.add(value)
        wanted = names.index(value) if value in names else -1
        rows_of[segment] = np.flatnonzero(codes == wanted)
        if wanted < 0:
            notes.append(f"receiver {value!r} of segment {segment} has no row{did_you_mean(value, names)}")
    if not any(len(rows) for rows in rows_of.values()):
        raise InputError(
            f"{mapping.where}: receivers: none of the values {', '.join(sorted(taken))} stands in "
            f"column {name} of the table, which has {', '.join(sorted(names)[:20])}"
        )
    left = {word: counts[word] for word in names if word not in taken}
    if left:
        rows = ", ".join(f"{word} ({count} rows)" for word, count in sorted(left.items()))
        notes.append(f"receivers that the mapping names no segment for are left out: {rows}")
    return rows_of


def _shared_columns(sources: Mapping[str, _Source]) -> list[str]:
    users: dict[str, list[str]] = {}
    for segment, source in sources.items():
        for title in (*source.position, *source.orientation):
            users.setdefault(title, []).append(segment)
    return [
        f"column {title} is used {len(by)} times, for {' and '.join(dict.fromkeys(by))}; is that right?"
        for title, by in users.items()
        if len(by) > 1
    ]


def _angle_doubts(cells: Cells, sources: Mapping[str, _Source], mapping: FileMapping) -> list[str]:
    """Doubt radians beyond a whole turn, with a tenth for programs that do not wrap at once."""
    if (mapping.orientation or {}).get("unit") != "rad":
        return []
    titles = dict.fromkeys(title for source in sources.values() for title in source.orientation)
    largest = max(float(np.nanmax(np.abs(cells.reals(title)), initial=0.0)) for title in titles)
    if largest <= _LARGEST_RAD:
        return []
    return [
        f"angles reach {largest:.4g}, more than two pi, though orientation.unit is rad; are they degrees?"
    ]


def _rows_of_source(cells: Cells, source: _Source, mapping: FileMapping, every: Integers) -> Track:
    """A receiver's rows in the file's order, numbered from 0 in place of frames; every : row of the table."""
    rows = source.rows
    position = np.stack([cells.reals(title)[rows] for title in source.position], -1)
    turning = np.stack([cells.reals(title)[rows] for title in source.orientation], -1)
    assert mapping.orientation is not None  # a table without one is refused with its mapping
    turned = quaternions(turning, mapping.orientation, lambda index: cells.place(int(rows[index])))
    time_s = np.full(len(rows), np.nan)
    if source.time is not None:
        unit = mapping.details["time_unit"]
        of_day = unit == TIME_OF_DAY
        time_s = cells.times_of_day_s(source.time) if of_day else cells.reals(source.time) * _SECONDS[unit]
        time_s = time_s[rows]
    quality = np.full(len(rows), np.nan)
    if source.quality is not None:
        quality = cells.reals(source.quality)[rows]
    low = quality > mapping.details.get("quality_above", np.inf)
    low |= quality < mapping.details.get("quality_below", -np.inf)
    numbers = np.concatenate([position * mapping.mm_per_unit, turned], -1)
    return Track(rows, every[: len(rows)], time_s, numbers, {"low-quality": low})


def _in_step(
    tracks: Mapping[str, Track], frames: Integers | None, path: Path, mapping: FileMapping
) -> list[Track]:
    """Rows as frames: frames as the rows name them, shape (N,), or counted from 0."""
    if frames is None:
        _check_counts(tracks, path, mapping)
    start = 0 if frames is None else int(frames.min())
    placed = []
    for track in tracks.values():
        frame = track.frame if frames is None else frames[track.row]
        time_s = track.time_s
        if mapping.rate_hz and "time" not in mapping.details and np.isnan(time_s).all():
            time_s = (frame - start) / mapping.rate_hz
        placed.append(replace(track, frame=frame, time_s=time_s))
    return placed


def _check_counts(tracks: Mapping[str, Track], path: Path, mapping: FileMapping) -> None:
    """Long rows without a frame number belong together only where every receiver has as many."""
    counts = {segment: len(own.row) for segment, own in tracks.items() if len(own.row)}
    if len(set(counts.values())) > 1:
        least, most = min(counts, key=counts.__getitem__), max(counts, key=counts.__getitem__)
        raise InputError(
            f"{path}: has {counts[most]} rows of {most} and {counts[least]} of {least}; which belong "
            f"together is told by a frame column only: name it as `frame` in "
            f"{mapping.where}, or say in_step: false"
        )


def _on_grid(tracks: Mapping[str, Track], path: Path, rate_hz: float, notes: list[str]) -> list[Track]:
    """Put each receiver's new values on the nearest frame of a grid that starts with the earliest of them.

    A value that repeats the one before is no sample; of two on one frame the nearer is kept.
    """
    timed = {segment: _changes(track) for segment, track in tracks.items()}
    every_s = np.concatenate([new.time_s for new in timed.values()])
    middle_s = float(np.median(every_s)) if len(every_s) else np.nan
    changes = {
        segment: new.of(np.asarray(np.abs(new.time_s - middle_s) * rate_hz < _MOST_FRAMES))
        for segment, new in timed.items()
    }
    starts = [float(new.time_s.min()) for new in changes.values() if len(new.row)]
    if not starts:
        raise InputError(f"{path}: no receiver has a value with a time; check the mapping's time column")
    placed = []
    for segment, new in changes.items():
        at = (new.time_s - min(starts)) * rate_hz
        frame = np.round(at).astype(np.int64)
        nearest_first = np.lexsort((np.abs(at - frame), frame))
        _, first = np.unique(frame[nearest_first], return_index=True)
        kept = np.sort(nearest_first[first])
        placed.append(replace(new, frame=frame).of(kept))
        notes.append(
            f"segment {segment}: {len(at)} new values in {len(tracks[segment].row)} rows; "
            f"{len(at) - len(kept)} left out because another was nearer to the same frame of {rate_hz:g} Hz"
        )
        if lost := len(timed[segment].row) - len(at):
            why = "whose times are years off the others'"
            notes.append(f"segment {segment}: {lost} new values left out, {why}")
    return placed


def _changes(track: Track) -> Track:
    """The samples that bring a value, with a time, that is not that of the receiver's value before."""
    some = track.of(np.asarray(np.isfinite(track.numbers).any(-1)))
    new = np.ones(len(some.row), bool)
    before, after = some.numbers[:-1], some.numbers[1:]
    new[1:] = ~((after == before) | (np.isnan(after) & np.isnan(before))).all(-1)
    return some.of(new & np.isfinite(some.time_s))
