"""Ports of trackers: serial devices, pseudo-terminals, URLs of pySerial (socket://, rfc2217://), and USB.

A LIBERTY's RS-232 connects only three wires, so flow control is never used.
"""

from __future__ import annotations

import errno
import importlib
import os
import re
import select
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import serial
from serial.tools import list_ports

from shukotsu.errors import InputError
from shukotsu.tracker.families import POLHEMUS, READY, USB_TRACKERS, WANTS_FIRMWARE

WAIT_S = 0.1
"""Longest time that a read waits for a first byte."""
_READ_BYTES, _QUANTUM_S, _EMPTY_READS = 65536, 0.005, 3

PortEntry = tuple[str, int | None, int | None, str]
"""A serial port: its name, USB vendor, USB product, description."""
WITHOUT_FIRMWARE = "its firmware is loaded with fxload; then it reappears under another number"
HINT = (
    "A tracker on USB is not a serial port; on Linux, once it has its firmware, this makes it one:\n"
    "  sudo modprobe usbserial vendor=0x0f44 product=0x{product:04x}"
)


class PortGoneError(Exception):
    """Raised if the port no longer exists, or its other end has closed it."""


class Port(ABC):
    """An open port.

    name : as given by the user. line_baud : bits per second of the serial line behind it; None if there is no
    serial line (terminal, network, a tracker's USB).
    """

    def __init__(self, name: str, line_baud: int | None = None) -> None:
        self.name = name
        self.line_baud = line_baud

    def set_baud(self, baud: int) -> None:
        """Change the line's rate."""
        self.line_baud = baud

    @abstractmethod
    def read(self) -> bytes:
        """Return the bytes received; wait at most WAIT_S for the first one. Raises PortGoneError."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send all bytes. Raises PortGoneError."""

    @abstractmethod
    def close(self) -> None:
        """Close the port; errors are ignored."""


class SerialPort(Port):
    """A port opened by pySerial.

    On systems that can wait for a descriptor, a read returns with the first bytes, so that the host's time is
    that of their arrival; elsewhere (Windows, rfc2217) it is accurate to _QUANTUM_S.
    """

    def __init__(self, name: str, device: Any, line_baud: int | None) -> None:
        super().__init__(name, line_baud)
        self._device = device
        waits = hasattr(os, "fork") and not name.startswith("rfc2217:")
        self._descriptor = int(device.fileno()) if waits else None
        self._empty = 0

    def set_baud(self, baud: int) -> None:
        """Change the line's rate."""
        self._device.baudrate = baud
        super().set_baud(baud)

    def read(self) -> bytes:
        """Return the bytes received; wait at most WAIT_S for the first one. Raises PortGoneError."""
        try:
            if self._descriptor is None:
                return bytes(self._device.read(_READ_BYTES))
            if not select.select([self._descriptor], [], [], WAIT_S)[0]:
                return b""
            data = os.read(self._descriptor, _READ_BYTES)
        except BlockingIOError:
            return b""
        except (OSError, serial.SerialException, TypeError) as error:
            # pySerial raises TypeError if another thread has closed its descriptor.
            raise PortGoneError(_reason(error)) from error
        self._empty = 0 if data else self._empty + 1
        if self._empty >= _EMPTY_READS:
            raise PortGoneError("the other end closed it")
        return data

    def write(self, data: bytes) -> None:
        """Send all bytes. Raises PortGoneError."""
        try:
            self._device.write(data)
        except (OSError, serial.SerialException) as error:
            raise PortGoneError(_reason(error)) from error

    def close(self) -> None:
        """Close the port; errors are ignored."""
        with suppress(OSError, serial.SerialException):
            self._device.close()


READ_BYTES = 4096
WRITE_S = 2.0
RULE = 'SUBSYSTEM=="usb", ATTR{idVendor}=="0f44", MODE="0666"'


class UsbPort(Port):
    """The port `usb:VVVV:PPPP` (vendor and product), or `usb:` for the only tracker on USB.

    Raises InputError if there is no such tracker, it needs its firmware, or it cannot be opened.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        try:
            usb = self._usb = importlib.import_module("usb1")  # its timeout error keeps the bytes received
            self._context = usb.USBContext()
            self._context.open()
        except (ImportError, OSError) as error:
            raise InputError(
                "usb: needs libusb1 (pip install libusb1) and the system's libusb-1.0"
            ) from error
        device, (self._out, self._in) = self._chosen(name.partition(":")[2].lower())
        try:
            self._handle = device.open()
            self._handle.claimInterface(0)
        except usb.USBErrorAccess as error:
            raise InputError(
                f"{name}: you have no permission to open it; put {RULE} into "
                "/etc/udev/rules.d/99-polhemus.rules and connect it again"
            ) from error
        except usb.USBErrorBusy as error:
            raise InputError(
                f"{name}: another program has it open, or the kernel as a serial port "
                "(sudo modprobe -r usbserial)"
            ) from error
        except usb.USBError as error:
            raise InputError(f"{name}: cannot be opened ({error}); connect it again") from error

    def _chosen(self, wanted: str) -> tuple[Any, tuple[int, int]]:
        """Return the device and its endpoints."""
        trackers = []
        for device in self._context.getDeviceIterator(skip_on_error=True):
            ids = (device.getVendorID(), device.getProductID())
            if ids in USB_TRACKERS and wanted in ("", f"{ids[0]:04x}:{ids[1]:04x}"):
                trackers.append((device, USB_TRACKERS[ids]))
        if len(trackers) != 1:
            raise InputError(
                f"{self.name}: matches {len(trackers)} trackers on USB; expected one; "
                "`shukotsu record --devices` lists them"
            )
        device, tracker = trackers[0]
        if tracker.endpoints is None:
            asleep = tracker.state == WANTS_FIRMWARE
            why = f"{tracker.state}; {WITHOUT_FIRMWARE}" if asleep else "cannot be read directly over USB"
            raise InputError(f"{self.name}: a {tracker.name} {why}; see `shukotsu record --devices`")
        return device, tracker.endpoints

    def read(self) -> bytes:
        """Return the bytes received; wait at most WAIT_S for the first one. Raises PortGoneError."""
        try:
            return bytes(self._handle.bulkRead(self._in, READ_BYTES, round(1000 * WAIT_S)))
        except self._usb.USBErrorTimeout as error:
            return bytes(error.received)
        except self._usb.USBError as error:
            raise PortGoneError(f"it was unplugged or switched off: {error}") from error

    def write(self, data: bytes) -> None:
        """Send all bytes. Raises PortGoneError."""
        try:
            while data:
                data = data[self._handle.bulkWrite(self._out, data, round(1000 * WRITE_S)) :]
        except self._usb.USBError as error:
            raise PortGoneError(f"it accepts no data: {error}") from error

    def close(self) -> None:
        """Close the port; errors are ignored."""
        self._context.close()


def open_port(name: str, baud: int) -> Port:
    """Open a port for exclusive use; baud : rate of a serial device.

    Raises InputError if there is no such port, access is denied, or another program uses it.
    """
    if name.startswith("usb:"):
        return UsbPort(name)
    options: dict[str, Any] = {"baudrate": baud, "timeout": _QUANTUM_S}
    if "://" not in name:
        options |= {"exclusive": True, "write_timeout": 2.0}
    elif not re.fullmatch(r"(socket|rfc2217)://[^/]+:\d{1,5}([/?].*)?", name):
        kinds = "socket://HOST:PORT or rfc2217://HOST:PORT"
        raise InputError(f"{name}: is not a network port; expected {kinds}")
    try:
        device = serial.serial_for_url(name, **options)
    except (OSError, serial.SerialException, ValueError) as error:
        raise InputError(f"{name}: {_why_not(name, error)}") from error
    if "://" in name:
        return SerialPort(name, device, None)
    path = str(Path(name).resolve())
    # a pseudo-terminal and a tracker's own USB appear as a tty, but have no serial line
    is_line = not path.startswith("/dev/pts/")
    is_line &= (path, POLHEMUS) not in [(port.device, port.vid) for port in list_ports.comports()]
    return SerialPort(name, device, baud if is_line else None)


def _why_not(name: str, error: Exception) -> str:
    number, text = getattr(error, "errno", None), str(error)
    if "exclusively lock" in text or number in (errno.EBUSY, errno.EAGAIN):
        return "another program has it open, and two cannot share a tracker; close that one first"
    if re.fullmatch(r"[\w.-]+:\d+", name):
        return f"no such port; for one on the network give --port socket://{name}"
    if number == errno.ENOENT or "No such file" in text:
        return "no such port; `shukotsu record --devices` lists the ports"
    if number == errno.EACCES or "Permission denied" in text:
        return "you have no permission to open it; on most systems members of the group dialout have"
    if "://" in name:
        return f"cannot be reached ({_reason(error)}){perhaps_taken(name) if 'refused' in text else ''}"
    return f"cannot be opened as a port ({_reason(error)})"


def perhaps_taken(name: str) -> str:
    """Return a possible cause if a network connection ends at once: most serve one program at a time."""
    return "; perhaps another program has it" if "://" in name else ""


def _reason(error: Exception) -> str:
    """Return the system's reason in an error, without pySerial's wording around it."""
    if isinstance(error, OSError) and not isinstance(error, serial.SerialException) and error.strerror:
        return error.strerror
    return re.sub(r".*\[Errno \d+\] ", "", str(error)) or type(error).__name__


def serial_ports() -> list[PortEntry]:
    """Return all serial ports of this machine."""
    ports = sorted(list_ports.comports())
    return [(port.device, port.vid, port.pid, port.description or "serial port") for port in ports]


def usb_devices() -> list[tuple[int, int]]:
    """Return vendor and product of all USB devices that the system lists."""
    devices = []
    for vendor in sorted(Path("/sys/bus/usb/devices").glob("*/idVendor")):
        try:
            product = (vendor.parent / "idProduct").read_text("ascii")
            devices.append((int(vendor.read_text("ascii"), 16), int(product, 16)))
        except (OSError, ValueError):  # unplugged just now
            continue
    return devices


def port_lines(ports: Sequence[PortEntry], usb: Sequence[tuple[int, int]]) -> list[str]:
    """Format serial ports, and trackers on USB (vendor, product) without a serial port, line by line."""
    lines = []
    for name, vendor, product, description in ports:
        tracker = USB_TRACKERS.get((vendor or 0, product or 0))
        number = "" if vendor is None or product is None else f" (USB {vendor:04x}:{product:04x})"
        lines.append(f"{name}  {tracker.name if tracker else description}{number}")
    for ids in usb:
        if ids not in USB_TRACKERS or any(ids == entry[1:3] for entry in ports):
            continue
        tracker, number = USB_TRACKERS[ids], f"{ids[0]:04x}:{ids[1]:04x}"
        lines += [f"USB {number}  {tracker.name}: {tracker.state}"]
        if tracker.endpoints is not None:
            lines += [f"give it as --port usb:{number} (needs libusb1), or:"]
        if tracker.state == READY:
            lines += ["has no serial port yet. " + HINT.format(product=ids[1])]
        elif tracker.state == WANTS_FIRMWARE:
            lines += [WITHOUT_FIRMWARE]
    no_device = ["No serial port and no tracker is connected to this machine.", HINT.format(product=0xFF20)]
    return lines or no_device
