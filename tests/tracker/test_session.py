"""Recording sessions end to end through pseudo-terminals and sockets, and their failures.

No assertion depends on the host's speed: tests wait for the events that they assert.
"""

import io
import json
import os
import re
import resource
import signal
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from captures import decoded
from tracker_processes import PATIENCE_S, SHUKOTSU, at_a_port, emulator, shukotsu

from shukotsu.commands import record_tracker
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker import session
from shukotsu.tracker.archive import END, EVENT, RECEIVED, SENT, SETTINGS, open_archive
from shukotsu.tracker.conversation import RecordingRequest, StopRequest
from shukotsu.tracker.emulated_device import EmulatedLiberty, built_in_motion
from shukotsu.tracker.port import open_port
from shukotsu.tracker.records import Records
from shukotsu.tracker.session import RecordingPlan, record

NEVER_SENT = (b"\x19", b"\x17", b"\x0b", b"\x18", b"\x0f")
"""Commands with lasting effects: re-initialise, start-up settings, save, name, line settings."""


def rows(path: Path) -> list[tuple[int, bytes]]:
    return [
        (int(kind), data)
        for piece in open_archive(path).pieces()
        for kind, data in zip(piece.kind, piece.data, strict=True)
    ]


def events(path: Path) -> list[dict[str, object]]:
    return [json.loads(data) for kind, data in rows(path) if kind == EVENT]


def frames_of(records: Records, station: int = 1) -> np.ndarray:
    return records.frame[records.station == station]


def assert_gapless(frames: np.ndarray) -> None:
    assert len(frames) > 24
    assert np.diff(frames).tolist() == [1] * (len(frames) - 1)


def assert_complete(path: Path) -> None:
    """Check that each of four receivers has every frame from the first to the last."""
    records, tally, _ = decoded(path)
    frames = np.unique(records.frame)
    assert_gapless(frames)
    for station in range(1, 5):
        mine = frames_of(records, station)
        assert len(np.unique(mine)) >= len(frames) - 1, "the last cycle may be cut by the stop"
    assert tally.summary is not None
    assert tally.summary["skipped_bytes"] == 0
    assert tally.summary["records"] == len(records), "records after the stop are counted too"


@contextmanager
def recorder(port: str, out: Path, **how: Any) -> Iterator[subprocess.Popen[str]]:
    """Start the recorder and leave it running; it is killed at the end of the context."""
    pipes = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    command = [*SHUKOTSU, "record", "--port", port, "--out", str(out)]
    with subprocess.Popen(command, text=True, stdin=subprocess.DEVNULL, **pipes, **how) as process:
        try:
            yield process
        finally:
            process.kill()


def error_line(stderr: str) -> str:
    (line,) = [line for line in stderr.splitlines() if line.startswith("error: ")]
    assert "Traceback" not in stderr
    return line


@pytest.mark.slow
def test_four_receivers_are_recorded_completely(tmp_path: Path, capsys, monkeypatch) -> None:
    """The tracker was left streaming. No frame is lost, and the archive contains all that is needed to read
    it.
    """
    monkeypatch.setattr(session, "LOOK_S", 0.2)
    port, out = str(tmp_path / "tracker"), tmp_path / "rom.arrows"
    argv = ["--port", port, "--out", str(out), "--duration", "0.6", "--note", "first", "--note", "second"]
    with emulator("--stations", "1-4", port=("--pty", port)):
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)  # another program left it streaming
        os.write(descriptor, b"F1\rU1\rO*,2,4,9,1\rC\r")
        while not os.read(descriptor, 1):
            continue
        os.close(descriptor)
        assert record_tracker.main(argv) == 0
    printed = capsys.readouterr()
    assert re.search(rf"{out}: ended after \d+\.\d s \(--duration 0\.6\)", printed.out)
    assert "4 of 4 receivers" in printed.err
    assert_complete(out)
    _, _, settings = decoded(out)
    assert settings.unit == "cm"
    assert settings.items[16] == (8, 9, 11, 10, 12, 3, 7)
    assert settings.options["before"]["output_list"]["1"] != settings.options["after"]["output_list"]["1"]
    assert "LIBERTY" in settings.options["whoami"]
    assert open_archive(out).about["notes"] == ["first", "second"]
    assert [e["text"] for e in events(out) if e["event"] == "note"] == ["first", "second"]
    kinds = [kind for kind, _ in rows(out)]
    assert kinds.index(RECEIVED) < kinds.index(SETTINGS), "the setup before the first frame is kept too"
    assert kinds[-1] == END
    sent = b"".join(data for kind, data in rows(out) if kind == SENT)
    assert not any(byte in sent for byte in NEVER_SENT)
    assert sent.endswith(b"Q0\rC\rP")


# --- failures: the data kept, and the message for the user -----------------------------------------


class Silent(EmulatedLiberty):
    """A LIBERTY that does not answer."""

    def receive(self, _data: bytes) -> bytes:
        """Ignore a command."""
        return b""


class Vanishing(EmulatedLiberty):
    """A LIBERTY that disappears in the middle of a record, after 300 frames."""

    left, gone = 300, False

    def next_cycle(self) -> bytes:
        """Return the data of one cycle, or in the last cycle half a record."""
        data = super().next_cycle()
        self.left -= self.streaming
        self.gone = self.left < 0
        return data[:20] if self.gone else data


@pytest.mark.slow
def test_a_silent_port_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"
    with at_a_port(Silent(built_in_motion(), frozenset())) as port:
        done = shukotsu("record", "--port", port, "--out", str(out))
    assert done.returncode == 2
    assert f"error: {port}: nothing answers" in error_line(done.stderr)
    assert "(just switched on? it takes 10 s)" in done.stderr
    assert not out.exists(), "the file name is free for the next attempt"


@pytest.mark.slow
def test_a_tracker_that_disappears_leaves_a_readable_recording(tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"
    with at_a_port(Vanishing(built_in_motion(), frozenset({1, 2, 3, 4}))) as port:
        done = shukotsu("record", "--port", port, "--out", str(out))
    assert done.returncode == 3, done.stderr
    message = error_line(done.stderr)
    assert message.startswith(f"error: {port}: the port is gone (")
    after_s, kept_s = re.findall(r"(\d+\.\d) s", message)
    assert message.endswith(f" after {after_s} s; {out} keeps the first {kept_s} s")
    assert after_s == kept_s
    records, tally, _ = decoded(out)
    assert_gapless(frames_of(records))
    assert tally.summary is not None
    assert tally.summary["reason"].startswith("the port is gone")
    assert "failed" in [event["event"] for event in events(out)]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_recording_as_planned(number: signal.Signals, tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"
    with emulator("--stations", "1-4") as port, recorder(port, out) as process:
        assert process.stderr is not None
        assert any(" Hz " in line for line in iter(process.stderr.readline, "")), "it ended early"
        process.send_signal(number)
        printed, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
    assert f"({number.name})" in printed
    assert_complete(out)
    _, tally, _ = decoded(out)
    assert tally.summary is not None
    assert tally.summary["reason"] == number.name
    assert tally.unreadable_bytes == 0


@pytest.mark.slow
def test_a_full_disk_ends_the_recording_and_leaves_it_readable(tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    with emulator(port=("--tcp", "0")) as port, recorder(port, out, preexec_fn=limit) as process:
        _, stderr = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 3
    assert f"error: {port}: the disk takes no more (File too large) after" in error_line(stderr)
    assert f"{out} keeps the first " in stderr
    records, tally, _ = decoded(out)
    assert out.stat().st_size <= 200_000
    assert tally.unreadable_bytes == 0
    assert_gapless(frames_of(records))


@pytest.mark.slow
def test_setting_the_hosts_clock_is_noted_and_does_no_harm(tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"
    calls, stop = 0, StopRequest()

    def utc_offset_ns() -> int:  # an hour less after 700 calls; stops after 1000
        nonlocal calls
        calls += 1
        if calls > 1000:
            stop.ask("enough")
        return 10**18 - (3600 * 10**9 if calls > 700 else 0)

    plan = RecordingPlan(out, RecordingRequest("liberty"))
    with emulator("--stations", "1") as name, closing(open_port(name, 115200)) as port:
        ending = record(plan, port, LinePrinter(io.StringIO()), stop, {}, utc_offset_ns)
    assert not ending.failed
    assert ending.notices == ("the host's clock was set by -3600.0 s; times of frames are not affected",)
    records, tally, _ = decoded(out)
    (jump,) = [event for event in events(out) if event["event"] == "clock-jumped"]
    assert jump["seconds"] == pytest.approx(-3600.0)
    assert tally.utc_offset_range_ns == pytest.approx(3600e9)
    host_ns = np.concatenate([piece.host_ns[piece.kind == RECEIVED] for piece in open_archive(out).pieces()])
    assert (np.diff(host_ns) >= 0).all()
    assert_gapless(frames_of(records))
