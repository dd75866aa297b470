"""Each thing that goes wrong with a recording: what is kept of it, and what the user is told."""

import os
import pty
import re
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stages.capture.archive import RECEIVED, open_archive
from stages.capture.decode.stream import Tally, blocks_of
from stages.capture.record import command, session
from stages.capture.record.port import open_port
from stages.capture.record.session import Plan, record
from stages.capture.record.stopping import Stop
from stages.capture.record.terminal import Terminal
from stages.capture.record.wishes import Wishes
from stages.capture.trackers.records import concatenated


def kept(path: Path) -> tuple[np.ndarray, Tally]:
    """Frames of receiver 1 in an archive, and what else is in it."""
    tally = Tally()
    records = concatenated([block.records for block in blocks_of(open_archive(path), tally)])
    return records.frame[records.station == 1], tally


def last_host_ns(path: Path) -> int:
    return max(int(piece.host_ns[-1]) for piece in open_archive(path).pieces() if len(piece.host_ns))


def sentence(stderr: str) -> str:
    """The one line that begins with error."""
    (line,) = [line for line in stderr.splitlines() if line.startswith("error: ")]
    assert "Traceback" not in stderr
    return line


@pytest.mark.slow
@pytest.mark.parametrize(("line", "seconds"), [([], 10), (["--line-rate", "115200"], 25)])
def test_nothing_answers(line: list[str], seconds: float, emulated, ended, tmp_path: Path) -> None:
    port, out = emulated("--silent"), tmp_path / "rom.arrows"
    start = time.monotonic()
    done = ended("record", "--port", port, "--out", str(out), *line)
    assert done.returncode == 2
    assert time.monotonic() - start < seconds
    assert f"error: {port}: nothing answers" in sentence(done.stderr)
    assert "(just switched on? it takes 10 s)" in done.stderr
    assert ("at 115200, 57600, 38400, 19200, 9600 baud" in done.stderr) == bool(line)
    assert not out.exists(), "the name is free for the next attempt"


@pytest.mark.slow
def test_another_line_rate_is_found_and_told(emulated, ended, tmp_path: Path) -> None:
    port, out = emulated("--baud", "57600", "--stations", "1"), tmp_path / "rom.arrows"
    options = ["--line-rate", "115200", "--duration", "1", "--items", "9,2", "--rate", "120"]
    done = ended("record", "--port", port, "--out", str(out), *options)
    assert done.returncode == 0, done.stderr
    assert "note: it answered at 57600 baud and not at 115200; 57600 is used" in done.stderr
    assert len(kept(out)[0]) > 110


@pytest.mark.slow
def test_a_line_that_is_too_slow(emulated, ended, tmp_path: Path) -> None:
    """Refused with the arithmetic; with --allow-slower what comes through is recorded."""
    port, out = emulated("--stations", "1-4", "--line-rate", "11520"), tmp_path / "rom.arrows"
    words = ["record", "--port", port, "--out", str(out), "--line-rate", "115200", "--duration", "4"]
    refused = ended(*words)
    assert refused.returncode == 2
    assert "4 receivers x 56 bytes x 240 Hz = 53760 bytes/s, and 115200 baud carries 11520" in sentence(
        refused.stderr
    )
    assert not out.exists()
    done = ended(*words, "--allow-slower")
    assert done.returncode == 0, done.stderr
    assert "note: the line is too slow" in done.stderr
    assert re.search(r"note: the line brought 1[12]\.\d kB/s of the 53.8 kB/s that 4 receivers", done.stdout)
    frames, tally = kept(out)
    assert tally.summary is not None
    assert tally.summary["lost_frames"] > 0
    assert 30 < len(frames) / 4 < 80, "about 51 of 240 a second come through"


@pytest.mark.slow
def test_something_else_answers(emulated, ended, tmp_path: Path) -> None:
    port = emulated("--device", "patriot")
    done = ended("record", "--port", port, "--out", str(tmp_path / "rom.arrows"))
    assert done.returncode == 2
    assert sentence(done.stderr) == f"error: {port}: the tracker is a PATRIOT; give --tracker patriot"
    port = emulated("--device", "fastrak", "--stations", "1")
    done = ended("record", "--port", port, "--out", str(tmp_path / "rom.arrows"))
    assert done.returncode == 2
    assert "what answers is no LIBERTY" in sentence(done.stderr)


@pytest.mark.slow
def test_the_tracker_vanishes_in_the_middle_of_a_record(emulated, ended, tmp_path: Path) -> None:
    """All that came is kept, the archive is whole, the exit code is 3."""
    port, out = emulated("--stations", "1-16", "--gone-at", "2"), tmp_path / "rom.arrows"
    done = ended("record", "--port", port, "--out", str(out), "--duration", "60")
    assert done.returncode == 3
    told = sentence(done.stderr)
    assert told.startswith(f"error: {port}: the port is gone (")
    after_s, kept_s = re.findall(r"(\d\.\d) s", told)
    assert told.endswith(f" after {after_s} s; {out} keeps the first {kept_s} s")
    assert float(after_s) == float(kept_s) == pytest.approx(2.05, abs=0.5)
    frames, tally = kept(out)
    assert len(frames) >= 450
    assert tally.summary is not None
    assert tally.summary["reason"].startswith("the port is gone")
    assert "failed" in [event["event"] for event in tally.events]


@pytest.mark.slow
def test_two_programs_at_one_port(emulated, started, ended, until_lines, tmp_path: Path) -> None:
    """The second is refused and costs the first nothing."""
    port = emulated("--stations", "1-4")
    first = started("record", "--port", port, "--out", str(tmp_path / "a.arrows"), "--duration", "4")
    until_lines(first, 1)
    second = ended("record", "--port", port, "--out", str(tmp_path / "b.arrows"))
    assert second.returncode == 2
    assert "another program has it open" in sentence(second.stderr)
    assert not (tmp_path / "b.arrows").exists()
    first.communicate(timeout=30)
    assert first.returncode == 0
    frames, tally = kept(tmp_path / "a.arrows")
    assert tally.summary is not None
    assert tally.summary["lost_frames"] == 0
    assert len(frames) > 930


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_it_as_planned(
    number: signal.Signals, emulated, started, until_lines, tmp_path: Path
) -> None:
    port, out = emulated("--stations", "1-4"), tmp_path / "rom.arrows"
    recorder = started("record", "--port", port, "--out", str(out))
    until_lines(recorder, 2)
    recorder.send_signal(number)
    said, _ = recorder.communicate(timeout=10)
    assert recorder.returncode == 0
    assert f"({number.name})" in said
    frames, tally = kept(out)
    assert len(frames) >= 475
    assert tally.summary is not None
    assert tally.summary["reason"] == number.name
    assert tally.unreadable_bytes == 0


@pytest.mark.slow
def test_a_stop_before_the_first_frame_leaves_nothing(emulated, started, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1-4"), tmp_path / "rom.arrows"
    recorder = started("record", "--port", port, "--out", str(out), "--countdown", "30")
    assert recorder.stderr is not None
    while "starting in 29" not in recorder.stderr.readline():
        assert recorder.poll() is None
    recorder.send_signal(signal.SIGINT)
    _, told = recorder.communicate(timeout=10)
    assert recorder.returncode == 0
    assert "stopped before the first frame (SIGINT); no file is left" in told
    assert not out.exists()


@pytest.mark.slow
def test_killed_it_keeps_all_but_the_last_second(emulated, started, until_lines, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1-4"), tmp_path / "rom.arrows"
    recorder = started("record", "--port", port, "--out", str(out))
    until_lines(recorder, 3)
    killed_ns = time.monotonic_ns()
    recorder.kill()
    recorder.wait(timeout=10)
    assert killed_ns - last_host_ns(out) < 1e9
    frames, tally = kept(out)
    assert tally.summary is None
    assert np.diff(frames).tolist() == [1] * (len(frames) - 1)
    assert len(frames) >= 2 * 240


@pytest.mark.slow
def test_a_disk_that_is_full(emulated, started, tmp_path: Path) -> None:
    """A child that may write so much and no more; what was written before is whole."""
    port, out = emulated("--stations", "1-16"), tmp_path / "rom.arrows"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))

    recorder = started("record", "--port", port, "--out", str(out), "--duration", "60", preexec_fn=limit)
    _, told = recorder.communicate(timeout=30)
    assert recorder.returncode == 3
    assert f"error: {port}: the disk takes no more (File too large) after" in sentence(told)
    assert f"{out} keeps the first " in told
    frames, tally = kept(out)
    assert out.stat().st_size <= 500_000
    assert tally.unreadable_bytes == 0
    assert len(frames) > 400
    claimed_s = float(told.split("keeps the first ")[1].split(" s")[0])
    assert len(frames) == pytest.approx(240 * claimed_s, abs=20)


def a_clock_that_jumps(after_s: float, by_s: float) -> Callable[[], int]:
    start = time.monotonic()
    true_ns = time.time_ns() - time.monotonic_ns()

    def offset_ns() -> int:
        return true_ns + (int(by_s * 1e9) if time.monotonic() - start > after_s else 0)

    return offset_ns


@pytest.mark.slow
def test_the_hosts_clock_is_set_meanwhile(emulated, tmp_path: Path) -> None:
    """It is told and kept; the times of the frames do not know of it."""
    out = tmp_path / "rom.arrows"
    port = open_port(emulated("--stations", "1"), 115200)
    with Path(os.devnull).open("w") as out_file, Path(os.devnull).open() as keys:
        terminal = Terminal(out_file, keys)
        plan = Plan(out, Wishes("liberty"), duration_s=2.0)
        ending = record(plan, port, terminal, Stop(), {}, a_clock_that_jumps(2.5, -3600.0))
    port.close()
    assert not ending.failed
    assert ending.notices == ("the host's clock was set by -3600.0 s; times of frames are not concerned",)
    frames, tally = kept(out)
    (jump,) = [event for event in tally.events if event["event"] == "clock-jumped"]
    assert jump["seconds"] == pytest.approx(-3600.0)
    assert tally.utc_offset_range_ns == pytest.approx(3600e9)
    host_ns = np.concatenate([piece.host_ns[piece.kind == RECEIVED] for piece in open_archive(out).pieces()])
    assert (np.diff(host_ns) >= 0).all()
    assert len(frames) >= 475


@pytest.mark.slow
def test_a_receiver_is_unplugged_and_plugged_in(emulated, started, tmp_path: Path) -> None:
    port, out = emulated("--stations", "1-3", "--unplug", "2@1.5", "--plug", "2@2.5"), tmp_path / "rom.arrows"
    recorder = started("record", "--port", port, "--out", str(out), "--duration", "6")
    said, told = recorder.communicate(timeout=30)
    assert recorder.returncode == 0
    assert "absent 2" in told
    assert told.splitlines()[-1].split("absent")[0].count("3 of 3 receivers") == 1, "it is back in the view"
    _, tally = kept(out)
    assert tally.summary is not None
    ((from_s, to_s),) = tally.summary["receivers"]["2"]["absent_s"]
    assert from_s == pytest.approx(1.5, abs=0.4)
    assert to_s == pytest.approx(3.5, abs=0.4)
    assert f"{from_s:.1f} s to {to_s:.1f} s" in said
    assert [e["event"] for e in tally.events if "receiver" in e] == ["receiver-absent", "receiver-back"]
    assert tally.summary["receivers"]["1"]["lost_frames"] == 0


@pytest.mark.slow
def test_damaged_bytes_are_counted_and_cost_little(emulated, ended, tmp_path: Path) -> None:
    port, out = (
        emulated("--stations", "1-4", "--drop-bytes", "5@1", "--garbage", "7@1.5"),
        tmp_path / "rom.arrows",
    )
    done = ended("record", "--port", port, "--out", str(out), "--duration", "3")
    assert done.returncode == 0, done.stderr
    _, tally = kept(out)
    assert tally.summary is not None
    assert tally.summary["skipped_bytes"] > 0
    assert 0 < tally.summary["lost_frames"] <= 12


@pytest.mark.parametrize("word", ["record", "check"])
def test_a_network_port_that_is_closed_at_once(word: str, ended, tmp_path: Path) -> None:
    def serve() -> None:
        server.accept()[0].close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        out = ["--out", str(tmp_path / "rom.arrows")] if word == "record" else []
        done = ended(word, "--port", f"socket://127.0.0.1:{server.getsockname()[1]}", *out)
        thread.join()
    assert done.returncode == 2
    assert sentence(done.stderr).endswith("; perhaps another program has it")


def test_an_archive_is_never_written_over(ended, tmp_path: Path) -> None:
    out = tmp_path / "rom.arrows"
    out.write_bytes(b"precious")
    master, slave = os.openpty()
    done = ended("record", "--port", os.ttyname(slave), "--out", str(out))
    assert done.returncode == 2
    assert "exists already; a recording is never written over" in sentence(done.stderr)
    assert out.read_bytes() == b"precious"
    os.close(master)
    os.close(slave)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["add", "totals"])
def test_a_fault_of_the_program_itself(fault: str, emulated, tmp_path: Path, monkeypatch, capsys) -> None:
    """One in the view costs nothing; any other ends the recording, and what came until then is kept."""

    def fail(*_: object) -> None:
        raise ZeroDivisionError("a fault")

    port, out = emulated("--stations", "1-2"), tmp_path / "rom.arrows"
    monkeypatch.setattr(session.Statistics, fault, fail)
    words = ["--port", port, "--out", str(out), "--duration", "1"]
    if fault == "add":
        assert command.main(words) == 0
        told = "note: the view has failed (ZeroDivisionError: a fault); every byte is still recorded"
        assert told in capsys.readouterr().err
    else:
        with pytest.raises(ZeroDivisionError):
            command.main(words)
    frames, tally = kept(out)
    assert len(frames) >= 235
    assert tally.summary is not None
    expected = "--duration 1" if fault == "add" else "internal error (ZeroDivisionError('a fault'))"
    assert tally.summary["reason"] == expected


@pytest.mark.slow
def test_the_terminal_is_closed(emulated, tmp_path: Path) -> None:
    """The window is closed in mid-recording: nobody can be told, and all is kept."""
    out = tmp_path / "rom.arrows"
    port = emulated("--stations", "1-2")
    child, master = pty.fork()
    if child == 0:
        os.chdir(Path(__file__).resolve().parents[4])
        words = ["record", "--port", port, "--out", str(out)]
        os.execv(sys.executable, [sys.executable, "-m", "stages.capture", *words])
    shown, end = b"", time.monotonic() + 30
    while b"elapsed 0:01" not in shown and time.monotonic() < end:
        shown += os.read(master, 4096)
    os.close(master)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    frames, tally = kept(out)
    assert len(frames) >= 235
    assert tally.summary is not None
    assert tally.summary["reason"] == "SIGHUP"
