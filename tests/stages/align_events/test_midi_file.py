"""Reading MIDI: what is made of the notes that mido reads, and files that it refuses."""

from pathlib import Path

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.stages.align_events.event_list import Events
from shukotsu.stages.align_events.midi_file import read_midi


def track(content: bytes) -> bytes:
    return b"MTrk" + len(content).to_bytes(4, "big") + content


def midi(*tracks: bytes, kind: int = 1, division: int = 480) -> bytes:
    numbers = b"".join(number.to_bytes(2, "big") for number in (kind, len(tracks), division))
    return b"MThd" + (6).to_bytes(4, "big") + numbers + b"".join(map(track, tracks))


def tempo(us: int) -> bytes:
    return b"\xff\x51\x03" + us.to_bytes(3, "big")


END = b"\x00\xff\x2f\x00"


def read(tmp_path: Path, data: bytes) -> Events:
    (tmp_path / "a.mid").write_bytes(data)
    return read_midi(tmp_path / "a.mid")


def test_a_tempo_of_one_track_holds_for_all(tmp_path: Path) -> None:
    """96 ticks a quarter: one quarter at 0.5 s, two at 0.25 s, the rest at 1 s."""
    first = b"\x60" + tempo(250_000) + b"\x81\x40" + tempo(1_000_000) + END
    second = b"\x30\x92\x18\x01\x30\x82\x18\x00\x81\x70\x92\x18\x7f\x30\x82\x18\x40" + END
    events = read(tmp_path, midi(first, second, division=96))
    np.testing.assert_allclose(events.time_s, [0.25, 1.5])
    np.testing.assert_allclose(events.duration_s, [0.25, 0.5])
    assert events.channel.tolist() == [3, 3]


WHOLE = midi(b"\x00" + tempo(400_000) + END, b"\x00\x90\x3c\x40\x60\x80\x3c\x00" + END)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "cannot be read as a standard MIDI file"),
        (midi(END, kind=2), "of format 2 with"),
        (WHOLE[:-1], "it is cut off"),
        (midi(END, division=0), "0 ticks a quarter"),
        (midi(END, division=0xE728), "expected format 0 or 1 and ticks of a quarter note, not time code"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, data)
