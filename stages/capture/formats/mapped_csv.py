"""Tables as text by mapping: a row a frame (wide) or a row a receiver and frame (long)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import FileMapping
from stages.capture.formats.mapped import (
    Integers,
    Track,
    did_you_mean,
    mapped_segments,
    required_mapping,
    samples_of_tracks,
)
from stages.capture.formats.orientation import quaternions
from stages.capture.formats.text_table import TableText, TextColumns, open_text, read_columns
from stages.capture.samples import ReadingOptions, Samples

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}

_LARGEST_RAD = 1.1 * 2 * np.pi


@dataclass(frozen=True)
class _Source:
    """Where a receiver's numbers stand: titles of columns, and titles of the rows that are its own."""

    position: Sequence[str]
    orientation: Sequence[str]
    time: str | None
    quality: str | None
    rows: Integers | None = None


@dataclass(frozen=True)
class _Series:
    """What a receiver's rows say, in the file's order: (N,) rows and times, (N, 7) numbers, (N,) marks."""

    row: Integers
    time_s: Array
    numbers: Array
    low_quality: npt.NDArray[np.bool_]


def read_mapped_csv(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a table as the mapping's `csv` group says. Raises InputError where the table is another."""
    mapping = required_mapping(path, options, "a table that is no tidy recording")
    mapped_segments(mapping, layout)
    text = open_text(path, mapping.details)
    titles = _Titles(text, mapping)
    columns = read_columns(text, titles.wanted())
    notes: list[str] = []
    sources = titles.wide() if mapping.details["rows"] == "wide" else titles.long(columns, notes)
    notes += _shared_columns(sources) if mapping.details["rows"] == "wide" else []
    notes += _angle_doubts(columns, sources, mapping)
    series = {segment: _series(columns, source, mapping) for segment, source in sources.items()}
    if mapping.details["in_step"]:
        tracks = _in_step(series, columns, titles, path, mapping)
    else:
        tracks = _on_grid(series, path, mapping.rate_hz or np.nan, notes)
    return samples_of_tracks(tracks, mapping, layout, columns.place, notes)


class _Titles:
    """The mapping's columns by the table's titles."""

    def __init__(self, text: TableText, mapping: FileMapping) -> None:
        self._text = text
        self._mapping = mapping

    def wanted(self) -> list[str]:
        """Every column that is to be read; InputError at the first that is missing."""
        table = self._mapping.details
        shared = [self._of(table, key, "csv") for key in ("frame", "receiver", "time", "quality")]
        groups = [(table, "csv")] if table["rows"] == "long" else self._receivers()
        found = [title for title in shared if title is not None]
        for group, place in groups:
            found += [*self._several(group, "position", place), *self._several(group, "orientation", place)]
            found += [t for key in ("time", "quality") if (t := self._of(group, key, place)) is not None]
        return found

    def frame(self) -> str | None:
        """The column of the frame number."""
        return self._of(self._mapping.details, "frame", "csv")

    def wide(self) -> dict[str, _Source]:
        """Each segment's columns, where a row has all receivers."""
        shared = self._of(self._mapping.details, "time", "csv")
        found = {}
        for segment, (group, place) in zip(self._mapping.receivers, self._receivers(), strict=True):
            own = self._of(group, "time", place)
            found[segment] = self._source(group, place, shared if own is None else own)
        return found

    def long(self, columns: TextColumns, notes: list[str]) -> dict[str, _Source]:
        """The columns that receivers share, and which rows are each segment's."""
        table = self._mapping.details
        shared = self._source(table, "csv", self._of(table, "time", "csv"))
        rows = _rows_of_receivers(
            columns,
            self._text.column(table["receiver"], f"{self._mapping.where}: csv.receiver"),
            self._mapping,
            notes,
        )
        return {
            segment: _Source(shared.position, shared.orientation, shared.time, shared.quality, rows[segment])
            for segment in self._mapping.receivers
        }

    def _source(self, group: Mapping[str, Any], place: str, time: str | None) -> _Source:
        position, orientation = (self._several(group, key, place) for key in ("position", "orientation"))
        return _Source(position, orientation, time, self._of(group, "quality", place))

    def _receivers(self) -> list[tuple[Mapping[str, Any], str]]:
        return [(group, f"receivers.{name}") for name, group in self._mapping.receivers.items()]

    def _of(self, group: Mapping[str, Any], key: str, place: str) -> str | None:
        if key not in group:
            return None
        return self._text.column(group[key], f"{self._mapping.where}: {place}.{key}")

    def _several(self, group: Mapping[str, Any], key: str, place: str) -> list[str]:
        return [self._text.column(wanted, f"{self._mapping.where}: {place}.{key}") for wanted in group[key]]


def _rows_of_receivers(
    columns: TextColumns, name: str, mapping: FileMapping, notes: list[str]
) -> dict[str, Integers]:
    """Rows of each segment by what stands in the receiver column; what no segment names is left out."""
    codes, words = columns.words(name)
    counts = dict(zip(words, np.bincount(codes, minlength=len(words)), strict=True))
    found: dict[str, Integers] = {}
    taken: set[str] = set()
    for segment, receiver in mapping.receivers.items():
        value = str(receiver["value"])
        taken.add(value)
        wanted = words.index(value) if value in words else -1
        found[segment] = np.flatnonzero(codes == wanted)
        if wanted < 0:
            notes.append(f"receiver {value!r} of segment {segment} has no row{did_you_mean(value, words)}")
    if not any(len(rows) for rows in found.values()):
        raise InputError(
            f"{mapping.where}: receivers: none of the values {', '.join(sorted(taken))} stands in "
            f"column {name} of the table, which has {', '.join(sorted(words)[:20])}"
        )
    left = {word: counts[word] for word in words if word not in taken}
    if left:
        rows = ", ".join(f"{word} ({count} rows)" for word, count in sorted(left.items()))
        notes.append(f"receivers that the mapping names no segment for are left out: {rows}")
    return found


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


def _angle_doubts(columns: TextColumns, sources: Mapping[str, _Source], mapping: FileMapping) -> list[str]:
    """Doubt radians beyond a whole turn, with a tenth for programs that do not wrap at once."""
    if (mapping.orientation or {}).get("unit") != "rad":
        return []
    titles = dict.fromkeys(title for source in sources.values() for title in source.orientation)
    largest = max(float(np.nanmax(np.abs(columns.reals(title)), initial=0.0)) for title in titles)
    if largest <= _LARGEST_RAD:
        return []
    return [
        f"angles reach {largest:.4g}, more than two pi, though orientation.unit is rad; are they degrees?"
    ]


def _series(columns: TextColumns, source: _Source, mapping: FileMapping) -> _Series:
    rows = np.arange(columns.rows) if source.rows is None else source.rows
    position = np.stack([columns.reals(title)[rows] for title in source.position], -1)
    told = np.stack([columns.reals(title)[rows] for title in source.orientation], -1)
    assert mapping.orientation is not None  # a table without one is refused with its mapping
    turned = quaternions(told, mapping.orientation, lambda index: columns.place(int(rows[index])))
    time_s = np.full(len(rows), np.nan)
    if source.time is not None:
        time_s = columns.reals(source.time)[rows] * _SECONDS[mapping.details["time_unit"]]
    quality = np.full(len(rows), np.nan)
    if source.quality is not None:
        quality = columns.reals(source.quality)[rows]
    low = quality > mapping.details.get("quality_above", np.inf)
    low |= quality < mapping.details.get("quality_below", -np.inf)
    return _Series(rows, time_s, np.concatenate([position * mapping.mm_per_unit, turned], -1), low)


def _in_step(
    series: Mapping[str, _Series], columns: TextColumns, titles: _Titles, path: Path, mapping: FileMapping
) -> list[Track]:
    """Rows as frames: by the frame column, or counted from 0."""
    column = titles.frame()
    frames = None if column is None else columns.wholes(column)
    if frames is None:
        _check_counts(series, path, mapping)
    start = 0 if frames is None else int(frames.min())
    tracks = []
    for one in series.values():
        frame = np.arange(len(one.row)) if frames is None else frames[one.row]
        time_s = one.time_s
        if mapping.rate_hz and "time" not in mapping.details and np.isnan(time_s).all():
            time_s = (frame - start) / mapping.rate_hz
        tracks.append(Track(one.row, frame, time_s, one.numbers, {"low-quality": one.low_quality}))
    return tracks


def _check_counts(series: Mapping[str, _Series], path: Path, mapping: FileMapping) -> None:
    """Long rows without a frame number belong together only where every receiver has as many."""
    counts = {segment: len(one.row) for segment, one in series.items() if len(one.row)}
    if len(set(counts.values())) > 1:
        least, most = min(counts, key=counts.__getitem__), max(counts, key=counts.__getitem__)
        raise InputError(
            f"{path}: has {counts[most]} rows of {most} and {counts[least]} of {least}; which belong "
            f"together is told by a frame column only: name it as `frame` in "
            f"{mapping.where}, or say in_step: false"
        )


def _on_grid(series: Mapping[str, _Series], path: Path, rate_hz: float, notes: list[str]) -> list[Track]:
    """Put each receiver's new values on the nearest frame of a grid that starts with the earliest of them.

    A value that repeats the one before is no sample; of two on one frame the nearer is kept.
    """
    fresh = {segment: _changed(one) for segment, one in series.items()}
    starts = [
        float(one.time_s[fresh[segment]].min()) for segment, one in series.items() if fresh[segment].any()
    ]
    if not starts:
        raise InputError(f"{path}: no receiver has a value with a time; check the mapping's time column")
    tracks = []
    for segment, one in series.items():
        new = np.flatnonzero(fresh[segment])
        at = (one.time_s[new] - min(starts)) * rate_hz
        frame = np.round(at).astype(np.int64)
        order = np.lexsort((np.abs(at - frame), frame))
        first = np.ones(len(order), bool)
        first[1:] = np.diff(frame[order]) != 0
        kept = np.sort(order[first])
        held = new[kept]
        marks = {"low-quality": one.low_quality[held]}
        tracks.append(Track(one.row[held], frame[kept], one.time_s[held], one.numbers[held], marks))
        notes.append(
            f"segment {segment}: {len(new)} new values in {len(one.row)} rows; {len(new) - len(kept)} left "
            f"out because another was nearer to the same frame of {rate_hz:g} Hz"
        )
    return tracks


def _changed(one: _Series) -> npt.NDArray[np.bool_]:
    """Which rows bring a value, with a time, that is not that of the receiver's value before, (N,)."""
    some = np.flatnonzero(np.isfinite(one.numbers).any(-1))
    values = one.numbers[some]
    new = np.ones(len(some), bool)
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    new[1:] = ~same.all(-1)
    found = np.zeros(len(one.row), bool)
    found[some[new]] = True
    return found & np.isfinite(one.time_s)
