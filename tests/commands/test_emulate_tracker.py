"""The commands `emulate` and `record`: the emulator's TCP port, and the list of devices."""

import socket
import struct
import time

import pytest
from tracker_processes import PATIENCE_S, emulator

from shukotsu.__main__ import main


def test_tcp_serves_one_client_at_a_time() -> None:
    with emulator("--stations", "1,3", port=("--tcp", "0")) as name:
        host, port = name.removeprefix("socket://").split(":")
        address = (host, int(port))
        with socket.create_connection(address, PATIENCE_S) as first:
            first.sendall(b"F1\rU1\rU\r")
            assert first.recv(100)[8:] == struct.pack("<i", 1)
            with socket.create_connection(address, PATIENCE_S) as second:
                assert second.recv(100) == b""
            first.sendall(b"C\r")
            assert first.recv(2).startswith(b"LY")
        time.sleep(0.1)
        with socket.create_connection(address, PATIENCE_S) as later:
            received = b""
            while b"LY\x03C" not in received:
                received += later.recv(4096)


def test_devices_are_listed_without_a_port_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "--devices"]) == 0
    assert capsys.readouterr().out
