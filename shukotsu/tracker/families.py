"""Families of trackers, and the settings by which their streams are decoded, stored with a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from shukotsu.errors import InputError, guess
from shukotsu.tables import limits
from shukotsu.tables.limits import RATES_HZ


class UsbTracker(NamedTuple):
    """A tracker on USB: its name, its state, and the endpoints out and in where bulk transfers read it."""

    name: str
    state: str
    endpoints: tuple[int, int] | None = None


@dataclass(frozen=True)
class Family:
    """A family of trackers.

    title : its name for people. rates_hz : frames a second that a user can choose, the usual one first.
    connectors : largest number of receivers. remedies : options that reduce its stream. usb : by vendor and
    product.
    """

    title: str
    rates_hz: tuple[int, ...]
    connectors: int
    remedies: str
    usb: Mapping[tuple[int, int], UsbTracker] = field(default_factory=dict)


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


FAMILIES = {
    "liberty": Family(
        "LIBERTY", (240, 120), 16, "--stations, --items short, --rate 120", _on_usb("LIBERTY", 0xFF00)
    ),
    "patriot": Family("PATRIOT", (60,), 2, "--stations, --items short", _on_usb("PATRIOT", 0xEF00)),
    "viper": Family(
        "VIPER",
        (240, 120),
        16,
        "--rate 120",
        {(POLHEMUS, 0xBF01): UsbTracker("VIPER", READY), (POLHEMUS, 0xCF01): UsbTracker("G4", NOT_READ)},
    ),
}

USB_TRACKERS = {device: tracker for family in FAMILIES.values() for device, tracker in family.usb.items()}
"""By USB vendor and product."""


def check_family(name: str, where: str) -> None:
    """Raise InputError where no family has that name; where : what names it, for the message."""
    if name not in FAMILIES:
        raise InputError(f"{where}: is {name!r}; {guess(name, [*FAMILIES])}")


STATIONS = frozenset(range(256))
"""Values of a station's byte; no tracker has as many stations."""
MM_PER_UNIT = {**limits.MM_PER_UNIT, "foot": 304.8}


@dataclass(frozen=True)
class StreamSettings:
    """Settings of a stream that its decoder needs.

    family : a name in FAMILIES; mode : "binary"; unit : of positions in the stream.
    rate_hz : frames a second (of each station). stations : those that were active at the start.
    items : station -> output list, as LIBERTY and PATRIOT number their items; empty for others.
    hemisphere : station -> vector of its half of space, (0, 0, 0) where the tracker follows the receiver.
    options : for people: `whoami`, filters, errors.
    """

    family: str
    mode: str
    unit: str
    rate_hz: float
    stations: tuple[int, ...]
    items: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    hemisphere: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON types."""
        return asdict(self)


def settings_from_json(loaded: Any, where: str) -> StreamSettings:
    """Read settings from what `to_json` gave. Raises InputError where they cannot be such."""
    try:
        if not all(isinstance(loaded[name], str) for name in ("family", "mode", "unit")):
            raise TypeError("a name is no text")
        settings = StreamSettings(
            loaded["family"],
            loaded["mode"],
            loaded["unit"],
            float(loaded["rate_hz"]),
            tuple(int(station) for station in loaded["stations"]),
            {int(s): tuple(int(i) for i in items) for s, items in loaded["items"].items()},
            {int(s): (float(v[0]), float(v[1]), float(v[2])) for s, v in loaded["hemisphere"].items()},
            dict(loaded.get("options", {})),
        )
        stations = {*settings.stations, *settings.items, *settings.hemisphere}
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise InputError(f"{where}: the tracker's settings in it are damaged; copy it again") from error
    check_family(settings.family, where)
    vectors = [number for vector in settings.hemisphere.values() for number in vector]
    if not stations <= STATIONS or not all(map(math.isfinite, vectors)):
        raise InputError(
            f"{where}: the tracker's settings in it name stations or hemispheres that none has; copy it again"
        )
    possible = RATES_HZ[0] <= settings.rate_hz < 10_000
    if settings.mode != "binary" or settings.unit not in MM_PER_UNIT or not possible:
        raise InputError(
            f"{where}: the tracker's settings in it are none that is known (family {settings.family!r}, "
            f"mode {settings.mode!r}, unit {settings.unit!r}, {settings.rate_hz} Hz)"
        )
    return settings
