"""Events of files: notes of MIDI by mido, markers of XDF streams, and what a raw capture of a tracker saw."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, count_of, list_names
from shukotsu.tables.limits import check_regular
from shukotsu.tables.text_files import reading
from shukotsu.tables.xdf_streams import NUMBERS, TEXT, load_stream, read_streams
from shukotsu.tracker.archive import open_archive
from shukotsu.tracker.survey import UNUSABLE, flagged_records, survey_archive

FARTHEST_S = 1e11
"""Three thousand years: a time beyond it is a damaged one."""


@dataclass(frozen=True)
class Events:
    """N events in the order of their file. time_s, duration_s, value : (N,), NaN where nothing says so.

    own_clock : whether times are of the device's clock, not of the recording's time_s. sd_s : (N,) 1-sigma
    error of a time on that clock, 0 where it is not known. channel : (N,) of MIDI, from 1; 0 elsewhere.
    notes : what a reader of the table should know of the file, a sentence each.
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
        """Put events together from rows of name, time_s, duration_s, value[, sd_s[, channel]]."""
        whole = [(*row, *(0.0, 0)[len(row) - 4 :]) for row in rows]
        time_s, duration_s, value, sd_s, channel = (
            np.array([row[column] for row in whole], float) for column in range(1, 6)
        )
        names = tuple(str(row[0]) for row in whole)
        return cls(source, own_clock, names, time_s, duration_s, value, sd_s, channel.astype(np.int64), notes)

    def named(self, name: str) -> Bools:
        """Whether an event has that name, shape (N,)."""
        return np.array([each == name for each in self.names], bool)


EXPECTED = "a standard MIDI file (.mid)"


def read_midi(path: Path) -> Events:
    """Read the notes: named `note 60`, value the velocity (1 to 127), channel 1 to 16.

    A note lasts to its note off; a key that is struck again before ends in the order in which it began. All
    tracks share the file's tempo changes. Raises InputError where the file is none of that kind, is of format
    2, counts time code or is damaged.
    """
    import mido

    with reading(path, EXPECTED):
        check_regular(path, EXPECTED)
        try:
            file = mido.MidiFile(path)
        except MemoryError:
            raise
        except Exception as error:  # mido raises whatever its code runs into
            why = str(error) or "it is cut off"
            raise InputError(f"{path}: cannot be read as {EXPECTED}: {why}; save or copy it again") from error
    if file.type not in (0, 1) or file.ticks_per_beat <= 0:
        raise InputError(
            f"{path}: is a MIDI file of format {file.type} with {file.ticks_per_beat} ticks a quarter note; "
            "expected format 0 or 1 and ticks of a quarter note, not time code: save it so"
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
    remarks = [f"{count_of(n_open, 'note', 'have')} no note off"] if n_open else []
    if n_others:
        remarks.append(f"{n_others} messages that are no notes are left out")
    return Events.of("midi", True, [(f"note {key}", *row) for key, *row in notes], *remarks)


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


def _scatter_s(offsets: Array) -> float:
    """Return the scatter (rms) of clock offsets (N, 2) about a straight line; 0 where there are too few."""
    time_s, offset_s = offsets[(np.abs(offsets) < FARTHEST_S).all(-1)].T
    if len(time_s) < 3 or not np.ptp(time_s) > 0:
        return 0.0
    at_s = (time_s - time_s.mean()) / np.ptp(time_s)
    return float(np.std(offset_s - np.polyval(np.polyfit(at_s, offset_s, 1), at_s)))


def read_tracker_events(path: Path) -> Events:
    """Read when the sync input was on and when each stylus button was down, on the recording's clock.

    path : a raw capture. A flag that rises between two frames rose in the middle, to the interval over
    sqrt(12) (1-sigma). sync is the tracker's, the same of every station; button has the station as value. One
    that is on in the first frame began before, and is left out. Raises InputError where the file is none, or
    its tracker sends neither flag.
    """
    archive = open_archive(path)
    parts = [np.empty((4, 0))]
    for part in flagged_records(archive, survey_archive(archive)):
        good, records = ~part.flagged(*UNUSABLE), part.records
        flags = np.array([records.station, part.time_s, records.sync, records.button], float)
        parts.append(flags[:, good])
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
    """Rows of events, of a flag (N,) that is negative where none was sent."""
    sent = np.flatnonzero(of_station & (flag >= 0))
    at, step = time_s[sent], np.diff((flag[sent] > 0).astype(int))
    change = np.flatnonzero(step)
    middle, gap = (at[change] + at[change + 1]) / 2, at[change + 1] - at[change]
    ends = np.append(middle[1:], np.nan)
    for rise in np.flatnonzero(step[change] > 0):
        begin = float(middle[rise])
        yield name, begin, float(ends[rise]) - begin, value, float(gap[rise] / np.sqrt(12))
