"""Notes of a standard MIDI file, format 0 or 1, on the file's own clock; read by mido."""

from __future__ import annotations

from collections import defaultdict, deque
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.limits import check_regular
from shukotsu.files.text_files import reading
from shukotsu.stages.align_events.event_list import Events

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
    remarks = [f"{n_open} notes have no note off"] * (n_open > 0)
    remarks += [f"{n_others} messages that are no notes are left out"] * (n_others > 0)
    return Events.of("midi", True, [(f"note {key}", *row) for key, *row in notes], *remarks)
