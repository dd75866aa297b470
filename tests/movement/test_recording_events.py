"""Aligning events of all sources to a recording's clock, cutting cycles, and the stage align_events."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_files import EVENTS, midi_of, poses_of, records_of
from small_study import HEADER, write_plans, write_study
from stage_runs import align_events as main

from shukotsu.errors import InputError
from shukotsu.movement.cycles import cut_cycles, within_recording
from shukotsu.movement.recording_events import READERS, RecordingEvents, read_events
from shukotsu.study.plan_file import read_plan
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.typed_table import read_table, rows_of

REPOSITORY = Path(__file__).resolve().parents[2]
TRUE_S = np.cumsum([1.0, 0.7, 1.9, 1.1, 2.3, 0.9, 1.4, 3.0, 0.8, 1.7])
"""Times of the pulses on the recording's clock."""


def sheet(*onsets_s: float, name: str = "sync") -> list[dict[str, Any]]:
    return [{"onset_s": onset_s, "name": name, "duration_s": None, "value": None} for onset_s in onsets_s]


def names(rows: list[dict[str, Any]]) -> list[tuple[str, float]]:
    return [(row["name"], row["onset_s"]) for row in rows]


def test_events_of_the_sheet_need_no_clock(tmp_path: Path) -> None:
    events, clocks = RecordingEvents(poses_of(tmp_path), rows=sheet(2.0, 1.0)).aligned()
    assert names(events) == [("sync", 1.0), ("sync", 2.0)]
    assert clocks == []


def check_midi(recording: RecordingEvents, tolerance_s: float) -> dict[str, Any]:
    """Check that notes are at the times of playing; return the row of clocks."""
    events, (clock,) = recording.aligned()
    played = [row for row in events if row["source"] == "midi" and row["name"] == "note 60"]
    np.testing.assert_allclose([row["onset_s"] for row in played], TRUE_S + 0.25, atol=tolerance_s)
    assert [row["value"] for row in played] == [64.0] * len(TRUE_S)
    assert {row["channel"] for row in played} == {1}
    assert all(row["onset_sd_ms"] > 0 for row in played)
    return clock


@pytest.mark.parametrize("pulses", ["note 24 = sync", "note 24=sync", "note 24"])
def test_midi_is_aligned_by_the_trackers_sync_input(tmp_path: Path, pulses: str) -> None:
    """Its pulses, note 24, are off by 40 s and 200 ppm; frames at 240 Hz have an error of 1.2 ms."""
    file = midi_of(tmp_path, (TRUE_S + 40) * (1 + 200e-6))
    records = records_of(tmp_path, TRUE_S)
    clock = check_midi(RecordingEvents(poses_of(tmp_path), records, file, pulses), 0.003)
    assert (clock["status"], clock["n_pulses"]) == ("ok", 10)
    assert clock["offset_s"] == pytest.approx(-40, abs=0.01)
    assert clock["residual_ms"] < 2.5
    assert 0 < clock["clock_sd_ms"] < 3


def test_midi_is_aligned_by_events_of_the_sheet(tmp_path: Path) -> None:
    """The events are claps that were seen in the recording."""
    file = midi_of(tmp_path, TRUE_S + 40)
    rows = sheet(*TRUE_S, name="clap")
    recording = RecordingEvents(poses_of(tmp_path), None, file, "note 24 = clap", rows)
    assert check_midi(recording, 0.003)["n_pulses"] == 10


@pytest.mark.parametrize(
    ("pulses", "rows", "message"),
    [
        ("", [], "has its own clock; state which of its events are also in the recording"),
        ("note 25", [], "has no event named 'note 25'; it has note 24, note 60"),
        ("note 24", [], "the recording has no events named 'note 24' to align them with"),
        ("note 24 = clap", sheet(1.0), "the recording has no events named 'clap'"),
    ],
)
def test_missing_pulses_are_refused_with_the_reason(
    tmp_path: Path, pulses: str, rows: list[dict[str, Any]], message: str
) -> None:
    recording = RecordingEvents(poses_of(tmp_path), None, midi_of(tmp_path, TRUE_S), pulses, rows)
    with pytest.raises(InputError, match=message):
        recording.aligned()


def test_the_trackers_events_need_no_alignment(tmp_path: Path) -> None:
    events, (clock,) = RecordingEvents(poses_of(tmp_path), file=records_of(tmp_path, TRUE_S)).aligned()
    np.testing.assert_allclose([row["onset_s"] for row in events], TRUE_S, atol=1 / 240)
    assert events[0]["onset_sd_ms"] == pytest.approx(1e3 / 240 / np.sqrt(12))
    assert (clock["source"], clock["status"], clock["offset_s"]) == ("tracker", "ok", 0)


def test_every_file_extension_has_a_sample_and_is_in_the_guide() -> None:
    page = (REPOSITORY / "docs" / "events.md").read_text("utf-8")
    for endings in READERS:
        assert any(name.endswith(endings) for name in EVENTS)
        assert f"`*{endings[0]}`" in page or f"`{endings[0]}`" in page


@pytest.mark.slow
@pytest.mark.parametrize("name", EVENTS)
@settings(max_examples=20, deadline=None)
@given(share=st.floats(0, 1), byte=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_file_is_read_or_refused(
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


NAN = float("nan")


def test_a_cycle_lasts_until_the_next_event_or_the_events_end() -> None:
    cycles = cut_cycles("tap", [3.0, 1.0, 2.0], [NAN, NAN, NAN])
    assert [(cycle.number, cycle.onset_s, cycle.duration_s) for cycle in cycles] == [
        (0, 1.0, 1.0),
        (1, 2.0, 1.0),
    ]
    notes = cut_cycles("note", [1.0, 2.0], [0.4, 0.5])
    assert [(cycle.onset_s, cycle.duration_s) for cycle in notes] == [(1.0, 0.4), (2.0, 0.5)]
    assert cut_cycles("once", [1.0], [NAN]) == []


def test_cycles_of_unusual_length_are_refused() -> None:
    cycles = cut_cycles("tap", [0, 1, 2, 3, 3.2, 4.2, 7.2], [NAN] * 7)
    assert [cycle.refusal.partition(":")[0] for cycle in cycles] == ["", "", "", "too short", "", "too long"]


def test_cycles_with_uncertain_ends_are_refused() -> None:
    """The onset, the next onset or the clock may be uncertain, or the cycle outside the recording; an unknown
    error is accepted.
    """
    cycles = cut_cycles("tap", [0, 1, 2, 3, 4, 5], [NAN] * 6, [NAN, 0.04, 0.06, 0.0, 0.0, np.inf])
    reasons = ["", "its onset, 60 ms", "its onset, 60 ms", "", "clock of its events is weak"]
    for cycle, reason in zip(cycles, reasons, strict=True):
        assert reason in cycle.refusal
        assert bool(reason) == bool(cycle.refusal)
    cycles = within_recording(cut_cycles("tap", [0.0, 1.0, 2.0], [0.9] * 3), np.array([0.5, 2.5]))
    assert [bool(cycle.refusal) for cycle in cycles] == [True, False, True]


KEY = {"subject": "01", "session": "", "hand": "right", "task": "piece", "trial": "2"}


def run(folder: Path, *argv: object) -> int:
    outputs = ["--out", folder / "events.parquet", "--out-clocks", folder / "clocks.parquet"]
    return main([str(argument) for argument in (*argv, *outputs)])


def rows_in(folder: Path, name: str) -> list[dict[str, Any]]:
    return list(rows_of(read_table(folder / f"{name}.parquet", TABLES[name])))


def test_the_stage_aligns_a_recording_without_a_plan(tmp_path: Path) -> None:
    files = ["--poses", poses_of(tmp_path), "--events", midi_of(tmp_path, TRUE_S + 7)]
    assert run(tmp_path, *files, "--pulses", "note 24", "--recording", records_of(tmp_path, TRUE_S)) == 0
    events = rows_in(tmp_path, "events")
    assert {name: events[0][name] for name in KEY} == KEY
    notes = [row for row in events if row["name"] == "note 60"]
    np.testing.assert_allclose([row["onset_s"] for row in notes], TRUE_S + 0.25, atol=0.003)
    assert [row["event"] for row in events] == list(range(20))
    (clock,) = rows_in(tmp_path, "clocks")
    assert {name: clock[name] for name in KEY} == KEY
    assert (clock["source"], clock["n_pulses"], clock["status"]) == ("midi", 10, "ok")


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ((), "--plan, or --poses and --events: give the subject's plan"),
        (("--poses", "{poses}", "--events", "no.mid"), "no.mid: no such file; expected a standard MIDI file"),
        (("--poses", "{poses}", "--events", "{midi}"), "has its own clock"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], argv: tuple[str, ...], message: str
) -> None:
    files = {"poses": poses_of(tmp_path), "midi": midi_of(tmp_path, TRUE_S)}
    assert run(tmp_path, *(argument.format(**files) for argument in argv)) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "events.parquet").exists()


def test_the_stage_aligns_every_recording_of_a_plan(tmp_path: Path) -> None:
    """Rows of the sheet go to the recording that they name; an unreadable file fails its own recording
    only.
    """
    head = HEADER.replace("\t", " ").split(" ")
    study = write_study(
        tmp_path,
        "01 right piece both a.arrows 2",
        "01 right scale both b.parquet",
        "01 left scale both c.parquet",
        events="subject hand task onset_s name\n01 left scale 3.5 tap\n01 right scale 1 tap",
    )
    sheet = tmp_path / "sheets" / "recordings.tsv"
    lines = [line.split("\t") for line in sheet.read_text().splitlines()]
    added = [("events", "pulses"), ("take.mid", "note 24"), ("no.mid", ""), ("", "")]
    whole = [[*line, *[""] * (len(head) - len(line)), *more] for line, more in zip(lines, added, strict=True)]
    sheet.write_text("\n".join("\t".join(line) for line in whole))
    midi_of(tmp_path, TRUE_S + 7)
    records_of(tmp_path, TRUE_S).rename(tmp_path / "a.arrows")
    path = write_plans(study)["01"]
    plan = read_plan(path)
    for recording in plan.recordings:
        plan.poses(recording).parent.mkdir(parents=True)
        poses_of(plan.poses(recording).parent, **recording.key)
    assert run(tmp_path, "--plan", path) == 2
    assert run(tmp_path, "--record-failure", "--plan", path) == 0
    events = rows_in(tmp_path, "events")
    assert [(row["hand"], row["onset_s"]) for row in events if row["task"] == "scale"] == [("left", 3.5)]
    onsets_s = [row["onset_s"] for row in events if row["name"] == "note 60"]
    np.testing.assert_allclose(onsets_s, TRUE_S + 0.25, atol=0.003)
    clocks = {(row["hand"], row["task"]): row for row in rows_in(tmp_path, "clocks")}
    assert clocks["right", "piece"]["status"] == "ok"
    assert clocks["right", "scale"]["status"] == "failed"
    assert "no.mid: no such file" in clocks["right", "scale"]["message"]
    assert ("left", "scale") not in clocks
