"""Notes of a standard MIDI file (MIDI 1.0, RP-001), format 0 or 1, on the file's own clock."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.limits import read_whole
from shukotsu.files.text_files import reading
from shukotsu.stages.align_events.event_list import Array, Clock, Events

EXPECTED = "a standard MIDI file (.mid)"
DEFAULT_TEMPO_US = 500_000
"""Microseconds a quarter note until the file says otherwise: 120 a minute."""

FRAMES_PER_S = {24: 24.0, 25: 25.0, 29: 30_000 / 1001, 30: 30.0}
"""SMPTE time codes."""

_NOTE_OFF, _NOTE_ON, _PROGRAM, _PRESSURE = 0x80, 0x90, 0xC0, 0xD0
_META, _TEMPO, _END_OF_TRACK = 0xFF, 0x51, 0x2F
_SYSTEM_EXCLUSIVE = (0xF0, 0xF7)


def read_midi(path: Path) -> Events:
    """Read the notes: named `note 60`, value the velocity (1 to 127), channel 1 to 16.

    A note lasts to its note off; a key that is struck again before ends in the order in which it began.
    All tracks share the file's tempo changes. Raises InputError where the file is none of that kind, is of
    format 2 or is cut off or damaged.
    """
    with reading(path, EXPECTED):
        data = read_whole(path, EXPECTED)
    division, tracks = _tracks(path, data)
    tempos: list[tuple[int, int]] = []
    notes: list[tuple[int, int, int, int, int | None]] = []
    n_ignored = 0
    for number, (start, end) in enumerate(tracks, 1):
        own, n_others = _notes_of_track(_Track(path, data, start, end, number), tempos)
        notes += own
        n_ignored += n_others
    notes.sort(key=lambda note: note[0])
    begin_s = _seconds(path, division, tempos, np.array([note[0] for note in notes], float))
    end_s = _seconds(path, division, tempos, np.array([n[4] if n[4] is not None else np.nan for n in notes]))
    n_open = int(np.isnan(end_s).sum())
    remarks = [f"{n_open} notes have no note off"] * (n_open > 0)
    remarks += [f"{n_ignored} messages that are no notes are left out"] * (n_ignored > 0)
    rows = (
        (f"note {key}", time_s, until_s - time_s, velocity, 0.0, channel + 1)
        for (_, channel, key, velocity, _), time_s, until_s in zip(notes, begin_s, end_s, strict=True)
    )
    return Events.of("midi", Clock.OWN, rows, *remarks)


def _tracks(path: Path, data: bytes) -> tuple[int, list[tuple[int, int]]]:
    """The header's division, and where each track's messages start and end."""
    if not data.startswith(b"MThd") or len(data) < 14:
        raise InputError(f"{path}: does not begin with MThd; expected {EXPECTED}")
    length, kind, n_tracks, division = (
        int.from_bytes(data[a:b], "big") for a, b in ((4, 8), (8, 10), (10, 12), (12, 14))
    )
    if kind not in (0, 1):
        raise InputError(f"{path}: is a MIDI file of format {kind}; expected 0 or 1: save it as one of these")
    tracks: list[tuple[int, int]] = []
    at = 8 + length
    while at + 8 <= len(data) and len(tracks) < n_tracks:
        end = at + 8 + int.from_bytes(data[at + 4 : at + 8], "big")
        if data[at : at + 4] == b"MTrk":
            if end > len(data):
                raise InputError(f"{path}: is cut off in track {len(tracks) + 1}; save or copy it again")
            tracks.append((at + 8, end))
        at = end
    if len(tracks) != n_tracks:
        raise InputError(f"{path}: has {len(tracks)} tracks and its header says {n_tracks}; copy it again")
    return division, tracks


class _Track:
    """The bytes of a track, read one after the other."""

    def __init__(self, path: Path, data: bytes, start: int, end: int, number: int) -> None:
        self._data, self._at, self._end = data, start, end
        self._where = f"{path}: track {number}"

    def damaged(self, what: str) -> InputError:
        return InputError(f"{self._where}: is damaged at byte {self._at}: {what}; copy the file again")

    def byte(self) -> int:
        if self._at >= self._end:
            raise self.damaged("it ends within a message")
        self._at += 1
        return self._data[self._at - 1]

    def data_byte(self) -> int:
        value = self.byte()
        if value & 0x80:
            raise self.damaged("a status byte stands where a number is due")
        return value

    def length(self) -> int:
        """A number of variable length, of at most four bytes."""
        value = 0
        for _ in range(4):
            byte = self.byte()
            value = value << 7 | byte & 0x7F
            if byte < 0x80:
                return value
        raise self.damaged("a number has more than four bytes")

    def skip(self) -> bytes:
        """The bytes whose number stands before them."""
        count = self.length()
        if self._at + count > self._end:
            raise self.damaged("it ends within a message")
        self._at += count
        return self._data[self._at - count : self._at]

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Tick, status and data of every message; for a meta event its type and, as data, its content."""
        tick, running = 0, 0
        while self._at < self._end:
            tick += self.length()
            status = self.byte()
            if status == _META:
                kind = self.byte()
                content = self.skip()
                yield tick, _META << 8 | kind, content
                running = 0
                if kind == _END_OF_TRACK:
                    return
                continue
            if status in _SYSTEM_EXCLUSIVE:
                yield tick, status, self.skip()
                running = 0
                continue
            if status < 0x80:  # running status: the byte is the first of the message's numbers
                if not running:
                    raise self.damaged("a message has no status")
                first, status = status, running
            elif status < 0xF0:
                running = status
                first = self.data_byte()
            else:
                raise self.damaged(f"no file may hold the message {status:#x}")
            two = status & 0xF0 not in (_PROGRAM, _PRESSURE)
            yield tick, status, bytes([first, self.data_byte()] if two else [first])


def _notes_of_track(
    track: _Track, tempos: list[tuple[int, int]]
) -> tuple[list[tuple[int, int, int, int, int | None]], int]:
    """Notes as (tick, channel, key, velocity, tick of the end), and how many messages are neither.

    Tempo changes (tick, microseconds a quarter) are added to `tempos`.
    """
    notes: list[tuple[int, int, int, int, int | None]] = []
    sounding: dict[tuple[int, int], deque[int]] = defaultdict(deque)
    n_others = 0
    for tick, status, content in track.messages():
        kind, channel = status & 0xF0, status & 0x0F
        if status == _META << 8 | _TEMPO:
            if len(content) != 3 or not any(content):
                raise track.damaged("a tempo is no number of microseconds")
            tempos.append((tick, int.from_bytes(content, "big")))
        elif status < _META and kind == _NOTE_ON and content[1]:
            sounding[channel, content[0]].append(len(notes))
            notes.append((tick, channel, content[0], content[1], None))
        elif status < _META and kind in (_NOTE_ON, _NOTE_OFF):
            if sounding[channel, content[0]]:
                own = sounding[channel, content[0]].popleft()
                notes[own] = (*notes[own][:4], tick)
        else:
            n_others += status < _META
    return notes, n_others


def _seconds(path: Path, division: int, tempos: list[tuple[int, int]], tick: Array) -> Array:
    """Seconds from the file's start, (N,); NaN stays."""
    if division & 0x8000:
        frames, per_frame = 256 - (division >> 8), division & 0xFF
        if frames not in FRAMES_PER_S or not per_frame:
            raise InputError(
                f"{path}: its header counts {frames} frames a second of {per_frame} ticks; expected 24, 25, "
                "29 or 30, of 1 tick or more; copy the file again"
            )
        return tick / (FRAMES_PER_S[frames] * per_frame)
    if not division:
        raise InputError(f"{path}: its header counts 0 ticks a quarter note; copy the file again")
    changes = {0: DEFAULT_TEMPO_US} | dict(sorted(tempos, key=lambda change: change[0]))
    ticks, us = np.array([*changes], float), np.array([*changes.values()], float)
    begin_us = np.concatenate([[0.0], np.cumsum(np.diff(ticks) * us[:-1])]) / division
    place = np.searchsorted(ticks, tick, "right") - 1
    return np.asarray((begin_us[place] + (tick - ticks[place]) * us[place] / division) * 1e-6)
