"""The commands `emulate` and `record`: ports, options, how they refuse them, exit codes."""

from __future__ import annotations

import socket
import struct
import time
from pathlib import Path

import pytest
from tracker_processes import PATIENCE_S, emulator

from shukotsu.__main__ import main
from shukotsu.commands import record_tracker


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
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("error: ")
    assert printed.err.count("\n") == 1
    assert sentence in printed.err


def test_tcp_serves_one_client_at_a_time() -> None:
    with emulator("--stations", "1,3", port=("--tcp", "0")) as name:
        host, port = name.removeprefix("socket://").split(":")
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


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--duration", "0"], "--duration: is 0; expected seconds above 0"),
        (["--out", "rom.parquet"], "--out: is rom.parquet; expected a name that ends with .arrows"),
        (["--tracker", "fastrak"], "--tracker: fastrak left in 0.2: record with the tracker's own program"),
        (["--tracker", "libety"], "--tracker: is 'libety'; expected one of liberty, patriot, viper"),
        (["--tracker", "viper", "--stations", "1"], "--stations: a VIPER sends every sensor"),
        (["--tracker", "viper", "--items", "short"], "--items: a VIPER has no output lists"),
        (["--tracker", "patriot", "--rate", "120"], "--rate: a patriot has a rate of its own"),
        (["--port", "igtl://host:18944"], "--port: igtl left in 0.2: record with PLUS or 3D Slicer"),
        (["--lsl-outlet"], "record --lsl-outlet left in 0.2: import the archive"),
        (["--stations", "0"], "--stations: is '0'"),
        (["--hemisphere", "up"], "--hemisphere: is 'up'"),
        ([], "/dev/no-such-port: no such port"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_done(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rom.arrows"
    assert record_tracker.main(["--port", "/dev/no-such-port", "--out", str(out), *options]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"error: {sentence}")
    assert message.count("\n") == 1
    assert not out.exists()


def test_ports_are_listed_without_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert record_tracker.main(["--devices"]) == 0
    assert capsys.readouterr().out
    assert record_tracker.main(["--ask"]) == 2
    assert "--port: is missing; `shukotsu record --devices` lists" in capsys.readouterr().err
