"""`shukotsu coach` as a user runs it: refusals, a replay, calibrations from an emulated tracker."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from coach.fake_coach import ReturnHeld
from coached_hands import CALIBRATION, archive, one_after_another
from tracker_processes import emulator

from benchmarks.faultless_hands import exchanged
from shukotsu.coach.board import Board
from shukotsu.commands.coach_hand import _goes_on, build_parser
from shukotsu.commands.coach_hand import main as coach
from shukotsu.commands.new_study import main as new_study
from shukotsu.schemas.catalogue import JOINT_CENTRES
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.sheets import RECORDINGS, read_sheet
from shukotsu.schemas.tables import read_table, rows_of
from shukotsu.stages.fit_hand.receiver_frames import concatenated
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.survey import survey_archive
from shukotsu.trackers.record.recording_terminal import StopRequest


@pytest.fixture
def study(tmp_path: Path) -> Path:
    assert new_study([str(tmp_path / "piano")]) == 0
    (tmp_path / "piano/participants.tsv").write_text(
        "subject\thand_length_mm\thand_breadth_mm\n03\t\t\n04\t\t\n"
    )
    return tmp_path / "piano/study.yaml"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "expected one of --port"),
        (["--port=x", "--replay=y"], "expected one of --port"),
        (["--replay=absent.arrows"], "absent.arrows"),
        (["--follow=absent.arrows", "--study=absent.yaml"], "name the study with --study"),
        (["--replay=x.arrows", "--speed=-1"], "--speed: is -1"),
    ],
)
def test_what_cannot_be_is_refused(options: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert coach([*options, "--no-page"]) == 2
    assert said in capsys.readouterr().err


def test_a_port_that_is_none_is_refused_and_no_file_is_left(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert coach([f"--study={study}", "--port=socket://127.0.0.1:1", "--no-page", "--hand=left"]) == 2
    assert "nothing was recorded" in capsys.readouterr().err
    assert list(study.parent.glob("captures/*")) == []


def test_what_is_entered_after_a_hand_is_none_of_the_next(study: Path) -> None:
    arguments, board = build_parser().parse_args([f"--study={study}", "--hand=left", "--port=x"]), Board()
    arguments.side = arguments.hand
    board.enter({"kind": "length", "quantity": "index_middle", "value_mm": 23.5, "sd_mm": 0.4})
    assert _goes_on(arguments, board, ReturnHeld(), StopRequest())
    assert board.entered() == []
    assert (arguments.subject, arguments.hand) == ("03", "left")


def test_a_log_replaces_nothing_but_a_log(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept.arrows"
    kept.write_bytes(b"ARROW")
    assert coach([f"--replay={kept}", f"--study={study}", f"--log={kept}", "--no-page"]) == 2
    assert "is there and no log" in capsys.readouterr().err
    assert kept.read_bytes() == b"ARROW"


@pytest.mark.parametrize(
    ("kept", "code", "said"), [(0.1, 2, "has no frame of a tracker"), (1.0, 0, "frames show no hand yet")]
)
def test_of_an_archive_that_is_too_short_for_a_hand_that_is_said(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kept: float, code: int, said: str
) -> None:
    recorded = archive(tmp_path, one_after_another((("free", 1.0),)))
    data = recorded.read_bytes()
    recorded.write_bytes(data[: int(kept * len(data))])
    who = [f"--study={study}", "--subject=03", "--hand=left", "--no-page"]
    assert coach([f"--replay={recorded}", "--speed=0", *who]) == code
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_a_replay_says_the_same_to_the_byte_every_time(study: Path, tmp_path: Path) -> None:
    recorded = archive(tmp_path, one_after_another((("free", 8.0), ("spread", 4.0))))
    logs = [tmp_path / name for name in ("a.jsonl", "b.jsonl")]
    for log, speed in zip(logs, ("0", "8"), strict=True):
        who = [f"--study={study}", "--subject=03", "--hand=left", "--no-page", f"--log={log}"]
        assert coach([f"--replay={recorded}", f"--speed={speed}", *who]) == 0
    assert logs[0].read_bytes() == logs[1].read_bytes()
    assert len(logs[0].read_text("utf-8").splitlines()) > 15


@contextmanager
def coached(study: Path, port: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "shukotsu", "coach", f"--port={port}", f"--study={study}", *options]
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=study.parent,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until(process: subprocess.Popen[str], pattern: str) -> str:
    """Give the first line of stderr that matches."""
    assert process.stderr is not None
    for line in process.stderr:
        if re.search(pattern, line):
            return line
    raise AssertionError(f"ended without a line like {pattern!r}")


def played(folder: Path, poses: Poses) -> list[str]:
    """Give options of an emulator that plays poses."""
    write_recording(folder / "played.parquet", poses)
    return [f"--recording={folder / 'played.parquet'}"]


@pytest.mark.slow
def test_a_calibration_from_a_tracker_is_what_the_study_makes_of_it(study: Path, tmp_path: Path) -> None:
    """Its archive replays to the same states, its summary's errors and verdicts are those of the study."""
    log = study.parent / "live.jsonl"
    poses = one_after_another((*CALIBRATION, ("rest", 20.0)))
    with (
        emulator(*played(tmp_path, poses)) as running,
        coached(study, running.name, "--subject=03", "--hand=left", "--no-page", f"--log={log}") as process,
    ):
        until(process, "joints good enough")
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=120)
        assert process.returncode == 0
    assert "entered in" in out
    recorded = study.parent / "captures/03_left_rom.arrows"
    (row,) = read_sheet(study.parent / "recordings.tsv", RECORDINGS)
    assert (row["subject"], row["hand"], row["role"], row["file"]) == (
        "03",
        "left",
        "calibration",
        "captures/03_left_rom.arrows",
    )
    events = survey_archive(open_archive(recorded)).tally.events
    summary = next(event for event in events if event["event"] == "coach-summary")
    replay = study.parent / "replay.jsonl"
    assert coach([f"--replay={recorded}", "--speed=0", "--no-page", f"--log={replay}"]) == 0
    live = log.read_bytes()
    assert live
    assert replay.read_bytes().startswith(live)
    run = [sys.executable, "-m", "shukotsu", "run", "--cores=2"]
    subprocess.run(run, cwd=study.parent, check=True, capture_output=True)
    rows = rows_of(read_table(study.parent / "results/piano/joint_centres.parquet", JOINT_CENTRES))
    fitted = {row["joint"]: row for row in rows if row["model"] == "whole-hand"}
    assert len(summary["joints"]) == 15
    for joint, said in summary["joints"].items():
        assert said["sd_mm"] == pytest.approx(fitted[joint]["sd_mm"], abs=1e-3)
        assert said["verdict"] == fitted[joint]["verdict"]


@pytest.mark.slow
def test_receivers_that_are_put_right_begin_a_recording_of_their_own(study: Path, tmp_path: Path) -> None:
    poses = one_after_another((("free", 9.0), ("spread", 5.0), ("thumb-circle", 6.0)))
    wrong = exchanged(poses.take(slice(0, 1500)), ("index_middle", "middle_middle"))
    both = concatenated([wrong, poses.take(slice(1500, None))])
    with (
        emulator(*played(tmp_path, both)) as running,
        coached(study, running.name, "--subject=03", "--hand=left", "--no-page") as process,
    ):
        until(process, "Put right")
        until(process, "Move every finger")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
    first = read_sheet(study.parent / "recordings.tsv", RECORDINGS)[0]
    assert (first["trial"], first["exclude"]) == ("", "receivers were put right in it")
    assert (study.parent / "captures/03_left_rom_2.arrows").exists()


@pytest.mark.slow
def test_where_the_tracker_goes_away_what_came_is_kept_and_solved(study: Path, tmp_path: Path) -> None:
    with (
        emulator(*played(tmp_path, one_after_another(CALIBRATION))) as running,
        coached(study, running.name, "--subject=03", "--hand=left", "--no-page") as process,
    ):
        until(process, "Move every finger")
        time.sleep(12)
        running.process.terminate()
        out, error = process.communicate(timeout=180)
    assert process.returncode == 3
    assert "the port is gone" in error
    assert "joints good enough" in out
