"""Notes of a standard MIDI file (MIDI 1.0, RP-001), format 0 or 1, on the file's own clock; read by mido."""

from __future__ import annotations

from collections import defaultdict, deque
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.limits import check_regular
from shukotsu.files.text_files import reading
from shukotsu.stages.align_events.event_list import Array, Clock, Events

EXPECTED = "a standard MIDI file (.mid)"
DEFAULT_TEMPO_US = 500_000
"""Microseconds a quarter note until the file says otherwise: 120 a minute."""

FRAMES_PER_S = {24: 24.0, 25: 25.0, 29: 30_000 / 1001, 30: 30.0}
"""SMPTE time codes."""


def read_midi(path: Path) -> Events:
    """Read the notes: named `note 60`, value the velocity (1 to 127), channel 1 to 16.

    A note lasts to its note off; a key that is struck again before ends in the order in which it began.
    All tracks share the file's tempo changes. Raises InputError where the file is none of that kind, is of
    format 2 or is cut off or damaged.
    """
    import mido

    with reading(path, EXPECTED):
        check_regular(path, EXPECTED)
        try:
            file = mido.MidiFile(path)
        except Exception as error:  # mido raises whatever its code runs into
            why = str(error) or "it is cut off"
            raise InputError(f"{path}: cannot be read as {EXPECTED}: {why}; save or copy it again") from error
    if file.type not in (0, 1):
        raise InputError(
            f"{path}: is a MIDI file of format {file.type}; expected 0 or 1: save it as one of these"
        )
    division = file.ticks_per_beat
    tempos: list[tuple[int, int]] = []
    notes: list[tuple[int, int, int, int, int | None]] = []
    n_ignored = 0
    for track in file.tracks:
        sounding: dict[tuple[int, int], deque[int]] = defaultdict(deque)
        tick = 0
        for message in track:
            tick += message.time
            if message.type == "set_tempo":
                tempos.append((tick, message.tempo))
            elif message.type not in ("note_on", "note_off"):
                n_ignored += not message.is_meta
            elif message.type == "note_on" and message.velocity:
                sounding[message.channel, message.note].append(len(notes))
                notes.append((tick, message.channel, message.note, message.velocity, None))
            elif sounding[message.channel, message.note]:
                place = sounding[message.channel, message.note].popleft()
                notes[place] = (*notes[place][:4], tick)
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


def _seconds(path: Path, division: int, tempos: list[tuple[int, int]], tick: Array) -> Array:
    """Seconds from the file's start, (N,); NaN stays."""
    if division < 0:
        frames, per_frame = -(division >> 8), division & 0xFF
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
