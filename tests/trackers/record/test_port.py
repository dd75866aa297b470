"""The port: real pseudo-terminals and sockets, what they give and how they end; the list of ports."""

import os
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from tracker_processes import PATIENCE_S

from shukotsu.errors import InputError
from shukotsu.trackers.record.port import Port, PortGoneError, open_port, port_lines, usb_devices


@pytest.fixture
def pty_pair() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for descriptor in (master, slave):
        try:
            os.close(descriptor)
        except OSError:
            continue


def test_two_programs_cannot_share_a_port(pty_pair: tuple[int, str]) -> None:
    first = open_port(pty_pair[1], 115200)
    with pytest.raises(InputError, match="another program has it open, and two cannot share a tracker"):
        open_port(pty_pair[1], 115200)
    first.close()
    open_port(pty_pair[1], 115200).close()


@pytest.mark.parametrize("name", ["socket://", "socket://a:b", "rfc2217://host", "loop://", "tcp://host:1"])
def test_what_is_no_port_of_a_network_is_not_tried(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: is no port of a network; expected socket://HOST:PORT"):
        open_port(name, 115200)


def gone(port: Port) -> str:
    """How the port's end is told; read until then."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            port.read()
        except PortGoneError as error:
            return str(error)
    return "not at all"


def test_a_device_that_is_pulled_out(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    os.close(master)
    assert gone(port) != "not at all"
    port.close()


def test_ports_are_listed_and_trackers_named() -> None:
    ports = [
        ("/dev/ttyS0", None, None, "ttyS0"),
        ("/dev/ttyUSB0", 0x0F44, 0xFF20, "Polhemus"),
        ("/dev/ttyUSB1", 0x0403, 0x6001, "FT232R USB UART"),
    ]
    assert port_lines(ports, [(0x0F44, 0xFF20)]) == [
        "/dev/ttyS0  ttyS0",
        "/dev/ttyUSB0  LIBERTY (high-speed USB) (USB 0f44:ff20)",
        "/dev/ttyUSB1  FT232R USB UART (USB 0403:6001)",
    ]


def test_a_tracker_without_a_port_is_told_with_what_to_do() -> None:
    told = "\n".join(port_lines([], [(0x1D6B, 0x0002), (0x0F44, 0xEF12)]))
    assert told.startswith("USB 0f44:ef12  PATRIOT: ready")
    assert "modprobe usbserial vendor=0x0f44 product=0xef12" in told
    assert "fxload" in "\n".join(port_lines([], [(0x0F44, 0xFF21)]))
    assert port_lines([], [(0x0F44, 0xCF01)]) == ["USB 0f44:cf01  G4: not read by this program"]


def test_usb_is_read_from_the_system(tmp_path: Path) -> None:
    for name, vendor, product in (("1-1", "0f44", "ff20"), ("usb1", "1d6b", "0002")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "idVendor").write_text(f"{vendor}\n")
        (tmp_path / name / "idProduct").write_text(f"{product}\n")
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "idVendor").write_text("0f44\n")
    assert usb_devices(tmp_path) == [(0x0F44, 0xFF20), (0x1D6B, 0x0002)]
    assert usb_devices(tmp_path / "none") == []
