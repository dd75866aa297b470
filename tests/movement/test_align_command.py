"""The command line: one recording alone, a subject's plan, and recordings whose events cannot be read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sample_files import midi_of, poses_of, records_of
from small_study import HEADER, write_plans, write_study
from stage_runs import align_events as main

from shukotsu.study.plan import read_plan
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.typed_table import read_table, rows_of

TRUE_S = np.cumsum([1.0, 0.7, 1.9, 1.1, 2.3, 0.9, 1.4, 3.0, 0.8, 1.7])
KEY = {"subject": "01", "session": "", "hand": "right", "task": "piece", "trial": "2"}


def run(folder: Path, *argv: object) -> int:
    outputs = ["--out", folder / "events.parquet", "--out-clocks", folder / "clocks.parquet"]
    return main([str(argument) for argument in (*argv, *outputs)])


def rows(folder: Path, name: str) -> list[dict[str, Any]]:
    return list(rows_of(read_table(folder / f"{name}.parquet", TABLES[name])))


def test_a_recording_alone(tmp_path: Path) -> None:
    files = ["--poses", poses_of(tmp_path), "--events", midi_of(tmp_path, TRUE_S + 7)]
    assert run(tmp_path, *files, "--pulses", "note 24", "--recording", records_of(tmp_path, TRUE_S)) == 0
    events = rows(tmp_path, "events")
    assert {name: events[0][name] for name in KEY} == KEY
    notes = [row for row in events if row["name"] == "note 60"]
    np.testing.assert_allclose([row["onset_s"] for row in notes], TRUE_S + 0.25, atol=0.003)
    assert [row["event"] for row in events] == list(range(20))
    (clock,) = rows(tmp_path, "clocks")
    assert {name: clock[name] for name in KEY} == KEY
    assert (clock["source"], clock["n_pulses"], clock["status"]) == ("midi", 10, "ok")


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ((), "--plan, or --poses and --events: give the subject's plan"),
        (("--poses", "{poses}", "--events", "no.mid"), "no.mid: no such file; expected a standard MIDI file"),
        (("--poses", "{poses}", "--events", "{midi}"), "runs on a clock of its own"),
    ],
)
def test_bad_input_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], argv: tuple[str, ...], message: str
) -> None:
    files = {"poses": poses_of(tmp_path), "midi": midi_of(tmp_path, TRUE_S)}
    assert run(tmp_path, *(argument.format(**files) for argument in argv)) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "events.parquet").exists()


def test_a_plan_names_files_pulses_and_rows_of_the_sheet(tmp_path: Path) -> None:
    """A file that cannot be read is its recording's own problem; rows go to the recording that they name."""
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
    events = rows(tmp_path, "events")
    assert [(row["hand"], row["onset_s"]) for row in events if row["task"] == "scale"] == [("left", 3.5)]
    onsets_s = [row["onset_s"] for row in events if row["name"] == "note 60"]
    np.testing.assert_allclose(onsets_s, TRUE_S + 0.25, atol=0.003)
    clocks = {(row["hand"], row["task"]): row for row in rows(tmp_path, "clocks")}
    assert clocks["right", "piece"]["status"] == "ok"
    assert clocks["right", "scale"]["status"] == "failed"
    assert "no.mid: no such file" in clocks["right", "scale"]["message"]
    assert ("left", "scale") not in clocks
