"""The ports at which a tracker may be: serial ports, and trackers on USB that have none yet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shukotsu.trackers.families import READY, USB_TRACKERS, WANTS_FIRMWARE

WITHOUT_FIRMWARE = "its firmware is loaded with fxload; then it comes back under another number."
HINT = (
    "A tracker on USB is no serial port by itself; on Linux, once it has its firmware, this makes it one:\n"
    "  sudo modprobe usbserial vendor=0x0f44 product=0x{product:04x}"
)


def serial_ports() -> list[tuple[str, int | None, int | None, str]]:
    """Give (name, USB vendor, USB product, description) of every serial port of this machine."""
    from serial.tools import list_ports

    return [
        (port.device, port.vid, port.pid, port.description or "serial port")
        for port in sorted(list_ports.comports())
    ]


def usb_devices(root: Path = Path("/sys/bus/usb/devices")) -> list[tuple[int, int]]:
    """Give vendor and product of every device on USB, as far as the system tells."""
    devices = []
    for vendor in sorted(root.glob("*/idVendor")):
        try:
            product = (vendor.parent / "idProduct").read_text("ascii")
            devices.append((int(vendor.read_text("ascii"), 16), int(product, 16)))
        except (OSError, ValueError):  # unplugged just now
            continue
    return devices


def port_lines(
    ports: Sequence[tuple[str, int | None, int | None, str]], usb: Sequence[tuple[int, int]]
) -> list[str]:
    """List ports, given as (name, USB vendor, USB product, description), and trackers on USB."""
    lines, on_ports = [], set()
    for name, vendor, product, description in ports:
        if vendor is None or product is None:
            lines.append(f"{name}  {description}")
            continue
        on_ports.add((vendor, product))
        known = USB_TRACKERS.get((vendor, product))
        lines.append(f"{name}  {known.name if known else description} (USB {vendor:04x}:{product:04x})")
    for vendor, product in usb:
        if (vendor, product) in USB_TRACKERS and (vendor, product) not in on_ports:
            lines += _without_port(vendor, product)
    if lines:
        return lines
    return ["No serial port and no tracker is connected to this machine.", HINT.format(product=0xFF20)]


def _without_port(vendor: int, product: int) -> list[str]:
    name, state, endpoints = USB_TRACKERS[vendor, product]
    lines = [f"USB {vendor:04x}:{product:04x}  {name}: {state}"]
    if endpoints is not None:
        lines += [f"give it as --port usb:{vendor:04x}:{product:04x} (needs libusb1), or:"]
    if state == READY:
        lines += ["has no serial port yet. " + HINT.format(product=product)]
    elif state == WANTS_FIRMWARE:
        lines += [WITHOUT_FIRMWARE]
    return lines
