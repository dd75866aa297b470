"""Readers of events: notes in MIDI files, markers in XDF files, sync pulses and buttons in raw captures."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, count_of, list_names
from shukotsu.tables import limits, text_files
from shukotsu.tables.xdf_streams import NUMBERS, TEXT, load_stream, read_streams
from shukotsu.tracker.archive import open_archive
from shukotsu.tracker.survey import flagged_records, survey_archive

FARTHEST_S = 1e11
"""About three thousand years; a time beyond it must be damaged."""


@dataclass(frozen=True)
class Events:
    """N events in the order of their file.

    Attributes
    ----------
    source
        Kind of the file: midi, xdf, tracker or sheet.
    own_clock
        Whether times are those of the device's clock instead of the recording's `time_s`.
    names
        Names of the events, N of them.
    time_s, duration_s, value
        Arrays of shape (N,), NaN if unknown.
    sd_s
        Array of shape (N,), 1-sigma errors of times on that clock, s; 0 if unknown.
    channel
        Array of shape (N,), MIDI channels from 1; 0 for other sources.
    notes
        Sentences about the file for readers of the table.

    """

    source: str
    own_clock: bool
    names: tuple[str, ...]
    time_s: Array
    duration_s: Array
    value: Array
    sd_s: Array
    channel: Integers
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, source: str, own_clock: bool, rows: Iterable[Sequence[Any]], *notes: str) -> Events:
        """Build events from rows of (name, time_s, duration_s, value[, sd_s[, channel]])."""
        whole = [(*row, *(0.0, 0)[len(row) - 4 :]) for row in rows]
        time_s, duration_s, value, sd_s, channel = (
            np.array([row[column] for row in whole], float) for column in range(1, 6)
        )
        names = tuple(str(row[0]) for row in whole)
        return cls(source, own_clock, names, time_s, duration_s, value, sd_s, channel.astype(np.int64), notes)

    def named(self, name: str) -> Bools:
        """Return which events have this name, shape (N,)."""
        return np.array([each == name for each in self.names], bool)


EXPECTED = "a standard MIDI file (.mid)"


def read_midi(path: Path) -> Events:
    """Read the notes of a MIDI file: name `note 60`, value the velocity (1 to 127), channel 1 to 16.

    A note lasts until its note off. If a key is struck again before that, the first note off ends the first
    note. All tracks share the file's tempo changes. Raises InputError if the file is not a MIDI file, has
    format 2 or time code, or is damaged.
    """
    import mido

    with text_files.reading(path, EXPECTED):
        limits.check_regular(path, EXPECTED)
        try:
            file = mido.MidiFile(path)
        except MemoryError:
            raise
        except Exception as error:  # mido raises exceptions of many types
            why = str(error) or "it is cut off"
            raise InputError(f"{path}: cannot be read as {EXPECTED}: {why}; save or copy it again") from error
    if file.type not in (0, 1) or file.ticks_per_beat <= 0:
        raise InputError(
            f"{path}: is a MIDI file of format {file.type} with {file.ticks_per_beat} ticks per quarter "
            "note; expected format 0 or 1 and ticks per quarter note, not time code"
        )
    notes: list[list[float]] = []
    sounding: dict[tuple[int, int], deque[int]] = defaultdict(deque)
    n_others, time_s = 0, 0.0
    for message in file:
        time_s += message.time
        if message.type == "note_on" and message.velocity:
            sounding[message.channel, message.note].append(len(notes))
            notes.append([message.note, time_s, np.nan, message.velocity, 0.0, message.channel + 1])
        elif message.type in ("note_on", "note_off"):
            if sounding[message.channel, message.note]:
                note = notes[sounding[message.channel, message.note].popleft()]
                note[2] = time_s - note[1]
        else:
            n_others += not message.is_meta
    n_open = sum(map(len, sounding.values()))
    remarks = [f"{count_of(n_open, 'note', 'have')} no note-off message"] if n_open else []
    if n_others:
        remarks.append(f"{n_others} messages other than notes are left out")
    return Events.of("midi", True, [(f"note {key}", *row) for key, *row in notes], *remarks)


_WHOLE = tuple(name for name in NUMBERS if name.startswith("int"))


def read_markers(path: Path) -> Events:
    """Read the markers in an XDF file: all streams of text, and of integers without a fixed rate.

    A text is the event's name; a number is the event's value, and the stream's name is the event's name.
    Times are corrected by each stream's clock offsets, so that all streams of the file share one clock; sd_s
    is the scatter of the offsets. Raises InputError if the file has no such stream or is damaged.
    """
    streams = read_streams(path)
    markers = [s for s in streams if s.format == TEXT or (s.format in _WHOLE and not s.rate_hz)]
    if not markers:
        have = list_names([f"{stream.name} ({stream.type or 'no type'})" for stream in streams])
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
            notes.append(f"stream {stream.name} has no clock offsets; the recorder's clock is assumed")
        sd_s = _scatter_s(samples.offsets)
        for time, sample in zip(samples.time_s.tolist(), samples.values, strict=True):
            name, value = stream.name, np.nan
            if stream.format != TEXT:
                value = float(sample[0])
            else:
                name = "; ".join(filter(None, map(str, sample)))
            rows.append((name or "marker", time, np.nan, value, sd_s))
    if len(markers) > 1:  # the order within a single stream shows whether its clock was set back
        rows.sort(key=lambda row: row[1])
    return Events.of("xdf", True, rows, *notes)


def _scatter_s(offsets: Array) -> float:
    """Return the scatter (rms, s) of clock offsets (N, 2) about a straight line; 0 if there are too few."""
    time_s, offset_s = offsets[(np.abs(offsets) < FARTHEST_S).all(-1)].T
    if len(time_s) < 3 or not np.ptp(time_s) > 0:
        return 0.0
    at_s = (time_s - time_s.mean()) / np.ptp(time_s)
    return float(np.std(offset_s - np.polyval(np.polyfit(at_s, offset_s, 1), at_s)))


def read_tracker_events(path: Path) -> Events:
    """Read from a raw capture when the sync input was on and when each stylus button was down.

    Events are named sync or button; a button's value is its station. Times are on the recording's clock: a
    flag that rises between two frames is assumed to rise in the middle, with a 1-sigma error of the interval
    over sqrt(12). A flag that is on in the first frame is left out, since it rose earlier. Raises InputError
    if the file is not a raw capture, or if its tracker sends neither flag.
    """
    archive = open_archive(path)
    parts = [np.empty((4, 0))]
    for part in flagged_records(archive, survey_archive(archive)):
        records = part.records
        flags = np.array([records.station, part.time_s, records.sync, records.button], float)
        parts.append(flags[:, part.usable])
    station, time_s, sync, button = np.concatenate(parts, 1)
    if not (sync >= 0).any() and not (button >= 0).any():
        raise InputError(f"{path}: its tracker sent neither sync nor buttons; expected one of them")
    stations = np.unique(station)
    rows = list(_pulses(time_s, sync, station == stations[0], "sync", np.nan))
    for number in stations:
        rows += _pulses(time_s, button, station == number, "button", float(number))
    rows.sort(key=lambda row: row[1])
    return Events.of("tracker", False, rows)


def _pulses(
    time_s: Array, flag: Array, of_station: Bools, name: str, value: float
) -> Iterator[tuple[str, float, float, float, float]]:
    """Yield the rows of events of a flag (N,), which is negative if it was not sent."""
    sent = np.flatnonzero(of_station & (flag >= 0))
    at, step = time_s[sent], np.diff((flag[sent] > 0).astype(int))
    change = np.flatnonzero(step)
    middle, gap = (at[change] + at[change + 1]) / 2, at[change + 1] - at[change]
    ends = np.append(middle[1:], np.nan)
    for rise in np.flatnonzero(step[change] > 0):
        begin = float(middle[rise])
        yield name, begin, float(ends[rise]) - begin, value, float(gap[rise] / np.sqrt(12))
