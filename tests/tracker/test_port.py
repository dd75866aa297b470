"""Ports: pseudo-terminals, network addresses, and a stand-in for libusb1."""

import io
import os
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from captures import decoded
from tracker_processes import PATIENCE_S

from shukotsu.errors import InputError
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker.conversation import RecordingRequest, StopRequest
from shukotsu.tracker.emulated_device import EmulatedLiberty, built_in_motion
from shukotsu.tracker.emulator import Emulator
from shukotsu.tracker.port import Port, PortGoneError, open_port, port_lines
from shukotsu.tracker.session import RecordingPlan, record


@pytest.fixture
def pty_pair() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for descriptor in (master, slave):
        with suppress(OSError):
            os.close(descriptor)


def test_two_programs_cannot_share_a_port(pty_pair: tuple[int, str]) -> None:
    first = open_port(pty_pair[1], 115200)
    with pytest.raises(InputError, match="another program has it open, and two cannot share a tracker"):
        open_port(pty_pair[1], 115200)
    first.close()
    open_port(pty_pair[1], 115200).close()


@pytest.mark.parametrize("name", ["socket://", "socket://a:b", "rfc2217://host", "loop://", "tcp://host:1"])
def test_an_invalid_network_port_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: is not a network port; expected socket://HOST:PORT"):
        open_port(name, 115200)


def keep_reading(port: Port) -> None:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        port.read()


def test_a_port_of_an_unplugged_device_is_reported_as_gone(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    os.close(master)
    with pytest.raises(PortGoneError):
        keep_reading(port)
    port.close()


def test_ports_are_listed_with_the_names_of_trackers() -> None:
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


def test_a_tracker_without_a_port_is_listed_with_what_to_do() -> None:
    lines = "\n".join(port_lines([], [(0x1D6B, 0x0002), (0x0F44, 0xEF12)]))
    assert lines.startswith("USB 0f44:ef12  PATRIOT: ready")
    assert "modprobe usbserial vendor=0x0f44 product=0xef12" in lines
    assert "fxload" in "\n".join(port_lines([], [(0x0F44, 0xFF21)]))
    assert port_lines([], [(0x0F44, 0xCF01)]) == ["USB 0f44:cf01  G4: not read by this program"]


class UsbError(Exception):
    """A failed transfer; received : the data that had arrived."""

    received = b""


ERRORS = {
    name: type(name, (UsbError,), {})
    for name in ("USBErrorTimeout", "USBErrorBusy", "USBErrorAccess", "USBErrorNoDevice")
}


class Bus:
    """A USB bus with one device. claiming : the error that claiming it raises; reads : reads until it is
    unplugged.
    """

    def __init__(self, product: int = 0xFF20, claiming: str = "", reads: int = 1 << 30) -> None:
        self.product, self.claiming, self.reads = product, claiming, reads
        self.lock = threading.Lock()
        device = EmulatedLiberty(built_in_motion(), frozenset({1, 2, 3}))
        self.emulator = Emulator(device, lambda _: 0, time.perf_counter_ns())

    def taken(self, count: int) -> bytes:
        """Return and remove `count` bytes of the device's data."""
        data = bytes(self.emulator.waiting[:count])
        del self.emulator.waiting[:count]
        return data

    def module(self) -> SimpleNamespace:
        """Return a stand-in for the package usb1."""
        device, context = SimpleNamespace(open=lambda: self), SimpleNamespace(open=int, close=int)
        device.getVendorID, device.getProductID = (lambda: 0x0F44), (lambda: self.product)
        context.getDeviceIterator = lambda **_: [device]
        return SimpleNamespace(USBContext=lambda: context, USBError=UsbError, **ERRORS)

    def claimInterface(self, number: int) -> None:  # noqa: N802
        """Claim the interface, or raise the error `claiming`."""
        assert number == 0
        if self.claiming:
            raise ERRORS[self.claiming]

    def bulkWrite(self, endpoint: int, data: bytes, timeout: int) -> int:  # noqa: ARG002, N802
        """Accept at most five bytes."""
        assert endpoint == 0x04
        with self.lock:
            self.emulator.receive(data[:5], time.perf_counter_ns())
        return len(data[:5])

    def bulkRead(self, endpoint: int, length: int, timeout: int) -> bytes:  # noqa: N802
        """Return full packets; a short packet or the timeout ends a transfer."""
        assert (endpoint, length % 512) == (0x88, 0)
        end = time.perf_counter() + timeout / 1000
        self.reads -= self.emulator.device.streaming
        if self.reads < 0:
            raise ERRORS["USBErrorNoDevice"]("no such device")
        while time.perf_counter() < end:
            with self.lock:
                self.emulator.run(time.perf_counter_ns())
                if len(self.emulator.waiting) % 512 or len(self.emulator.waiting) >= length:
                    return self.taken(length)
            time.sleep(0.001)
        error = ERRORS["USBErrorTimeout"]()
        error.received = self.taken(length)
        raise error


@pytest.mark.parametrize("unplugged", [False, True])
def test_a_liberty_is_recorded_until_it_is_unplugged(unplugged: bool, tmp_path: Path, monkeypatch) -> None:
    bus = Bus(reads=40 if unplugged else 1 << 30)
    monkeypatch.setitem(sys.modules, "usb1", bus.module())
    plan = RecordingPlan(tmp_path / "a.arrows", RecordingRequest("liberty"), None if unplugged else 0.3)
    ending = record(plan, open_port("usb:", 115200), LinePrinter(io.StringIO()), StopRequest(), {})
    assert (ending.failed, "unplugged" in ending.reason) == (unplugged,) * 2
    records, tally, _ = decoded(plan.out)
    assert len(records) > 100
    assert set(np.diff(records.frame).tolist()) == {0, 1}
    assert tally.unreadable_bytes == 0


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"product": 0xFF21}, "wants its firmware; its firmware is loaded with fxload"),
        ({"product": 0xBF01}, "a VIPER cannot be read directly over USB"),
        ({"product": 0x9999}, "matches 0 trackers on USB"),
        ({"claiming": "USBErrorBusy"}, "another program has it open"),
        ({"claiming": "USBErrorAccess"}, 'put SUBSYSTEM=="usb"'),
    ],
)
def test_an_unusable_usb_tracker_is_refused(how: dict[str, object], sentence: str, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "usb1", Bus(**how).module())  # type: ignore[arg-type]
    with pytest.raises(InputError, match=sentence):
        open_port("usb:", 115200)


def test_without_the_package_usb_ports_are_refused(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "usb1", None)
    with pytest.raises(InputError, match="needs libusb1"):
        open_port("usb:0f44:ff20", 115200)
    assert "--port usb:0f44:ff20" in "\n".join(port_lines([], [(0x0F44, 0xFF20)]))
