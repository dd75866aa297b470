"""trakSTAR and Flock of Birds on a serial line: records that a set top bit begins.

A record is words of 14 bits, each as two bytes of 7, low byte first; only its very first byte has bit 7 set.
There is no checksum and no counter. Source: Flock of Birds Installation and Operation Guide, serial output.
"""

from __future__ import annotations

import numpy as np

from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import conjugate
from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder, gaps
from shukotsu.trackers.protocols.pose_numbers import doubtful_poses
from shukotsu.trackers.protocols.records import Bytes, Decoded, Records, Wholes, empty_records
from shukotsu.trackers.protocols.stream_settings import MM_PER_UNIT, StreamSettings

STATIONS = range(1, 127)
RANGE_INCH = 36
"""Position at full scale; the tracker does not say which of its ranges is set."""

_WORDS = 7
"""Numbers in a record: three of the position, four of the quaternion."""

_FULL_SCALE = 32768.0
_MM = RANGE_INCH * MM_PER_UNIT["inch"] / _FULL_SCALE
_PHASING_BIT = 0x80


class FlockDecoder(PiecewiseDecoder):
    """Decoder of a trakSTAR or Flock of Birds stream of positions and quaternions.

    Of settings.options: `group`: whether an address byte ends each record, which is the station then;
    otherwise it is the first of settings.stations.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        self._group = bool(settings.options.get("group", False))
        self._size = 2 * _WORDS + self._group
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
        low = (rows[:, 0 : 2 * _WORDS : 2] & 0x7F).astype(np.uint16)
        high = rows[:, 1 : 2 * _WORDS : 2].astype(np.uint16)
        numbers = ((high << 9) | (low << 2)).view(np.int16).astype(float)
        records.offset[:] = at
        records.size[:] = self._size
        records.station[:] = rows[:, -1] if self._group else self._stations[0]
        records.position_mm[:] = numbers[:, :3] * _MM
        # It is sent as what turns the transmitter's frame into the receiver's.
        records.quaternion[:] = conjugate(numbers[:, 3:] / _FULL_SCALE)
        strange = ~np.isin(records.station, self._stations) & self._group
        records.doubtful[:] = doubtful_poses(records) | strange
        return records
