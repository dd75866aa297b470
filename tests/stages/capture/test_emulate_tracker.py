"""The command `shukotsu emulate`: its ports, its options and how it refuses them."""

import socket
import struct
import time

import pytest
from tracker_processes import PATIENCE_S, emulator

from shukotsu.__main__ import main


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pty", "--stations", "0-3"], "--stations: is '0-3'; expected numbers from 1 to 16"),
        (["--tcp", "0.0.0.0:4001"], "--tcp: is '0.0.0.0:4001'; expected a port of this machine"),
        (["--pty", "--recording", "none.parquet"], "none.parquet: no such file"),
        (["--pty", "/nowhere/at/all"], "/nowhere/at/all: cannot be made a link"),
        (["--archive", "out.arrows"], "--archive: needs a recording"),
        (["--archive", "out.bin", "--recording", "r.csv"], "out.bin: is to be a raw capture"),
        (["--archive", "o.arrows", "--recording", "r.csv", "--loop"], "--loop: needs a port"),
        (["--igtl", "0"], "emulate --igtl left in 0.2: record with PLUS"),
        (["--pty", "--drop-bytes=1e-5"], "emulate --drop-bytes left in 0.2: leave it out"),
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
