"""The command `shukotsu emulate`: its ports, its options and how it refuses them."""

import socket
import struct
import time
from pathlib import Path

import pytest
from tracker_processes import PATIENCE_S, emulator

from shukotsu.stages.capture.__main__ import main


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pty", "--stations", "0-3"], "--stations: is '0-3'; expected numbers from 1 to 16"),
        (["--pty", "--ports", "8", "--stations", "9"], "--stations: is '9'; expected numbers from 1 to 8"),
        (["--pty", "--ports", "5"], "--ports: is 5; expected one that a liberty has"),
        (["--pty", "--device", "patriot", "--rate", "240"], "expected one that a patriot has: 60"),
        (["--tcp", "0.0.0.0:4001"], "--tcp: is '0.0.0.0:4001'; expected a port of this machine"),
        (["--tcp", "4001", "--baud", "9600"], "--baud: only a pseudo-terminal has a speed"),
        (["--pty", "--line-rate", "0"], "--line-rate: is 0.0; expected more than 0"),
        (["--pty", "--fifo", "0"], "--fifo: is 0; expected more than 0"),
        (["--pty", "--reinit-delay", "-1"], "--reinit-delay: is -1; expected seconds below 3600"),
        (["--pty", "--unplug", "3"], "--unplug: is '3'; expected STATION@T"),
        (["--pty", "--ports", "4", "--plug", "5@1"], "--plug: is '5@1'; expected a station from 1 to 4"),
        (["--pty", "--recording", "none.parquet"], "none.parquet: no such file"),
        (["--igtl", "0", "--already-streaming"], "--already-streaming: is not for --igtl; leave it out"),
        (["--lsl", "x", "--device", "fastrak"], "--device: is not for --lsl; leave it out"),
        (["--pty", "--message", "tdata"], "--message: is not for a device other than --igtl"),
        (["--igtl", "0", "--rate", "1000"], "--rate: is 1000; expected one that a openigtlink has: 1 to 240"),
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


def test_tcp_serves_one_client_at_a_time() -> None:
    """A second one is turned away; a later one finds the device as the first left it."""
    with emulator("--stations", "1,3", port=("--tcp", "0")) as running:
        host, port = running.name.removeprefix("socket://").split(":")
        address = (host, int(port))
        with socket.create_connection(address) as first:
            first.settimeout(PATIENCE_S)
            first.sendall(b"F1\rU1\rU\r")
            assert first.recv(100)[8:] == struct.pack("<i", 1)
            with socket.create_connection(address) as second:
                second.settimeout(PATIENCE_S)
                assert second.recv(100) == b""
            first.sendall(b"C\r")
            assert first.recv(2).startswith(b"LY")
        time.sleep(0.1)
        with socket.create_connection(address) as later:
            later.settimeout(PATIENCE_S)
            received = b""
            while b"LY\x03C" not in received:
                received += later.recv(4096)


def test_a_recording_is_what_a_client_gets(tmp_path: Path) -> None:
    """From its first frame, one frame a cycle, after the reset of the counters."""
    path = tmp_path / "rec.csv"
    rows = "".join(f"{f},,hand,{100 + f},20,30,1,0,0,0\n" for f in range(30))
    path.write_text("frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n" + rows)
    with emulator("--recording", str(path), port=("--tcp", "0")) as running:
        host, port = running.name.removeprefix("socket://").split(":")
        with socket.create_connection((host, int(port))) as client:
            client.sendall(b"F1\rU1\rO*,9,2\rQ0\rC\r")
            data = client.makefile("rb").read(30 * 24)
    got = [struct.unpack_from("<I3f", data, at + 8) for at in range(0, len(data), 24)]
    assert [(frame, round(x * 10, 3)) for frame, x, _, _ in got] == [(f, 100 + f) for f in range(30)]
