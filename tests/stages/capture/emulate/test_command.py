"""The command `python -m stages.capture emulate`: its ports, its options and how it refuses them."""

import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from stages.capture.__main__ import main
from stages.capture.emulate.serve import garbled

REPOSITORY = Path(__file__).resolve().parents[4]


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\nfrom stages.capture.__main__ import main\n"
        "try:\n    main(['emulate', '--help'])\nexcept SystemExit:\n    pass\n"
        "print([name for name in ('numpy', 'pyarrow', 'yaml') if name in sys.modules])"
    )
    told = subprocess.run(
        [sys.executable, "-c", program], cwd=REPOSITORY, capture_output=True, text=True, check=True
    ).stdout
    assert told.splitlines()[-1] == "[]"
    assert "--unplug STATION@T" in told
    assert "example:" in told


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pty", "--stations", "0-3"], "--stations: is '0-3'; expected some of 1-16"),
        (["--pty", "--ports", "8", "--stations", "9"], "--stations: is '9'; expected some of 1-8"),
        (["--pty", "--ports", "5"], "--ports: is 5; expected one that a liberty has"),
        (["--pty", "--device", "patriot", "--rate", "240"], "expected one that a patriot has: 60"),
        (["--tcp", "0.0.0.0:4001"], "--tcp: is '0.0.0.0:4001'; expected a port of this machine"),
        (["--tcp", "4001", "--baud", "9600"], "--baud: only a pseudo-terminal has a speed"),
        (["--pty", "--line-rate", "0"], "--line-rate: is 0.0; expected more than 0"),
        (["--pty", "--start-frame", "-1"], "--start-frame"),
        (["--pty", "--unplug", "3"], "--unplug: is '3'; expected STATION@T"),
        (["--pty", "--ports", "4", "--plug", "5@1"], "--plug: is '5@1'; expected a station from 1 to 4"),
        (["--pty", "--truth", "log.txt"], "log.txt: the ending says the format"),
        (["--pty", "--recording", "none.parquet"], "none.parquet: no such file"),
        (["--pty", "/nowhere/at/all"], "/nowhere/at/all: cannot be made a link"),
        (["--archive", "out.arrows"], "--archive: needs a recording"),
        (["--archive", "out.bin", "--recording", "r.csv"], "out.bin: is to be a raw capture"),
        (["--archive", "o.arrows", "--recording", "r.csv", "--silent"], "--silent: needs a port"),
        (["--archive", "o.arrows", "--recording", "r.csv", "--device", "fastrak"], "of a liberty only"),
    ],
)  # fmt: skip
def test_bad_options_are_refused_in_a_sentence(
    options: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["emulate", *options]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert sentence in told.err


def test_a_port_that_is_taken_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["emulate", "--tcp", str(taken.getsockname()[1])]) == 2
    assert "cannot be listened on" in capsys.readouterr().err


def test_tcp_serves_one_client_at_a_time(emulated: Callable[..., Any]) -> None:
    """A second one is turned away; a later one finds the device as the first left it."""
    with emulated("--stations", "1,3", port=("--tcp", "0")) as running:
        host, port = running.name.removeprefix("socket://").split(":")
        address = (host, int(port))
        with socket.create_connection(address) as first:
            first.settimeout(2)
            first.sendall(b"F1\rU1\rU\r")
            assert first.recv(100)[8:] == struct.pack("<i", 1)
            with socket.create_connection(address) as second:
                second.settimeout(2)
                assert second.recv(100) == b""
            first.sendall(b"C\r")
            assert first.recv(2).startswith(b"LY")
        time.sleep(0.1)
        with socket.create_connection(address) as later:
            later.settimeout(2)
            assert b"LY\x03C" in b"".join(later.recv(4096) for _ in range(5))


def test_link_log_and_a_device_that_vanishes(emulated: Callable[..., Any], tmp_path: Path) -> None:
    """The link leads to the terminal; after half a record it hangs up, the link goes and the log is there."""
    link, log = tmp_path / "tracker", tmp_path / "truth.parquet"
    options = ("--stations", "1-2", "--gone-at", "0.2", "--truth", str(log))
    with emulated(*options, port=("--pty", str(link))) as running:
        assert str(link.readlink()) == running.name
        with running.open() as client:
            client.send(b"F1\rO*,9\rC\r")
            data = client.exactly(48 * 24 + 6)
            assert len(data) == 48 * 24 + 6
            with pytest.raises(EOFError):
                client.until_silent(3.0)
        running.process.wait(timeout=5)
    assert not link.is_symlink()
    kinds = pq.read_table(log)["kind"].to_pylist()
    assert kinds == ["sent"] * 48 + ["cut"]


def test_start_as_an_earlier_client_left_it(emulated: Callable[..., Any]) -> None:
    """Streaming in binary at once; with the power-up text it is deaf first."""
    with emulated("--already-streaming", "--stations", "2") as running, running.open() as client:
        assert b"LY\x02C\x00\x00\x1e\x00" in client.during(0.2)
        assert b"LY\x02P" in client.reply(b"P")
        assert client.reply(b"U\r")[8:] == struct.pack("<i", 1)
    options = ("--power-up-text", "--reinit-delay", "0.5", "--echo")
    with emulated(*options) as running, running.open() as client:
        assert client.reply(b"U\r") == b""
        assert client.during(0.6) == b"LIBERTY Ready!\r\n"
        assert client.reply(b"U\r") == b"U\r00U  0\r\n"


def test_silence(emulated: Callable[..., Any]) -> None:
    with emulated("--silent", "--already-streaming") as running, running.open() as client:
        assert client.reply(b"P\r\r", 0.2) == b""


def test_a_client_at_another_speed_gets_garbage(emulated: Callable[..., Any]) -> None:
    """In both directions: records cannot be read and commands are not understood."""
    options = ("--baud", "115200", "--stations", "1", "--already-streaming")
    with emulated(*options) as running, running.open() as client:
        attributes = termios.tcgetattr(client.descriptor)
        for speed, understood in ((termios.B57600, False), (termios.B115200, True)):
            attributes[4] = attributes[5] = speed
            termios.tcsetattr(client.descriptor, termios.TCSANOW, attributes)
            client.send(b"\r")
            stream = client.during(0.2)
            assert len(stream) > 200
            assert (stream.count(b"LY\x01C") > 20) == understood
            client.send(b"PF0\r\x16\r")
            assert (b"00v  LIBERTY" in client.during(0.2)) == understood


def test_garbled_bytes() -> None:
    """At the same speed nothing changes; a slow receiver gets fewer bytes and a fast one more."""
    data = bytes(range(256))
    assert garbled(data, 9600, 9600) == data
    assert len(garbled(data, 115200, 9600)) == 22
    assert len(garbled(b"\r", 9600, 115200)) == 12
    assert garbled(data, 115200, 57600) == garbled(data, 115200, 57600) != data[:128]
    assert garbled(b"", 9600, 115200) == b""


def test_ctrl_c_ends_it(emulated: Callable[..., Any]) -> None:
    with emulated() as running:
        running.process.send_signal(signal.SIGINT)
        assert running.process.wait(timeout=5) == 0


def test_recording_plays_from_the_reset_of_the_counters(emulated: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    lines = ["frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz"]
    lines += [f"{f},,hand,{100 + f},20,30,1,0,0,0" for f in range(30)]
    path.write_text("\n".join(lines) + "\n")
    with emulated("--recording", str(path)) as running, running.open() as client:
        time.sleep(0.3)
        client.send(b"F1\rU1\rX0,1,0,0\rO*,9,2\rQ0\rC\r")
        data = client.during(0.4)
    got = [struct.unpack_from("<I3f", data, at + 8) for at in range(0, len(data) - 23, 24)]
    assert [frame for frame, *_ in got] == list(range(30))
    assert [round(x * 10, 3) for _, x, _, _ in got] == list(range(100, 130))
    assert not select.select([], [], [], 0)[0]
