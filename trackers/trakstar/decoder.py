"""trakSTAR and Flock of Birds on a serial line: records that a set top bit begins.

A record is words of 14 bits, each as two bytes of 7, low byte first; only its very first byte has bit 7 set.
There is no checksum and no counter. Source: Flock of Birds Installation and Operation Guide, serial output.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from skeleton.rotations import conjugate
from trackers.protocols.piecewise import Bytes, PiecewiseDecoder, gaps
from trackers.protocols.pose_numbers import doubtful_poses, quaternion_of_angles, quaternion_of_cosines
from trackers.protocols.records import Decoded, Records, Wholes, empty_records
from trackers.protocols.stream_settings import MM_PER_UNIT, StreamSettings

WORDS = {"position-quaternion": 7, "position-angles": 6, "position-matrix": 12}
"""Numbers in a record, by `settings.options["record"]`."""

STATIONS = range(1, 127)
RANGES_INCH = (36, 72, 144)
DEFAULT_RANGE_INCH = RANGES_INCH[0]
_FULL_SCALE = 32768.0
_PHASING_BIT = 0x80


class FlockDecoder(PiecewiseDecoder):
    """Decoder of a trakSTAR or Flock of Birds stream.

    Of settings.options: `record` is one of WORDS; `group`: whether an address byte ends each record, which
    is the station then (otherwise it is the first of settings.stations); `range_inch` at full scale, one of
    RANGES_INCH; `inverse`: the quaternion or matrix (not the angles) turns the transmitter's frame into the
    receiver's.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        options = settings.options
        self._kind = options.get("record", "position-quaternion")
        range_inch = options.get("range_inch", DEFAULT_RANGE_INCH)
        if self._kind not in tuple(WORDS) or range_inch not in RANGES_INCH:
            raise InputError(
                f"settings of the tracker: record {self._kind!r} with range_inch {range_inch!r}; expected "
                f"one of {', '.join(WORDS)} with one of {', '.join(map(str, RANGES_INCH))}"
            )
        self._words = WORDS[self._kind]
        self._group = bool(options.get("group", False))
        self._size = 2 * self._words + self._group
        self._mm = range_inch * MM_PER_UNIT["inch"] / _FULL_SCALE
        self._inverse = bool(options.get("inverse", False))
        stations = settings.stations or (1,)
        if any(station not in STATIONS for station in stations):
            raise InputError(f"settings of the tracker: stations {stations}; expected numbers from 1 to 126")
        self._stations = np.array(stations)

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        starts = np.flatnonzero(b & _PHASING_BIT)
        if not final and len(starts) and len(b) - starts[-1] < 2 * self._size - 1:
            decided = int(starts[-1])
            starts = starts[:-1]
        else:
            decided = len(b)
        length = np.diff(starts, append=decided)
        exact = length == self._size
        # One byte too many hides in the record; so many that the next one's first was lost or spoilt do not.
        at = starts[exact | (length >= 2 * self._size - 1)]
        records = self._records(b, at)
        kept = exact[np.searchsorted(starts, at)] | ~records.doubtful
        records = records.take(kept)
        return Decoded(records, gaps(records.offset, records.offset + self._size, decided)), decided

    def _records(self, b: Bytes, at: Wholes) -> Records:
        records = empty_records(len(at))
        if not len(at):
            return records
        rows = np.lib.stride_tricks.sliding_window_view(b, self._size)[at]
        low = (rows[:, 0 : 2 * self._words : 2] & 0x7F).astype(np.uint16)
        high = rows[:, 1 : 2 * self._words : 2].astype(np.uint16)
        numbers = ((high << 9) | (low << 2)).view(np.int16).astype(float)
        records.offset[:] = at
        records.size[:] = self._size
        records.station[:] = rows[:, -1] if self._group else self._stations[0]
        records.position_mm[:] = numbers[:, :3] * self._mm
        records.quaternion[:] = self._quaternion(numbers[:, 3:])
        strange = ~np.isin(records.station, self._stations) & self._group
        records.doubtful[:] = doubtful_poses(records) | strange
        return records

    def _quaternion(self, numbers: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        if self._kind == "position-angles":
            return quaternion_of_angles(numbers * (180 / _FULL_SCALE))
        if self._kind == "position-matrix":
            quaternion = quaternion_of_cosines(numbers.reshape(-1, 3, 3) / _FULL_SCALE)
        else:
            quaternion = numbers / _FULL_SCALE
        return conjugate(quaternion) if self._inverse else quaternion
