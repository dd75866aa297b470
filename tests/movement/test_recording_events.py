"""Events of one recording from every source, on its clock."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_files import EVENTS, midi_of, poses_of, records_of

from shukotsu.errors import InputError
from shukotsu.movement.recording_events import READERS, RecordingEvents, read_events

REPOSITORY = Path(__file__).resolve().parents[2]
TRUE_S = np.cumsum([1.0, 0.7, 1.9, 1.1, 2.3, 0.9, 1.4, 3.0, 0.8, 1.7])
"""Pulses, on the recording's clock."""


def sheet(*onsets_s: float, name: str = "sync") -> list[dict[str, Any]]:
    return [{"onset_s": onset_s, "name": name, "duration_s": None, "value": None} for onset_s in onsets_s]


def names(rows: list[dict[str, Any]]) -> list[tuple[str, float]]:
    return [(row["name"], row["onset_s"]) for row in rows]


def test_a_sheet_alone_has_no_clock_of_its_own(tmp_path: Path) -> None:
    events, clocks = RecordingEvents(poses_of(tmp_path), rows=sheet(2.0, 1.0)).aligned()
    assert names(events) == [("sync", 1.0), ("sync", 2.0)]
    assert clocks == []


def check_midi(recording: RecordingEvents, tolerance_s: float) -> dict[str, Any]:
    """The notes stand where they were played; gives the row of clocks."""
    events, (clock,) = recording.aligned()
    played = [row for row in events if row["source"] == "midi" and row["name"] == "note 60"]
    np.testing.assert_allclose([row["onset_s"] for row in played], TRUE_S + 0.25, atol=tolerance_s)
    assert [row["value"] for row in played] == [64.0] * len(TRUE_S)
    assert {row["channel"] for row in played} == {1}
    assert all(row["onset_sd_ms"] > 0 for row in played)
    return clock


@pytest.mark.parametrize("pulses", ["note 24 = sync", "note 24=sync", "note 24"])
def test_midi_is_brought_over_by_the_trackers_sync_input(tmp_path: Path, pulses: str) -> None:
    """Its pulses are the note 24, 200 ppm and 40 s off; frames at 240 Hz leave 1.2 ms open."""
    file = midi_of(tmp_path, (TRUE_S + 40) * (1 + 200e-6))
    records = records_of(tmp_path, TRUE_S)
    clock = check_midi(RecordingEvents(poses_of(tmp_path), records, file, pulses), 0.003)
    assert (clock["status"], clock["n_pulses"]) == ("ok", 10)
    assert clock["offset_s"] == pytest.approx(-40, abs=0.01)
    assert clock["residual_ms"] < 2.5
    assert 0 < clock["clock_sd_ms"] < 3


def test_midi_is_brought_over_by_events_of_the_sheet(tmp_path: Path) -> None:
    """As claps that were seen in the recording itself."""
    file = midi_of(tmp_path, TRUE_S + 40)
    rows = sheet(*TRUE_S, name="clap")
    recording = RecordingEvents(poses_of(tmp_path), None, file, "note 24 = clap", rows)
    assert check_midi(recording, 0.003)["n_pulses"] == 10


@pytest.mark.parametrize(
    ("pulses", "rows", "message"),
    [
        ("", [], "runs on a clock of its own; say which of its events the recording has as well"),
        ("note 25", [], "has no event named 'note 25'; it has note 24, note 60"),
        ("note 24", [], "the recording has no events named 'note 24' to bring them to"),
        ("note 24 = clap", sheet(1.0), "the recording has no events named 'clap'"),
    ],
)
def test_what_is_missing_is_said(
    tmp_path: Path, pulses: str, rows: list[dict[str, Any]], message: str
) -> None:
    recording = RecordingEvents(poses_of(tmp_path), None, midi_of(tmp_path, TRUE_S), pulses, rows)
    with pytest.raises(InputError, match=message):
        recording.aligned()


def test_the_trackers_own_events(tmp_path: Path) -> None:
    events, (clock,) = RecordingEvents(poses_of(tmp_path), file=records_of(tmp_path, TRUE_S)).aligned()
    np.testing.assert_allclose([row["onset_s"] for row in events], TRUE_S, atol=1 / 240)
    assert events[0]["onset_sd_ms"] == pytest.approx(1e3 / 240 / np.sqrt(12))
    assert (clock["source"], clock["status"], clock["offset_s"]) == ("tracker", "ok", 0)


def test_every_ending_has_a_sample_and_its_place_in_the_guide() -> None:
    page = (REPOSITORY / "docs" / "events.md").read_text("utf-8")
    for endings in READERS:
        assert any(name.endswith(endings) for name in EVENTS)
        assert f"`*{endings[0]}`" in page or f"`{endings[0]}`" in page


@pytest.mark.parametrize("name", EVENTS)
@settings(max_examples=20, deadline=None)
@given(share=st.floats(0, 1), byte=st.integers(0, 255), cut=st.booleans())
def test_a_spoilt_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, name: str, share: float, byte: int, cut: bool
) -> None:
    data = EVENTS[name]()
    at = int(share * (len(data) - 1))
    path = tmp_path_factory.mktemp("spoilt") / name
    path.write_bytes(data[:at] if cut else data[:at] + bytes([byte]) + data[at + 1 :])
    try:
        events = read_events(path)
    except InputError:
        return
    assert np.isfinite(events.time_s).all()
