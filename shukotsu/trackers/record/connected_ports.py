"""The ports at which a tracker may be: serial ports, and trackers on USB that have none yet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shukotsu.trackers.families import READY, USB_TRACKERS, WANTS_FIRMWARE

SerialPort = tuple[str, int | None, int | None, str]
"""Name, USB vendor, USB product, description."""

WITHOUT_FIRMWARE = "its firmware is loaded with fxload; then it comes back under another number."
HINT = (
    "A tracker on USB is no serial port by itself; on Linux, once it has its firmware, this makes it one:\n"
    "  sudo modprobe usbserial vendor=0x0f44 product=0x{product:04x}"
)


def serial_ports() -> list[SerialPort]:
    """Return every serial port of this machine."""
    from serial.tools import list_ports

    return [
        (port.device, port.vid, port.pid, port.description or "serial port")
        for port in sorted(list_ports.comports())
    ]


def usb_devices(root: Path = Path("/sys/bus/usb/devices")) -> list[tuple[int, int]]:
    """Return vendor and product of every device on USB, as far as the system tells."""
    devices = []
    for vendor in sorted(root.glob("*/idVendor")):
        try:
            product = (vendor.parent / "idProduct").read_text("ascii")
            devices.append((int(vendor.read_text("ascii"), 16), int(product, 16)))
        except (OSError, ValueError):  # unplugged just now
            continue
    return devices


def port_lines(ports: Sequence[SerialPort], usb: Sequence[tuple[int, int]]) -> list[str]:
    """Return a list for people of serial ports, and of trackers on USB (vendor, product) without one."""
    lines = []
    for name, vendor, product, description in ports:
        tracker = USB_TRACKERS.get((vendor or 0, product or 0))
        ids = "" if vendor is None or product is None else f" (USB {vendor:04x}:{product:04x})"
        lines.append(f"{name}  {tracker.name if tracker else description}{ids}")
    for ids in usb:
        if ids not in USB_TRACKERS or ids in [(vendor, product) for _, vendor, product, _ in ports]:
            continue
        tracker, number = USB_TRACKERS[ids], f"{ids[0]:04x}:{ids[1]:04x}"
        lines += [f"USB {number}  {tracker.name}: {tracker.state}"]
        if tracker.endpoints is not None:
            lines += [f"give it as --port usb:{number} (needs libusb1), or:"]
        if tracker.state == READY:
            lines += ["has no serial port yet. " + HINT.format(product=ids[1])]
        elif tracker.state == WANTS_FIRMWARE:
            lines += [WITHOUT_FIRMWARE]
    nothing = ["No serial port and no tracker is connected to this machine.", HINT.format(product=0xFF20)]
    return lines or nothing
