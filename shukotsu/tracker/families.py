"""Families of trackers: their names, rates, receivers and USB devices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from shukotsu.errors import InputError, guess


class UsbTracker(NamedTuple):
    """A tracker on USB: name, state, and bulk endpoints (out, in) if this program can read it over USB."""

    name: str
    state: str
    endpoints: tuple[int, int] | None = None


@dataclass(frozen=True)
class Family:
    """A family of trackers.

    title : name for display. rates_hz : frame rates that a user can choose, the default first. connectors :
    largest number of receivers. remedies : options that reduce the data rate. usb : USB devices by vendor and
    product.
    """

    title: str
    rates_hz: tuple[int, ...]
    connectors: int
    remedies: str
    usb: Mapping[tuple[int, int], UsbTracker]


USUAL = "liberty"
POLHEMUS = 0x0F44
HIGH_SPEED, FULL_SPEED = (0x04, 0x88), (0x02, 0x82)
READY, WANTS_FIRMWARE, NOT_READ = "ready", "wants its firmware", "not read by this program"


def _on_usb(name: str, product: int) -> dict[tuple[int, int], UsbTracker]:
    return {
        (POLHEMUS, product + 0x20): UsbTracker(f"{name} (high-speed USB)", READY, HIGH_SPEED),
        (POLHEMUS, product + 0x21): UsbTracker(f"{name} (high-speed USB)", WANTS_FIRMWARE),
        (POLHEMUS, product + 0x12): UsbTracker(name, READY, FULL_SPEED),
        (POLHEMUS, product + 0x11): UsbTracker(name, WANTS_FIRMWARE),
    }


_VIPER = {(POLHEMUS, 0xBF01): UsbTracker("VIPER", READY), (POLHEMUS, 0xCF01): UsbTracker("G4", NOT_READ)}
_FEWER = "--stations, --items short"
FAMILIES = {
    "liberty": Family("LIBERTY", (240, 120), 16, f"{_FEWER}, --rate 120", _on_usb("LIBERTY", 0xFF00)),
    "patriot": Family("PATRIOT", (60,), 2, _FEWER, _on_usb("PATRIOT", 0xEF00)),
    "viper": Family("VIPER", (240, 120), 16, "--rate 120", _VIPER),
}

USB_TRACKERS = {device: tracker for family in FAMILIES.values() for device, tracker in family.usb.items()}
"""By USB vendor and product."""


def check_family(name: str, where: str) -> None:
    """Raise InputError if no family has that name; where : option or file that names it, for the message."""
    if name not in FAMILIES:
        raise InputError(f"{where}: is {name!r}; {guess(name, [*FAMILIES])}")
