"""Reading MIDI: files assembled here byte by byte, their times worked out with fractions."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shukotsu.errors import InputError
from shukotsu.stages.align_events.event_list import Events
from shukotsu.stages.align_events.midi_file import read_midi


def length(value: int) -> bytes:
    """A number of variable length."""
    parts = [value & 0x7F]
    while value := value >> 7:
        parts.append(value & 0x7F | 0x80)
    return bytes(reversed(parts))


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


NOTE = st.tuples(st.integers(0, 5000), st.integers(0, 127), st.integers(1, 127), st.integers(1, 3000))
CHANGE = st.tuples(st.integers(0, 5000), st.integers(1, 2**24 - 1))


@settings(max_examples=20, deadline=None)
@given(
    notes=st.lists(NOTE, min_size=1, max_size=12, unique_by=lambda note: note[1]),
    changes=st.lists(CHANGE, max_size=6, unique_by=lambda change: change[0]),
    division=st.integers(1, 0x7FFF),
)
def test_times_are_those_of_fractions(
    tmp_path_factory: pytest.TempPathFactory,
    notes: list[tuple[int, int, int, int]],
    changes: list[tuple[int, int]],
    division: int,
) -> None:
    def seconds(tick: int) -> Fraction:
        known = [(0, 500_000), *sorted(changes), (10**9, 1)]
        pieces = [max(0, min(tick, after) - begin) * us for (begin, us), (after, _) in pairwise(known)]
        return Fraction(sum(pieces), division * 1_000_000)

    def written(messages: list[tuple[int, bytes]]) -> bytes:
        ticks = [0, *(tick for tick, _ in messages)]
        gaps = [b - a for a, b in pairwise(ticks)]
        return b"".join(length(gap) + own for gap, (_, own) in zip(gaps, messages, strict=True)) + END

    ons = [(begin, bytes([0x91, key, velocity])) for begin, key, velocity, _ in notes]
    offs = [(begin + lasting, bytes([0x81, key, 9])) for begin, key, _, lasting in notes]
    tempos = [(tick, tempo(us)) for tick, us in sorted(changes)]
    data = midi(written(tempos), written(sorted([*ons, *offs])), division=division)
    events = read(tmp_path_factory.mktemp("midi"), data)
    expected = sorted(
        (float(seconds(begin)), f"note {key}", velocity, float(seconds(begin + lasting) - seconds(begin)))
        for begin, key, velocity, lasting in notes
    )
    columns = (events.time_s, events.names, events.value, events.duration_s)
    found = sorted(zip(*columns, strict=True))
    assert [row[1:3] for row in found] == [row[1:3] for row in expected]
    for place in (0, 3):
        times = ([row[place] for row in rows] for rows in (found, expected))
        np.testing.assert_allclose(*times, rtol=1e-9, atol=1e-9)


WHOLE = midi(b"\x00" + tempo(400_000) + END, b"\x00\x90\x3c\x40\x60\x80\x3c\x00" + END)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "cannot be read as a standard MIDI file"),
        (b"RIFF1234RMID", "MThd not found"),
        (midi(END, kind=2), "of format 2 with"),
        (WHOLE[:-1], "it is cut off"),
        (midi(b"\x00\x3c\x40" + END), "running status without last_status"),
        (midi(b"\x00\x90\x3c\x90\x00" + END), "data byte must be in range"),
        (midi(END, division=0), "0 ticks a quarter"),
        (midi(END, division=0xE728), "expected format 0 or 1 and ticks of a quarter note, not time code"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, data)
