"""A recording from end to end, through a real pseudo-terminal or socket, from every state of the tracker."""

import json
import os
import pty
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest

from stages.capture.archive import END, EVENT, RECEIVED, SENT, SETTINGS, open_archive
from stages.capture.decode.stream import Tally, blocks_of
from stages.capture.record import command
from stages.capture.trackers.records import concatenated

NEVER_SENT = (b"\x19", b"\x17", b"\x0b", b"\x18", b"\x0f")
"""What stays after the recorder has gone: re-initialise, start-up settings, save, name, line settings."""


def rows(path: Path) -> list[tuple[int, bytes]]:
    """Kind and bytes of every row of an archive."""
    return [
        (int(kind), data)
        for piece in open_archive(path).pieces()
        for kind, data in zip(piece.kind, piece.data, strict=True)
    ]


def events(path: Path) -> list[dict[str, object]]:
    return [json.loads(data) for kind, data in rows(path) if kind == EVENT]


def decoded(path: Path):
    """Records of an archive in turn, and what else is in it."""
    tally = Tally()
    blocks = list(blocks_of(open_archive(path), tally))
    return concatenated([block.records for block in blocks]), tally, blocks[0].settings


def assert_whole(path: Path, stations: int, at_least: int) -> None:
    """Every receiver has every frame from the first to the last."""
    records, tally, _ = decoded(path)
    frames = np.unique(records.frame)
    assert len(frames) >= at_least
    assert np.diff(frames).tolist() == [1] * (len(frames) - 1)
    for station in range(1, stations + 1):
        mine = records.frame[records.station == station]
        assert len(np.unique(mine)) >= len(frames) - 1, "the last cycle may be cut by the stop"
    assert tally.summary is not None
    assert tally.summary["skipped_bytes"] == 0
    assert tally.summary["records"] == len(records), "what came after the stop is counted too"


def test_four_receivers_over_a_pseudo_terminal(emulated, tmp_path: Path, capsys) -> None:
    """Nothing is lost; the archive says all that is needed to read it alone."""
    port, out = emulated("--already-streaming", "--stations", "1-4"), tmp_path / "rom.arrows"
    words = ["--port", port, "--out", str(out), "--duration", "1.2", "--note", "first", "--note", "second"]
    assert command.main(words) == 0
    said = capsys.readouterr()
    assert f"{out}: ended after 1.2 s (--duration 1.2)" in said.out
    assert "4 of 4 receivers" in said.err
    assert_whole(out, 4, 270)
    _, _, settings = decoded(out)
    assert settings.unit == "cm"
    assert settings.items[16] == (8, 9, 11, 10, 12, 3, 7)
    assert settings.options["before"]["output_list"]["1"] != settings.options["after"]["output_list"]["1"]
    assert "LIBERTY" in settings.options["whoami"]
    assert open_archive(out).about["notes"] == ["first", "second"]
    assert [e["text"] for e in events(out) if e["event"] == "note"] == ["first", "second"]
    kinds = [kind for kind, _ in rows(out)]
    assert kinds.index(RECEIVED) < kinds.index(SETTINGS), "the talk before the first frame is kept too"
    assert kinds[-1] == END
    sent = b"".join(data for kind, data in rows(out) if kind == SENT)
    assert not any(byte in sent for byte in NEVER_SENT)
    assert sent.endswith(b"Q0\rC\rP")


STATES = [
    [],
    ["--already-streaming"],
    ["--already-streaming", "--echo"],
    ["--power-up-text", "--reinit-delay", "0.5"],
    ["--ports", "4", "--stations", "1-3"],
]


@pytest.mark.slow
@pytest.mark.parametrize("how", [[], ["--ascii", "--items", "short"]], ids=["binary", "ascii"])
@pytest.mark.parametrize("state", STATES, ids=" ".join)
def test_every_state_of_the_tracker(state, how, emulated, ended, tmp_path: Path) -> None:
    options = state if "--stations" in state else [*state, "--stations", "1-3"]
    out = tmp_path / "rom.arrows"
    done = ended("record", "--port", emulated(*options), "--out", str(out), "--duration", "1", *how)
    assert done.returncode == 0, done.stderr
    assert_whole(out, 3, 230)


@pytest.mark.slow
@pytest.mark.parametrize(
    "left", [b"O*,8,9", b"F1\rC\r", b"F1\rO*,2,4,2\rU0\rC\rO1,", b"\r\r\r", b"L*,1\rR3\r"]
)
def test_whatever_another_program_has_left(left: bytes, emulated, typed, ended, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1,3"), tmp_path / "rom.arrows"
    typed(port, left)
    done = ended("record", "--port", port, "--out", str(out), "--duration", "1")
    assert done.returncode == 0, done.stderr
    records, _, settings = decoded(out)
    assert settings.stations == (1, 3)
    assert settings.rate_hz == 240
    assert len(records) >= 2 * 230


@pytest.mark.slow
def test_what_is_in_force_is_told_and_left(emulated, typed, ended, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1,2"), tmp_path / "rom.arrows"
    typed(port, b"B1,10,0,0\rN2,1,2,3\rA1,0,0,0,0,1,0,-1,0,0\rG0,0,30\r@B0\r")
    done = ended("record", "--port", port, "--out", str(out), "--duration", "0.5")
    assert done.returncode == 0, done.stderr
    for told in (
        "note: receiver 1: a boresight turns its orientations",
        "note: receiver 1: an alignment moves its frame",
        "note: receiver 2: a tip offset moves its positions",
        "note: the transmitter's mounting frame is turned by 0, 0, 30 deg",
        "note: USB buffering is off",
    ):
        assert told in done.stderr
    _, _, settings = decoded(out)
    assert len(settings.options["warnings"]) == 5
    assert settings.options["after"]["source_frame"] == [0, 0, 30]


@pytest.mark.slow
@pytest.mark.parametrize(("stations", "tcp"), [(4, False), (16, True)], ids=["pseudo-terminal", "socket"])
def test_nothing_is_lost_in_eight_seconds(stations, tcp, emulated, ended, tmp_path: Path) -> None:
    """240 Hz, the full list, the log on. A pseudo-terminal's buffer holds 0.4 s of four receivers; 16 through
    one are for the benchmark, on a machine that does nothing else.
    """
    port, out = emulated("--stations", f"1-{stations}", tcp=tcp), tmp_path / "rom.arrows"
    done = ended("record", "--port", port, "--out", str(out), "--duration", "8")
    assert done.returncode == 0, done.stderr
    assert_whole(out, stations, 1900)


@pytest.mark.slow
@pytest.mark.parametrize(("tracker", "rate_hz"), [("patriot", 60.0), ("fastrak", 60.0)])
def test_other_trackers(tracker: str, rate_hz: float, emulated, ended, tmp_path: Path) -> None:
    port = emulated("--device", tracker, "--stations", "1-2", "--already-streaming")
    for mode in ([], ["--ascii"]):
        out = tmp_path / f"rom{len(mode)}.arrows"
        done = ended(
            "record", "--port", port, "--tracker", tracker, "--out", str(out), "--duration", "2", *mode
        )
        assert done.returncode == 0, done.stderr
        records, _, settings = decoded(out)
        assert settings.rate_hz == rate_hz
        assert len(records) == pytest.approx(2 * 2 * rate_hz, rel=0.25)  # it ends by the clock
        assert np.isfinite(records.quaternion).all()


@pytest.mark.slow
def test_settings_that_were_asked_for(emulated, ended, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1-4"), tmp_path / "rom.arrows"
    options = [
        "--rate",
        "120",
        "--stations",
        "2,4",
        "--hemisphere",
        "0,0,-1",
        "--no-filters",
        "--items",
        "9,2,7",
    ]
    done = ended("record", "--port", port, "--out", str(out), "--duration", "1", *options)
    assert done.returncode == 0, done.stderr
    records, _, settings = decoded(out)
    assert (settings.stations, settings.rate_hz, settings.hemisphere[2]) == ((2, 4), 120.0, (0.0, 0.0, -1.0))
    assert set(records.station.tolist()) == {2, 4}
    assert len(records) == pytest.approx(240, rel=0.25)  # it ends by the clock
    after = settings.options["after"]
    assert sorted(after["position_filter"]) == sorted(after["attitude_filter"]) == [0, 0, 0, 1]
    absent = ended("record", "--port", port, "--out", str(tmp_path / "no.arrows"), "--stations", "2,9")
    assert absent.returncode == 2
    assert "receiver 9 of --stations is not connected; connected are" in absent.stderr


@pytest.mark.slow
def test_the_key_q_ends_it_and_the_terminal_is_as_before(emulated, tmp_path: Path) -> None:
    """The view is rewritten in place; after q the terminal echoes and waits for Return as it did."""
    out = tmp_path / "rom.arrows"
    tracker = emulated("--stations", "1-2")
    child, master = pty.fork()
    if child == 0:
        words = ["record", "--port", tracker, "--out", str(out), "--countdown", "1"]
        os.chdir(Path(__file__).resolve().parents[4])
        os.execv(sys.executable, [sys.executable, "-m", "stages.capture", *words])
    before = termios.tcgetattr(master)
    shown = b""
    end = time.monotonic() + 30
    while b"elapsed 0:01" not in shown and time.monotonic() < end:
        shown += os.read(master, 4096)
    during = termios.tcgetattr(master)
    os.write(master, b"q")
    while time.monotonic() < end:
        try:
            shown += os.read(master, 4096)
        except OSError:
            break
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    assert not during[3] & termios.ICANON
    assert termios.tcgetattr(master)[3] == before[3]
    assert b"starting in 1 ..." in shown
    assert b"(key q)" in shown
    assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l")
    assert_whole(out, 2, 230)
    os.close(master)
