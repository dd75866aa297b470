"""Reading marker streams of XDF: files made here byte by byte (XDF 1.0)."""

import struct
from pathlib import Path

import numpy as np
import pytest
from event_files import marker_stream, xdf_of

from shukotsu.errors import InputError
from shukotsu.stages.align_events.event_list import Events
from shukotsu.stages.align_events.marker_streams import read_markers


def read(tmp_path: Path, data: bytes) -> Events:
    (tmp_path / "a.xdf").write_bytes(data)
    return read_markers(tmp_path / "a.xdf")


OFFSETS = [(100.0, -3.0), (110.0, -3.0), (120.0, -3.0)]


def test_texts_and_numbers_on_one_clock(tmp_path: Path) -> None:
    """Each stream's clock offsets bring it to the recorder's clock; a text is a name, a number a value."""
    words = marker_stream(1, "cues", [["go"], ["Stöp"]], [101.0, 103.5], OFFSETS)
    codes = marker_stream(2, "trigger", [[7], [-1]], [99.0, 99.5], [(t, o + 3) for t, o in OFFSETS])
    events = read(tmp_path, xdf_of(words, codes))
    assert events.names == ("go", "trigger", "trigger", "Stöp")
    np.testing.assert_allclose(events.time_s, [98.0, 99.0, 99.5, 100.5], atol=1e-9)
    np.testing.assert_array_equal(events.value, [np.nan, 7, -1, np.nan])
    assert (events.own_clock, events.notes) == (True, ())


def test_a_file_that_is_cut_off_gives_what_is_whole(tmp_path: Path) -> None:
    data = xdf_of(marker_stream(1, "cues", [["go"], ["stop"]], [1.0, 2.0]))
    events = read(tmp_path, data[: data.index(b"stop") + 2])
    assert events.names == ("go",)
    assert "cut off" in events.notes[0]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"no", "is no XDF file"),
        (
            xdf_of(marker_stream(1, "eeg", [[1]], [1.0], rate_hz=500)),
            "no stream of markers .*; it has eeg",
        ),
        (
            xdf_of(marker_stream(1, "cues", [["go"]], [1.0])).replace(
                struct.pack("<BI", 4, 2) + b"go", b"\4\3\0\0\0go"
            ),
            "stream cues: is damaged",
        ),
        (
            xdf_of(marker_stream(1, "cues", [["go"]], [1.0])).replace(
                struct.pack("<BI", 4, 2) + b"go", b"\7\2\0\0\0go"
            ),
            "stream cues: is damaged",
        ),
    ],
)
def test_what_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, data)
