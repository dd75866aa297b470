"""Read text tables by a mapping: one row per frame (wide), or one row per receiver and frame (long)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError, count_of, nearest
from shukotsu.readers.formats.cells import Cells, unwrapped_s
from shukotsu.readers.formats.frames_by_time import framed_by_time
from shukotsu.readers.formats.mapped import Track, Tracks, quaternions, samples_of_tracks, segments_of
from shukotsu.readers.formats.text_table import TextTable, open_table_text
from shukotsu.readers.samples import Samples, unwrapped_frames
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tables.limits import SECONDS_PER_UNIT

TIME_OF_DAY = "hh:mm:ss"

_MOST_FRAMES = 2.0**40
"""Largest distance from the median time, in frames: a century at 240 Hz; a float still resolves frames."""


@dataclass(frozen=True)
class _Source:
    """Columns of a receiver's numbers, by title."""

    position: Sequence[str]
    orientation: Sequence[str]
    time: str | None
    quality: str | None

    @property
    def titles(self) -> list[str]:
        """Titles of all columns of this receiver."""
        single = [title for title in (self.time, self.quality) if title is not None]
        return [*self.position, *self.orientation, *single]


def read_mapped_csv(path: Path, layout: Layout, mapping: FileMapping) -> Samples:
    """Read a table as the mapping's `csv` group describes. Raises InputError if the table does not match."""
    segments_of(mapping, layout)
    table = mapping.details
    text, where = open_table_text(path, table), f"{mapping.where}: csv"
    keys = ("frame", "receiver", "time", "nanoseconds")
    frame, receiver, time, nanoseconds = (_title(text, table, key, where) for key in keys)
    if table["rows"] == "long":
        sources = dict.fromkeys(mapping.receivers, _source(text, table, where, time))
    else:
        sources = {
            segment: _source(text, group, f"{mapping.where}: receivers.{segment}", time)
            for segment, group in mapping.receivers.items()
        }
    titles = [title for title in (frame, receiver, nanoseconds) if title is not None]
    titles += [title for source in sources.values() for title in source.titles]
    cells = text.cells(titles)
    notes = [*cells.dropped]
    every = np.arange(cells.rows)  # one array for all receivers saves memory
    if receiver is None:
        users: dict[str, list[str]] = {}
        for segment, source in sources.items():
            for title in (*source.position, *source.orientation):
                users.setdefault(title, []).append(segment)
        notes += [
            f"column {title} is used {len(by)} times, for {' and '.join(dict.fromkeys(by))}; is that right?"
            for title, by in users.items()
            if len(by) > 1
        ]
        rows = dict.fromkeys(sources, every)
    else:
        rows = _rows_of_receivers(cells, receiver, mapping, notes)
    tracks = {
        segment: _track(cells, source, rows[segment], mapping, every) for segment, source in sources.items()
    }
    tracks = _timed(cells, sources, tracks, mapping, nanoseconds)
    losses = list(filter(None, [text.cut_off(titles)]))
    if table["in_step"]:
        frames = None if frame is None else cells.wholes(frame)
        placed, lost = _in_step(tracks, frames, receiver is not None, path, mapping, notes)
        losses += lost
    else:
        placed = _on_grid(tracks, path, mapping.rate_hz or np.nan, notes)
    locate = cells.locate
    del cells, tracks  # larger than the file: free them before the samples are joined
    pa.default_memory_pool().release_unused()
    return samples_of_tracks(placed, mapping, layout, locate, notes, losses)


def _source(text: TextTable, group: Mapping[str, Any], where: str, shared_time: str | None) -> _Source:
    position, orientation = (
        [text.column(column, f"{where}.{key}") for column in group.get(key, [])]
        for key in ("position", "orientation")
    )
    time = _title(text, group, "time", where) or shared_time
    return _Source(position, orientation, time, _title(text, group, "quality", where))


def _title(text: TextTable, group: Mapping[str, Any], key: str, where: str) -> str | None:
    return text.column(group[key], f"{where}.{key}") if key in group else None


def _rows_of_receivers(
    cells: Cells, name: str, mapping: FileMapping, notes: list[str]
) -> dict[str, Integers]:
    """Return the rows of each segment by the receiver column; receivers not in the mapping are left out."""
    codes, names = cells.names_in(name)
    counts = dict(zip(names, np.bincount(codes, minlength=len(names)), strict=True))
    values = {segment: str(receiver["value"]) for segment, receiver in mapping.receivers.items()}
    rows_of: dict[str, Integers] = {}
    for segment, value in values.items():
        rows_of[segment] = np.flatnonzero(codes == (names.index(value) if value in names else -1))
        if value not in names:
            notes.append(f"receiver {value!r} of segment {segment} has no row{nearest(value, names)}")
    if not any(len(rows) for rows in rows_of.values()):
        wanted = ", ".join(sorted({*values.values()}))
        raise InputError(
            f"{mapping.where}: receivers: none of the values {wanted} occurs in "
            f"column {name} of the table, which has {', '.join(sorted(names)[:20])}"
        )
    left = {word: counts[word] for word in names if word not in values.values()}
    if left:
        rows = ", ".join(f"{word} ({count_of(count, 'row')})" for word, count in sorted(left.items()))
        notes.append(f"receivers without a segment in the mapping are left out: {rows}")
    return rows_of


def _track(cells: Cells, source: _Source, rows: Integers, mapping: FileMapping, every: Integers) -> Track:
    """Return a receiver's track in the file's order, without times, its frames numbered from 0.

    rows : (N,) of the receiver. every : array 0, 1, 2, ... of at least as many entries, of which the frame
    numbers are a view.
    """
    position = np.stack([cells.reals(title)[rows] for title in source.position], -1)
    turning = np.stack([cells.reals(title)[rows] for title in source.orientation], -1)
    turned = quaternions(turning, mapping.orientation or {}, lambda index: cells.locate(int(rows[index])))
    low = np.zeros(len(rows), bool)
    if source.quality is not None:
        quality = cells.reals(source.quality)[rows]
        low = ~(quality <= mapping.details.get("quality_above", np.inf))  # True for an empty cell (NaN), too
        low |= quality < mapping.details.get("quality_below", -np.inf)
    numbers = np.concatenate([position * mapping.mm_per_unit, turned], -1)
    unknown_s = np.full(len(rows), np.nan)
    return Track(rows, every[: len(rows)], unknown_s, numbers, {"low-quality": low})


def _timed(
    cells: Cells,
    sources: Mapping[str, _Source],
    tracks: Tracks,
    mapping: FileMapping,
    nanoseconds: str | None,
) -> Tracks:
    """Return the tracks with their times in s, NaN if unknown; times of day continue past midnight.

    nanoseconds : title of the column whose nanoseconds are added to all times, if any.
    """
    timed, start_s = Tracks(), np.nan
    for segment, track in tracks.items():
        time, time_s = sources[segment].time, track.time_s
        if time is not None and (unit := mapping.details["time_unit"]) == TIME_OF_DAY:
            of_day_s = cells.times_of_day_s(time)[track.row]
            time_s = unwrapped_s(of_day_s, start_s)
            start_s = float(next(iter(_finite(of_day_s)), np.nan)) if np.isnan(start_s) else start_s
        elif time is not None:
            time_s = cells.times_s(time, unit)[track.row]
        if nanoseconds is not None:
            time_s = time_s + cells.reals(nanoseconds)[track.row] * SECONDS_PER_UNIT["ns"]
        timed[segment] = replace(track, time_s=time_s)
    return timed


def _in_step(
    tracks: Tracks, frames: Integers | None, long: bool, path: Path, mapping: FileMapping, notes: list[str]
) -> tuple[list[Track], list[str]]:
    """Assign rows to frames; return the tracks and a sentence for each loss.

    Rows are numbered by the frame column (`frames`, (N,)) if there is one. Long rows without it are assigned
    by their times, else by the cycle of station numbers, else by their order; wide rows by their order.
    """
    losses: list[str] = []
    if frames is not None:
        worn = {segment: track for segment, track in tracks.items() if len(track.row)}
        clocks = [(frames[track.row], track.time_s) for track in worn.values()]
        counted, note = unwrapped_frames(*zip(*clocks, strict=True))
        notes += filter(None, [note])
        for (segment, track), frame in zip(worn.items(), counted, strict=True):
            tracks[segment] = replace(track, frame=frame)
    elif long and any(np.ptp(times_s) > 0 for t in tracks.values() if len(times_s := _finite(t.time_s))):
        tracks, more, losses = framed_by_time(tracks)
        notes += more
    elif long and (rounds := _rounds(tracks, mapping)):
        tracks = rounds
    elif long:  # the n-th rows of all receivers form frame n, if all have the same number of rows
        counts = {segment: len(track.row) for segment, track in tracks.items() if len(track.row)}
        if len(set(counts.values())) > 1:
            least, most = min(counts, key=counts.__getitem__), max(counts, key=counts.__getitem__)
            raise InputError(
                f"{path}: has {count_of(counts[most], 'row')} of {most} and {counts[least]} of {least}; only "
                "a frame or time column can show which of them belong together: name it as `frame` or `time` "
                f"in {mapping.where}, or set in_step: false"
            )
    placed = [*tracks.values()]
    if mapping.rate_hz and "time" not in mapping.details:
        start, hz = 0 if frames is None else int(frames.min()), mapping.rate_hz
        placed = [
            replace(track, time_s=(track.frame - start) / hz) if np.isnan(track.time_s).all() else track
            for track in placed
        ]
    return placed, losses


def _finite(time_s: Array) -> Array:
    return time_s[np.isfinite(time_s)]


def _rounds(tracks: Tracks, mapping: FileMapping) -> Tracks:
    """Number the frames of long rows whose station numbers repeat in ascending cycles, one cycle per frame.

    A cycle may lack rows. Returns an empty dictionary if the rows do not come in such cycles.
    """
    values = [str(mapping.receivers[segment]["value"]) for segment in tracks]
    if not all(value.isdecimal() for value in values):
        return {}
    counts = [len(track.row) for track in tracks.values()]
    row = np.concatenate([track.row for track in tracks.values()])
    station = np.repeat([int(value) for value in values], counts)
    order = np.argsort(row)
    frame = np.cumsum(np.diff(station[order], prepend=-1) <= 0, dtype=np.int64)
    if frame[-1] + 1 > max(counts) + max(1, max(counts) // 20):
        return {}
    frames = {name: frame[np.searchsorted(row[order], track.row)] for name, track in tracks.items()}
    return {name: replace(track, frame=frames[name]) for name, track in tracks.items()}


def _on_grid(tracks: Tracks, path: Path, rate_hz: float, notes: list[str]) -> list[Track]:
    """Put each receiver's new values on the nearest frame of a regular grid that starts at the earliest one.

    A value that repeats the previous one is dropped; of two values on one frame the nearer one is kept.
    """
    timed: Tracks = {}  # samples that have a time and differ from the previous sample
    for segment, track in tracks.items():
        some = track.take(np.asarray(np.isfinite(track.numbers).any(-1)))
        before, after = some.numbers[:-1], some.numbers[1:]
        fresh = np.isfinite(some.time_s)
        fresh[1:] &= ~((after == before) | (np.isnan(after) & np.isnan(before))).all(-1)
        timed[segment] = some.take(fresh)
    every_s = np.concatenate([new.time_s for new in timed.values()])
    middle_s = float(np.median(every_s)) if len(every_s) else np.nan
    changes = {
        segment: new.take(np.asarray(np.abs(new.time_s - middle_s) * rate_hz < _MOST_FRAMES))
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
        placed.append(replace(new, frame=frame).take(kept))
        notes.append(
            f"segment {segment}: {count_of(len(at), 'new value')} in "
            f"{count_of(len(tracks[segment].row), 'row')}; {len(at) - len(kept)} left out because another "
            f"was nearer to the same frame of {rate_hz:g} Hz"
        )
        if lost := len(timed[segment].row) - len(at):
            left_out = f"{lost} new values left out: their times are years off all others"
            notes.append(f"segment {segment}: {left_out}")
    return placed
