"""FASTRAK in binary: bytes -> records, which nothing but their first three bytes tells from other bytes.

'0', the station's digit, a status character, then the items, little-endian; no length, no checksum and no
counter. So a start is believed right behind a good record; elsewhere, only with two more records behind it
that follow directly, its own blanks and line ends in place and numbers that can be right.
Source: FASTRAK User Manual OPM00PI002. Replies to commands count as skipped bytes here.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shukotsu.trackers.fastrak.items import ITEMS, LINE_END, OUTPUT_ITEMS, SPACE
from shukotsu.trackers.protocols.output_items import CONSTANT_BYTES, read_binary_records
from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder, gaps
from shukotsu.trackers.protocols.records import Bools, Bytes, Decoded, Wholes
from shukotsu.trackers.protocols.resync import NO, UNKNOWN, YES, Starts, Verdicts, walk
from shukotsu.trackers.protocols.stream_settings import StreamSettings

_IS_STATUS = np.isin(np.arange(256), list(b" ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"))


class BinaryDecoder(PiecewiseDecoder):
    """Decoder of a FASTRAK stream in binary. Raises InputError for unknown items."""

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        items = OUTPUT_ITEMS.one_list(settings.items)
        self._mm_per_unit = settings.mm_per_unit
        self._kind = OUTPUT_ITEMS.record_type(items)
        self._guards = tuple(_guards(items))
        self._is_station = np.isin(np.arange(256), [ord("0") + station for station in settings.items])
        self._trusted = True  # whether a record that starts at the rest's first byte is believed

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        header_bytes, size = OUTPUT_ITEMS.header_bytes, self._kind.itemsize
        at = np.flatnonzero(b[: max(0, len(b) - (size if final else header_bytes) + 1)] == ord("0"))
        at = at[self._is_station[b[at + 1]] & _IS_STATUS[b[at + 2]]]
        starts = Starts(at, size, len(b), header_bytes, final)
        whole = at[starts.end <= len(b)]  # those that come first
        records = read_binary_records(b, whole, self._kind, self._mm_per_unit)
        records.station[:] -= ord("0")
        good = np.full(len(at), UNKNOWN, np.int8)
        good[: len(whole)] = np.where(self._are_guarded(b, whole) & ~records.doubtful, YES, NO)
        believed = np.minimum(good, _third_in_a_row(starts))
        decided = walk(starts, believed, lambda index: bool(good[index] == YES), trusted=self._trusted)
        self._trusted = decided.trusted
        accepted = decided.accepted
        skipped = gaps(at[accepted], starts.end[accepted], decided.position)
        return Decoded(records.take(accepted), skipped), decided.position

    def _are_guarded(self, b: Bytes, at: Wholes) -> Bools:
        """Tell whether blanks and line ends of the records at `at` are in place, (N,)."""
        guarded = np.ones(len(at), bool)
        for place, byte in self._guards:
            guarded &= b[at + place] == byte
        return guarded


def _guards(items: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """Give place and value of the bytes of a record that never change."""
    for index, item in enumerate(items):
        if item in (SPACE, LINE_END):
            place = OUTPUT_ITEMS.record_bytes(items[:index])
            yield from ((place + nth, CONSTANT_BYTES[name]) for nth, name in enumerate(ITEMS[item].fields))


def _third_in_a_row(starts: Starts) -> Verdicts:
    """Tell whether each start and the one behind it are both linked, shape (N,)."""
    second = starts.link_verdicts
    ends = (starts.end == starts.length) & starts.final
    alone = ends | starts.cut | (starts.following < 0)
    return np.where(alone, second, second[starts.following])
