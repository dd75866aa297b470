"""What LIBERTY and PATRIOT keep: settings as the factory leaves them, and the numbers of errors.

Source: LIBERTY User Manual URM03PH156; the texts of errors are invented.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from stages.capture.emulate.frames import DEFAULT_HEMISPHERE, StationFrames
from stages.capture.trackers.liberty.items import DEFAULT_LIST

DEFAULT_FILTER = (0.2, 0.2, 0.8, 0.95)
NO_FILTER = (0.0, 1.0, 0.0, 0.0)

ERRORS = {
    1: "Invalid Command",
    2: "Invalid Station",
    3: "Invalid Parameter",
    4: "Too Few Parameters",
    5: "Too Many Parameters",
    6: "Parameter Below Limit",
    7: "Parameter Above Limit",
    16: "Too Many Command Characters",
}


class RefusedError(Exception):
    """The device does not do it; `code` is the manual's error number."""

    def __init__(self, code: int) -> None:
        super().__init__(ERRORS[code])
        self.code = code


@dataclass
class StationSettings:
    """What can be set of one station."""

    items: tuple[int, ...] = DEFAULT_LIST
    hemisphere: tuple[float, ...] = DEFAULT_HEMISPHERE
    frames: StationFrames = field(default_factory=StationFrames)
    stylus: int = 0
    enabled: bool = True


@dataclass
class Settings:
    """What can be set of the device, as the manual's factory leaves it."""

    stations: dict[int, StationSettings]
    binary: int = 0
    unit: int = 0
    rate: int = 4
    compensation: int = 0
    sync: int = 0
    echo: int = 0
    buffered: int = 1
    baud: int = 1152
    parity: int = 0
    name: str = ""
    mounting_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
    position_filter: tuple[float, ...] = DEFAULT_FILTER
    attitude_filter: tuple[float, ...] = DEFAULT_FILTER


def floats(values: Iterable[float]) -> bytes:
    """Numbers as the device sends them: float32, little-endian."""
    return np.asarray(list(values), "<f4").tobytes()


def wholes(*values: int) -> bytes:
    """Whole numbers as the device sends them: int32, little-endian."""
    return np.asarray(values, np.int64).astype("<i4").tobytes()
