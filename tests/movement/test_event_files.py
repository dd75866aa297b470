"""Reading files of events, written here byte by byte: MIDI, XDF 1.0 marker streams and raw captures."""

import struct
from pathlib import Path

import numpy as np
import pytest
from sample_files import flags_of, marker_stream, xdf_of

from shukotsu.errors import InputError
from shukotsu.movement.event_files import Events, read_markers, read_midi, read_tracker_events


def track(content: bytes) -> bytes:
    return b"MTrk" + len(content).to_bytes(4, "big") + content


def midi(*tracks: bytes, kind: int = 1, division: int = 480) -> bytes:
    numbers = b"".join(number.to_bytes(2, "big") for number in (kind, len(tracks), division))
    return b"MThd" + (6).to_bytes(4, "big") + numbers + b"".join(map(track, tracks))


def tempo(us: int) -> bytes:
    return b"\xff\x51\x03" + us.to_bytes(3, "big")


END = b"\x00\xff\x2f\x00"


def read_mid(tmp_path: Path, data: bytes) -> Events:
    (tmp_path / "a.mid").write_bytes(data)
    return read_midi(tmp_path / "a.mid")


def test_a_tempo_in_one_track_applies_to_all(tmp_path: Path) -> None:
    """At 96 ticks per quarter note, one quarter lasts 0.5 s, two last 0.25 s, the others 1 s."""
    first = b"\x60" + tempo(250_000) + b"\x81\x40" + tempo(1_000_000) + END
    second = b"\x30\x92\x18\x01\x30\x82\x18\x00\x81\x70\x92\x18\x7f\x30\x82\x18\x40" + END
    events = read_mid(tmp_path, midi(first, second, division=96))
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
        (midi(END, division=0), "0 ticks per quarter"),
        (midi(END, division=0xE728), "expected format 0 or 1 and ticks per quarter note, not time code"),
    ],
)
def test_unsupported_midi_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_mid(tmp_path, data)


def read_xdf(tmp_path: Path, data: bytes) -> Events:
    (tmp_path / "a.xdf").write_bytes(data)
    return read_markers(tmp_path / "a.xdf")


OFFSETS = [(100.0, -3.0), (110.0, -3.0), (120.0, -3.0)]


def test_marker_streams_are_merged_on_one_clock(tmp_path: Path) -> None:
    """Each stream's clock offsets are applied; texts become names, numbers values."""
    words = marker_stream(1, "cues", ["go", "Stöp"], [101.0, 103.5], OFFSETS)
    codes = marker_stream(2, "trigger", [7, -1], [99.0, 99.5], [(t, o + 3) for t, o in OFFSETS])
    events = read_xdf(tmp_path, xdf_of(words, codes))
    assert events.names == ("go", "trigger", "trigger", "Stöp")
    np.testing.assert_allclose(events.time_s, [98.0, 99.0, 99.5, 100.5], atol=1e-9)
    np.testing.assert_array_equal(events.value, [np.nan, 7, -1, np.nan])
    assert (events.own_clock, events.notes) == (True, ())


def test_a_truncated_file_gives_its_complete_markers(tmp_path: Path) -> None:
    data = xdf_of(marker_stream(1, "cues", ["go", "wait", "stop"], [1.0, 2.0, 3.0]))
    events = read_xdf(tmp_path, data[: data.index(b"stop") + 2])
    assert events.names == ("go", "wait")
    assert "cut off" in events.notes[0]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"no", "is not an XDF file"),
        (xdf_of(marker_stream(1, "eeg", [1], [1.0], rate_hz=500)), "no stream of markers .*; it has eeg"),
        (
            xdf_of(marker_stream(1, "cues", ["go"], [1.0])).replace(
                struct.pack("<BI", 4, 2) + b"go", b"\4\3\0\0\0go"
            ),
            "stream cues: is damaged",
        ),
        (
            xdf_of(marker_stream(1, "cues", ["go"], [1.0])).replace(
                struct.pack("<BI", 4, 2) + b"go", b"\7\2\0\0\0go"
            ),
            "stream cues: is damaged",
        ),
    ],
)
def test_unsupported_xdf_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_xdf(tmp_path, data)


FRAMES = 10
RATE_HZ = 240.0


def records(
    tmp_path: Path, sync: list[int], buttons: dict[int, list[int]], lost: tuple[int, ...] = ()
) -> Events:
    rows = [
        (frame, station, sync[frame], buttons.get(station, [0] * FRAMES)[frame])
        for frame in range(FRAMES)
        for station in (1, 2)
        if frame not in lost
    ]
    return read_tracker_events(flags_of(tmp_path / "records.arrows", rows))


def test_sync_and_buttons_become_events_between_two_frames(tmp_path: Path) -> None:
    """Sync is one event, although every station reports it; a button's event has its station as value."""
    events = records(tmp_path, [0, 0, 1, 1, 0, 0, 0, 1, 0, 0], {2: [0, 0, 0, 1, 1, 1, 0, 0, 0, 0]})
    assert events.names == ("sync", "button", "sync")
    np.testing.assert_allclose(events.time_s * RATE_HZ, [1.5, 2.5, 6.5])
    np.testing.assert_allclose(events.duration_s * RATE_HZ, [2, 3, 1])
    np.testing.assert_array_equal(events.value, [np.nan, 2, np.nan])
    np.testing.assert_allclose(events.sd_s * RATE_HZ, np.full(3, 12**-0.5))
    assert not events.own_clock


def test_lost_frames_increase_the_time_error(tmp_path: Path) -> None:
    events = records(tmp_path, [0, 0, 0, 0, 1, 1, 1, 1, 1, 1], {}, lost=(2, 3))
    np.testing.assert_allclose(events.time_s * RATE_HZ, [2.5])
    np.testing.assert_allclose(events.sd_s * RATE_HZ, [3 / np.sqrt(12)])
    assert np.isnan(events.duration_s).all()
