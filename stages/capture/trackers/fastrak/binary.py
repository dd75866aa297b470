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

from stages.capture.trackers.fastrak.items import (
    HEADER_BYTES,
    ITEMS,
    LINE_END,
    SPACE,
    field_names,
    output_lists,
    record_bytes,
)
from stages.capture.trackers.numbers import fill_in
from stages.capture.trackers.piecewise import Bytes, PiecewiseDecoder, gaps
from stages.capture.trackers.records import Decoded, Records, concatenated, empty_records
from stages.capture.trackers.settings import StreamSettings

Wholes = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_IS_STATUS = np.isin(np.arange(256), list(b" ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"))
_GUARDS = {SPACE: b" ", LINE_END: b"\r\n"}
_NO, _UNKNOWN, _YES = 0, 1, 2


@dataclass(frozen=True)
class _Form:
    """Records of one output list: their NumPy type, and which bytes stand at which places of them."""

    stations: tuple[int, ...]
    kind: np.dtype[np.void]
    guards: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class _Starts:
    """N places where a header stands.

    at, end : (N,); following : (N,) index of the start at its end, -1 for none; believed : (N,) whether it
    is believed on its own, _NO, _UNKNOWN or _YES; closed, cut : (N,) whether the stream or the piece ends at
    its end, the latter so that the next header cannot be seen.
    """

    at: Wholes
    end: Wholes
    following: Wholes
    believed: npt.NDArray[np.int8]
    closed: Flags
    cut: Flags


class BinaryDecoder(PiecewiseDecoder):
    """Decoder of a FASTRAK stream in binary (see `records.Decoder`). Raises InputError for unknown items."""

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        lists = output_lists(settings)
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
        at = np.flatnonzero(b[: max(0, len(b) - HEADER_BYTES + 1)] == ord("0"))
        at = at[(self._sizes[b[at + 1]] > 0) & _IS_STATUS[b[at + 2]]]
        end = at + self._sizes[b[at + 1]]
        if final:
            at, end = at[end <= len(b)], end[end <= len(b)]
        complete = end <= len(b)
        records, guarded = self._records(b, at[complete])
        good = np.zeros(len(at), np.int8)
        good[complete] = np.where(guarded & ~records.doubtful, _YES, _NO)
        good[~complete] = _UNKNOWN
        starts = _starts(at, end, good, len(b), final)
        accepted, decided, self._trusted = _walk(starts, good == _YES, len(b), final, self._trusted)
        rows = (np.cumsum(complete) - 1)[accepted]
        kept = records if len(rows) == len(records) else records.take(rows)
        return Decoded(kept, gaps(at[accepted], end[accepted], decided)), decided

    def _records(self, b: Bytes, at: Wholes) -> tuple[Records, Flags]:
        """Read the records at `at`, all there, and say whose blanks and line ends are in place."""
        station = b[at + 1].astype(np.int64) - ord("0")
        parts = [empty_records()]
        guarded = np.ones(len(at), bool)
        for form in self._forms:
            mine = np.isin(station, form.stations) if len(self._forms) > 1 else slice(None)
            parts.append(_records_of_form(b, at[mine], form, self._mm_per_unit))
            for place, byte in form.guards:
                guarded[mine] &= b[at[mine] + place] == byte
        records = concatenated([part for part in parts if len(part)])
        return (records.take(np.argsort(records.offset)) if len(self._forms) > 1 else records), guarded


def _form(items: tuple[int, ...], stations: tuple[int, ...]) -> _Form:
    names = field_names(items)
    kinds = [f"<{ITEMS[item].kind}" for item in items for _ in ITEMS[item].fields]
    names = [name or f"again_{place}" for place, name in enumerate(names)]
    numbers = list(zip(names, kinds, strict=True))
    kind = np.dtype([("zero", "u1"), ("station", "u1"), ("status", "u1"), *numbers])
    guards: list[tuple[int, int]] = []
    for index, item in enumerate(items):
        place = record_bytes(items[:index])
        guards += [(place + nth, byte) for nth, byte in enumerate(_GUARDS.get(item, b""))]
    return _Form(stations, kind, tuple(guards))


def _records_of_form(b: Bytes, at: Wholes, form: _Form, mm_per_unit: float) -> Records:
    size = form.kind.itemsize
    records = empty_records(len(at))
    if not len(at):
        return records
    if len(at) > 1 and (np.diff(at) == size).all():
        rows = b[at[0] : at[-1] + size].view(form.kind)
    else:
        rows = np.lib.stride_tricks.sliding_window_view(b, size)[at].view(form.kind)[:, 0]
    records.offset[:] = at
    records.size[:] = size
    records.station[:] = rows["station"] - ord("0")
    records.error[:] = np.where(rows["status"] == ord(" "), 0, rows["status"])
    numbers = {name: rows[name] for name in form.kind.names or ()}
    if "button" in numbers:
        numbers["button"] = numbers["button"] & 1  # the character '0' or '1'
    fill_in(records, numbers, mm_per_unit)
    return records


def _starts(at: Wholes, end: Wholes, good: npt.NDArray[np.int8], length: int, final: bool) -> _Starts:
    """Link the starts, and say which are believed: three records in a row of which the first is good."""
    following = np.arange(1, len(at) + 1)
    apart = np.flatnonzero(np.append(at[1:], -1) != end)
    there = np.searchsorted(at, end[apart])
    stands = np.append(at, -1)[there] == end[apart]
    following[apart] = np.where(stands, there, -1)
    closed = (end == length) & final
    cut = (end + HEADER_BYTES > length) & (not final)
    second = np.where(closed, _YES, np.where(cut, _UNKNOWN, np.where(following >= 0, _YES, _NO)))
    third = np.where(closed | cut | (following < 0), second, second[following])
    return _Starts(at, end, following, np.minimum(good, third).astype(np.int8), closed, cut)


def _walk(starts: _Starts, good: Flags, length: int, final: bool, trusted: bool) -> tuple[Wholes, int, bool]:
    """Go from start to start; give those accepted, how many bytes are decided, if the next is believed."""
    at = starts.at
    linked = (starts.following >= 0) | starts.closed
    breaks = np.flatnonzero(starts.following != np.arange(1, len(at) + 1))
    believable = np.flatnonzero(starts.believed)
    runs, position = [np.empty(0, np.int64)], 0
    while position < length and (final or position + HEADER_BYTES <= length):
        index = int(np.searchsorted(at, position))
        if not trusted or index == len(at) or at[index] != position:
            trusted = False
            nth = int(np.searchsorted(believable, index))
            if nth == len(believable):
                position = length if final else max(position, length - HEADER_BYTES + 1)
                break
            position = int(at[believable[nth]])
            trusted = bool(starts.believed[believable[nth]] == _YES)
            if not trusted:
                break
            continue
        last = int(breaks[np.searchsorted(breaks, index)])
        runs.append(np.arange(index, last))
        position = int(at[last])
        verdict, following, trusted = _judge(starts, last, bool(linked[last]), bool(good[last]))
        if verdict is None:
            break
        if verdict:
            runs.append(np.array([last]))
        position = following
    return np.concatenate(runs), position, trusted


def _judge(starts: _Starts, index: int, linked: bool, good: bool) -> tuple[bool | None, int, bool]:
    """Say whether a believed start is a record, where to go on, and whether what starts there is believed.

    None instead of yes or no: more bytes are needed to say.
    """
    at, end = int(starts.at[index]), int(starts.end[index])
    if linked:
        return True, end, True
    if starts.cut[index]:
        return None, at, True
    inside = slice(index + 1, int(np.searchsorted(starts.at, end)))
    for number in np.flatnonzero(starts.believed[inside]) + index + 1:
        # The next record starts before this one's end: bytes of this one are missing.
        if starts.believed[number] == _UNKNOWN:
            return None, at, True
        return False, int(starts.at[number]), True
    return (True, end, False) if good else (False, at + 1, False)
