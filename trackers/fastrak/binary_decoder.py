"""FASTRAK in binary: bytes -> records, which nothing but their first three bytes tells from other bytes.

'0', the station's digit, a status character, then the items, little-endian; no length, no checksum and no
counter. So a start is believed right behind a good record; elsewhere, only with two more records behind it
that follow directly, its own blanks and line ends in place and numbers that can be right.
Source: FASTRAK User Manual OPM00PI002. Replies to commands count as skipped bytes here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trackers.fastrak.items import ITEMS, LINE_END, OUTPUT_ITEMS, SPACE
from trackers.protocols.output_items import CONSTANT_BYTES, read_binary_records
from trackers.protocols.piecewise import Bytes, PiecewiseDecoder, gaps
from trackers.protocols.records import Decoded, Records, Wholes, concatenated, empty_records
from trackers.protocols.resync import NO, UNKNOWN, YES, Bools, Starts, Verdicts, walk
from trackers.protocols.stream_settings import StreamSettings

_IS_STATUS = np.isin(np.arange(256), list(b" ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"))


@dataclass(frozen=True)
class _Form:
    """Records of one output list: their NumPy type, and (place, byte) of bytes that never change."""

    stations: tuple[int, ...]
    kind: np.dtype[np.void]
    guards: tuple[tuple[int, int], ...]


class BinaryDecoder(PiecewiseDecoder):
    """Decoder of a FASTRAK stream in binary. Raises InputError for unknown items."""

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        lists = OUTPUT_ITEMS.checked(settings.items)
        self._mm_per_unit = settings.mm_per_unit
        self._forms = [
            _form(items, tuple(station for station, own in lists.items() if own == items))
            for items in sorted(set(lists.values()))
        ]
        self._sizes = np.zeros(256, np.int64)
        for form in self._forms:
            self._sizes[[ord("0") + station for station in form.stations]] = form.kind.itemsize
        self._trusted = True  # whether a record that starts at the rest's first byte is believed

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        header_bytes = OUTPUT_ITEMS.header_bytes
        at = np.flatnonzero(b[: max(0, len(b) - header_bytes + 1)] == ord("0"))
        at = at[(self._sizes[b[at + 1]] > 0) & _IS_STATUS[b[at + 2]]]
        end = at + self._sizes[b[at + 1]]
        if final:
            at, end = at[end <= len(b)], end[end <= len(b)]
        complete = end <= len(b)
        records, guarded = self._records(b, at[complete])
        good = np.full(len(at), UNKNOWN, np.int8)
        good[complete] = np.where(guarded & ~records.doubtful, YES, NO)
        starts = Starts(at, end, len(b), header_bytes, final)
        believed = np.minimum(good, _third_in_a_row(starts))
        decided = walk(starts, believed, lambda index: bool(good[index] == YES), trusted=self._trusted)
        self._trusted = decided.trusted
        accepted = decided.accepted
        rows = (np.cumsum(complete) - 1)[accepted]
        kept = records if len(rows) == len(records) else records.take(rows)
        return Decoded(kept, gaps(at[accepted], end[accepted], decided.position)), decided.position

    def _records(self, b: Bytes, at: Wholes) -> tuple[Records, Bools]:
        """Read the records at `at`, all there, and say whose blanks and line ends are in place."""
        station = b[at + 1].astype(np.int64) - ord("0")
        parts = [empty_records()]
        guarded = np.ones(len(at), bool)
        for form in self._forms:
            mine: npt.NDArray[np.bool_] | slice = (
                np.isin(station, form.stations) if len(self._forms) > 1 else slice(None)
            )
            records = read_binary_records(b, at[mine], form.kind, self._mm_per_unit)
            records.station[:] -= ord("0")
            parts.append(records)
            for place, byte in form.guards:
                guarded[mine] &= b[at[mine] + place] == byte
        records = concatenated([part for part in parts if len(part)])
        return (records.take(np.argsort(records.offset)) if len(self._forms) > 1 else records), guarded


def _form(items: tuple[int, ...], stations: tuple[int, ...]) -> _Form:
    guards: list[tuple[int, int]] = []
    for index, item in enumerate(items):
        if item in (SPACE, LINE_END):
            place = OUTPUT_ITEMS.record_bytes(items[:index])
            guards += [(place + nth, CONSTANT_BYTES[name]) for nth, name in enumerate(ITEMS[item].fields)]
    return _Form(stations, OUTPUT_ITEMS.record_type(items), tuple(guards))


def _third_in_a_row(starts: Starts) -> Verdicts:
    """Whether each start and the one behind it are both linked, shape (N,)."""
    second = starts.link_verdicts
    ends = (starts.end == starts.length) & starts.final
    alone = ends | starts.cut | (starts.following < 0)
    return np.where(alone, second, second[starts.following])
