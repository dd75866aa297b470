"""Trackers on USB that are no serial port: bulk transfers by libusb, the bytes of the serial protocol."""

from __future__ import annotations

import importlib
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.families import USB_TRACKERS, WANTS_FIRMWARE
from shukotsu.trackers.record.port import WAIT_S, WITHOUT_FIRMWARE, Port, PortGoneError

READ_BYTES = 4096
WRITE_S = 2.0
RULE = 'SUBSYSTEM=="usb", ATTR{idVendor}=="0f44", MODE="0666"'


class UsbPort(Port):
    """The port `usb:VVVV:PPPP` (vendor and product), or `usb:` for the only tracker there is.

    Raises InputError where there is none, it wants its firmware, or it may not be opened.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        try:
            usb = self._usb = importlib.import_module("usb1")  # whose read that times out has what came
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
                f"{name}: may not be opened by you; put {RULE} into /etc/udev/rules.d/99-polhemus.rules and "
                "connect it anew"
            ) from error
        except usb.USBErrorBusy as error:
            raise InputError(
                f"{name}: another program has it open, or the kernel as a serial port "
                "(sudo modprobe -r usbserial)"
            ) from error
        except usb.USBError as error:
            raise InputError(f"{name}: cannot be opened ({error}); connect it anew") from error

    def _chosen(self, wanted: str) -> tuple[Any, tuple[int, int]]:
        """Return the device and its endpoints."""
        trackers = []
        for device in self._context.getDeviceIterator(skip_on_error=True):
            ids = (device.getVendorID(), device.getProductID())
            if ids in USB_TRACKERS and wanted in ("", f"{ids[0]:04x}:{ids[1]:04x}"):
                trackers.append((device, USB_TRACKERS[ids]))
        if len(trackers) != 1:
            raise InputError(
                f"{self.name}: are {len(trackers)} trackers on USB; expected one; "
                "`shukotsu record --devices` lists them"
            )
        device, tracker = trackers[0]
        if tracker.endpoints is None:
            asleep = tracker.state == WANTS_FIRMWARE
            why = f"{tracker.state}; {WITHOUT_FIRMWARE}" if asleep else "is not read this way"
            raise InputError(f"{self.name}: a {tracker.name} {why}; see `shukotsu record --devices`")
        return device, tracker.endpoints

    def read(self) -> bytes:
        """Return what has come, waiting at most WAIT_S; empty where nothing came. Raises PortGoneError."""
        try:
            return bytes(self._handle.bulkRead(self._in, READ_BYTES, round(1000 * WAIT_S)))
        except self._usb.USBErrorTimeout as error:
            return bytes(error.received)
        except self._usb.USBError as error:
            raise PortGoneError(f"it was unplugged or switched off: {error}") from error

    def write(self, data: bytes) -> None:
        """Send all of it. Raises PortGoneError."""
        try:
            while data:
                data = data[self._handle.bulkWrite(self._out, data, round(1000 * WRITE_S)) :]
        except self._usb.USBError as error:
            raise PortGoneError(f"it takes nothing: {error}") from error

    def close(self) -> None:
        """Close the port; what goes wrong then is of no interest any more."""
        self._context.close()
