"""Marker streams of an XDF file, as LabStreamingLayer records them, on the clock of the file's recorder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError, listed
from shukotsu.files.xdf_streams import NUMBERS, TEXT, Floats, load_stream, read_streams
from shukotsu.stages.align_events.event_list import FARTHEST_S, Events

_WHOLE = tuple(name for name in NUMBERS if name.startswith("int"))


def read_markers(path: Path) -> Events:
    """Read the markers of every stream of them: streams of texts, and of whole numbers at no fixed rate.

    A text is the event's name; a number is its value, and its name that of the stream. Times are corrected
    by each stream's clock offsets, so that all streams of the file share one clock; how well is in sd_s.
    Raises InputError where the file has no such stream, or is damaged.
    """
    streams = read_streams(path)
    markers = [s for s in streams if s.format == TEXT or (s.format in _WHOLE and not s.rate_hz)]
    if not markers:
        have = listed([f"{stream.name} ({stream.type or 'no type'})" for stream in streams])
        raise InputError(f"{path}: has no stream of markers (of texts, or of whole numbers); it has {have}")
    rows: list[tuple[Any, ...]] = []
    notes: list[str] = []
    for stream in markers:
        try:
            samples = load_stream(path, stream)
        except InputError as error:
            if "has no samples" not in str(error):
                raise
            notes.append(f"stream {stream.name} has no markers")
            continue
        notes += [note for note in samples.notes if note not in notes]
        if not len(samples.offsets):
            notes.append(f"stream {stream.name} has no clock offsets: its clock is taken for the recorder's")
        sd_s = _scatter_s(samples.offsets)
        for time, sample in zip(samples.time_s.tolist(), samples.values, strict=True):
            name, value = stream.name, np.nan
            if stream.format != TEXT:
                value = float(sample[0])
            else:
                name = "; ".join(filter(None, map(str, sample)))
            rows.append((name or "marker", time, np.nan, value, sd_s))
    if len(markers) > 1:  # else a step back shows that the stream's clock was set
        rows.sort(key=lambda row: row[1])
    return Events.of("xdf", True, rows, *notes)


def _scatter_s(offsets: Floats) -> float:
    """Return the scatter (rms) of clock offsets (N, 2) about a straight line; 0 where there are too few."""
    time_s, offset_s = offsets[(np.abs(offsets) < FARTHEST_S).all(-1)].T
    if len(time_s) < 3 or not np.ptp(time_s) > 0:
        return 0.0
    at_s = (time_s - time_s.mean()) / np.ptp(time_s)
    return float(np.std(offset_s - np.polyval(np.polyfit(at_s, offset_s, 1), at_s)))
