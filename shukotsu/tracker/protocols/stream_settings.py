"""How a tracker's stream is to be read: kept with the recording, so that its bytes can be read alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from shukotsu.errors import InputError
from shukotsu.left import instead
from shukotsu.tables.limits import RATES_HZ
from shukotsu.tracker.families import check_family

STATIONS = frozenset(range(256))
"""Numbers that a station's byte can have; no tracker has as many."""

MM_PER_UNIT = {"cm": 10.0, "inch": 25.4, "m": 1000.0, "foot": 304.8, "mm": 1.0}


@dataclass(frozen=True)
class StreamSettings:
    """Everything that a decoder must know.

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
    if why := instead("format", settings.mode):
        raise InputError(f"{where}: {why}")
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
