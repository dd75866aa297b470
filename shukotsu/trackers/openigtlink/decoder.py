"""OpenIGTLink: every message of poses whose CRC is right, wherever it stands; others are passed over.

No length is waited for but that of a message of poses, which is bounded; so no wrong or hostile length costs
more than what it names, and a body of megabytes is never held.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shukotsu.errors import on_one_line
from shukotsu.trackers.openigtlink.messages import BODY_BYTES, HEADER, HEADER_BYTES, TOOL_BYTES, crc64
from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder, disjoint, gaps, rows_at
from shukotsu.trackers.protocols.pose_numbers import fill_in
from shukotsu.trackers.protocols.records import Bytes, Decoded, Records, Skipped, Wholes, empty_records
from shukotsu.trackers.protocols.stream_settings import StreamSettings

LARGEST_STATION = 255
LARGEST_BODY = LARGEST_STATION * TOOL_BYTES[b"TDATA"] + 4096
LARGEST_OTHER = 1 << 30
SAME_FRAME = 0.75
"""Stamps of tools that differ by more of a period are not of one frame."""

_NUMBERS = [f"cosine_{row}{column}" for column in "xyz" for row in "xyz"] + ["x", "y", "z"]
_POSE = ["x", "y", "z", "qx", "qy", "qz", "qw"]
_EXTENDED, _ENTRY = struct.Struct(">HHII"), struct.Struct(">HHI")
_NAME_BYTES, _TO_NUMBERS = 20, 22
_LETTERS = np.isin(np.arange(256), [0, *b"ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"])

Tool = tuple[str, int, int, bool]
"""A tool's name, first byte and length of its numbers, and whether it was seen."""


class MessageDecoder(PiecewiseDecoder):
    """Decoder of TRANSFORM, POSITION, TDATA and QTDATA.

    Of settings.options: `names`: stations that are known; a tool with another name gets the lowest number
    that is free. `stamps`: whether headers have times that can be used. `joined`: whether the stream begins
    in the midst, so that what stands before its first whole frame says nothing.

    A frame ends where a tool of it comes again, where the stamp is another one by SAME_FRAME of a period, and
    with every TDATA or QTDATA; a tool that comes again by another kind of message with the same stamp says
    nothing new.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        self.names = settings.names
        self._station_of = {name: station for station, name in self.names.items()}
        self._stamped, self._joined = (bool(settings.options.get(key)) for key in ("stamps", "joined"))
        self._near_ns = SAME_FRAME * 1e9 / settings.rate_hz
        self._first_cycle = int(self._joined)
        self._cycle, self._stamp_ns = -1, 0
        self._seen: dict[int, bytes] = {}  # stations of the newest frame, and the kind of their message
        self._passing_to = 0  # end in the stream of a message that is passed over

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        at, end, header, is_pose = _possible_headers(b)
        others = np.stack([at, end], -1)[~is_pose]
        at, end, header = at[is_pose], end[is_pose], header[is_pose]
        good, waiting = _sound(b, at, end, header["crc"]), (end > len(b)) & (not final)
        kept = disjoint(at, end, good, waiting)
        decided = len(b) if final else _first_unknown(b, int(end[kept][~waiting[kept]].max(initial=0)))
        if waiting[kept].any():
            decided, kept = int(at[kept[-1]]), kept[:-1]
        records, unused = self._records(b, at[kept], end[kept], header[kept])
        known = np.zeros(decided, bool)
        for start, stop in [*others.tolist(), *unused, (0, max(0, self._passing_to - self._offset))]:
            known[start:stop] = True
        if self._joined:
            known[: records.offset[0] if len(records) else decided] = True
            self._joined = not len(records)
        whole = others[:, 1][others[:, 0] < decided].max(initial=0)
        self._passing_to = max(self._passing_to, self._offset + int(whole))
        parts: dict[bool, list[Skipped]] = {True: [], False: []}
        for gap in gaps(records.offset, records.offset + records.size, decided):
            inside = known[gap.offset : gap.offset + gap.size]
            edges = [0, *(np.flatnonzero(np.diff(inside)) + 1).tolist(), gap.size]
            for start, stop in pairwise(edges):
                parts[bool(inside[start])].append(Skipped(gap.offset + start, stop - start))
        return Decoded(records, tuple(parts[False]), (), tuple(parts[True])), decided

    def _records(
        self, b: Bytes, at: Wholes, end: Wholes, header: npt.NDArray[np.void]
    ) -> tuple[Records, list[tuple[int, int]]]:
        """Read messages of poses; also gives first byte and end of those of which nothing is used."""
        rows: list[tuple[int, ...]] = []
        unused: list[tuple[int, int]] = []
        data = b.tobytes()
        seconds, fraction = header["seconds"].astype(np.int64), header["fraction"].astype(np.int64)
        stamps_ns = seconds * 1_000_000_000 + (fraction * 1_000_000_000 >> 32)
        each = (at, end, header["version"], header["kind"], header["name"], stamps_ns)
        for first, last, version, kind, name, stamp_ns in zip(*(a.tolist() for a in each), strict=True):
            try:
                tools = _tools(data, first + HEADER_BYTES, last, version, kind, name)
            except (struct.error, ValueError):  # its lengths contradict each other: it is skipped
                continue
            used = self._in_frame(tools, kind, stamp_ns)
            if not used:
                unused.append((first, last))
            edges = [first, *(place + size for _, place, size in used[:-1]), last]
            for (station, place, size), (start, stop) in zip(used, pairwise(edges), strict=False):
                rows.append((start, stop - start, station, self._cycle, stamp_ns, place, size))
        table = np.array(rows, np.int64).reshape(-1, 7).T
        records = empty_records(len(rows))
        records.offset[:], records.size[:], records.station[:], records.cycle[:] = table[:4]
        if self._stamped:
            records.stamp_ns[:] = table[4]
        _fill_in(records, b, table[5], table[6])
        return records, unused

    def _in_frame(self, tools: list[Tool], kind: bytes, stamp_ns: int) -> list[tuple[int, int, int]]:
        """Put a message's tools into the newest frame or a new one; gives the poses that count.

        Each is its station, and the first byte and length of its numbers.
        """
        stations = [self._station(name) for name, *_ in tools]
        again = [self._seen[station] for station in stations if station in self._seen]
        if self._stamped and stamp_ns == self._stamp_ns:
            is_new = kind in again
        else:
            far = self._stamped and abs(stamp_ns - self._stamp_ns) > self._near_ns
            is_new = bool(again) or kind in TOOL_BYTES or far
        if is_new or self._cycle < 0:
            self._cycle, self._stamp_ns, self._seen = self._cycle + 1, stamp_ns, {}
        used = []
        for station, (_, place, size, is_seen) in zip(stations, tools, strict=True):
            if station and station not in self._seen:
                self._seen[station] = kind
                used += [(station, place, size)] * (is_seen and self._cycle >= self._first_cycle)
        return used

    def _station(self, name: str) -> int:
        """Give a tool's station, the lowest free number where it has none; 0 where all are taken."""
        station = self._station_of.get(name)
        if station is None:
            free = next((n for n in range(1, LARGEST_STATION + 1) if n not in self.names), 0)
            shown = on_one_line(name)  # it comes to a terminal
            station = self._station_of.get(shown, free)
            if station:
                self.names[station] = shown
                self._station_of[name] = self._station_of[shown] = station
        return station


def _possible_headers(b: Bytes) -> tuple[Wholes, Wholes, npt.NDArray[np.void], npt.NDArray[np.bool_]]:
    """Find whole headers that can be ones: first byte, the message's end, header, whether it is of poses."""
    last = max(0, len(b) - HEADER_BYTES + 1)
    at = np.flatnonzero((b[:last] == 0) & (b[1 : last + 1] - 1 < 3) & (b[2 : last + 2] >= ord("A")))
    rows = np.ascontiguousarray(b[at[:, None] + np.arange(HEADER_BYTES)])
    header = rows.view(HEADER)[:, 0]
    is_pose = np.isin(header["kind"], [*BODY_BYTES, *TOOL_BYTES])
    possible = _LETTERS[rows[:, 2:14]].all(1)
    possible &= header["size"] <= np.where(is_pose, LARGEST_BODY, LARGEST_OTHER)
    at, header, is_pose = at[possible], header[possible], is_pose[possible]
    return at, at + HEADER_BYTES + header["size"].astype(np.int64), header, is_pose


def _first_unknown(b: Bytes, after: int) -> int:
    """Find the first place, from byte `after` on, where a header may begin that the end of `b` cuts off."""
    first = max(after, len(b) - HEADER_BYTES + 1)
    return first + int(np.argmax(np.append(b[first:], 0) == 0))


def _sound(b: Bytes, at: Wholes, end: Wholes, crc: npt.NDArray[np.uint64]) -> npt.NDArray[np.bool_]:
    """Say which messages are there as a whole with the right CRC."""
    good = np.zeros(len(at), bool)
    digits = np.frexp(end - at - HEADER_BYTES)[1]
    for same in np.unique(digits):  # lengths that differ little at a time
        mine = np.flatnonzero((end <= len(b)) & (digits == same))
        good[mine] = crc64(b, at[mine] + HEADER_BYTES, end[mine]) == crc[mine]
    return good


def _tools(data: bytes, first: int, last: int, version: int, kind: bytes, name: bytes) -> list[Tool]:
    """Take a body apart. Raises ValueError or struct.error where its lengths contradict each other."""
    metadata: Mapping[str, str] = {}
    if version > 1:
        first, last, metadata = _extended(data, first, last)
    if kind in BODY_BYTES:
        if last - first not in BODY_BYTES[kind]:
            raise ValueError
        is_valid = metadata.get("TransformValid", "true").lower() not in ("false", "0")
        seen = is_valid and metadata.get("TransformStatus", "OK") == "OK"
        return [(metadata.get("IGTL_DEVICE_NAME") or _text(name), first, last - first, seen)]
    size = TOOL_BYTES[kind]
    if (last - first) % size:
        raise ValueError
    tools = []
    for place in range(first, last, size):
        own = _text(data[place : place + _NAME_BYTES])
        if len(own) == _NAME_BYTES:  # perhaps it is cut
            own = next((key[:-6] for key in metadata if key.startswith(own) and key.endswith("Status")), own)
        seen = metadata.get(f"{own}Status", "OK") == "OK"
        tools.append((own, place + _TO_NUMBERS, size - _TO_NUMBERS, seen))
    return tools


def _text(name: bytes) -> str:
    return name.split(b"\0")[0].decode("utf-8", "replace")


def _extended(data: bytes, first: int, last: int) -> tuple[int, int, dict[str, str]]:
    """Give where the content of a body of version 2 begins and ends, and its metadata."""
    header_bytes, index_bytes, metadata_bytes, _ = _EXTENDED.unpack_from(data, first)
    content, index = first + header_bytes, last - index_bytes - metadata_bytes
    if header_bytes < _EXTENDED.size or index < content:
        raise ValueError
    metadata = {}
    count = int.from_bytes(data[index : index + 2]) if index_bytes else 0
    place = index + index_bytes
    if 2 + count * _ENTRY.size > max(index_bytes, 2):
        raise ValueError
    for number in range(count):
        key_bytes, _, value_bytes = _ENTRY.unpack_from(data, index + 2 + number * _ENTRY.size)
        key, value = (
            data[place : place + key_bytes],
            data[place + key_bytes : place + key_bytes + value_bytes],
        )
        metadata[key.decode("utf-8", "replace")] = value.decode("utf-8", "replace")
        place += key_bytes + value_bytes
    return content, index, metadata


def _fill_in(records: Records, b: Bytes, place: Wholes, size: Wholes) -> None:
    """Read the numbers of the poses, whose length says what they are."""
    for length in np.unique(size).tolist():
        mine = np.flatnonzero(size == length)
        with np.errstate(invalid="ignore", divide="ignore"):
            numbers = np.ascontiguousarray(rows_at(b, place[mine], length)).view(">f4").T.astype(float)
            if length == 24:  # without w, which is not negative
                numbers = np.vstack([numbers, np.sqrt(np.maximum(0, 1 - (numbers[3:] ** 2).sum(0)))])
            if len(numbers) == len(_POSE):
                numbers[3:] /= np.linalg.norm(numbers[3:], axis=0)
        own = records.take(mine)
        fill_in(own, dict(zip(_NUMBERS if length == 48 else _POSE, numbers, strict=False)), 1.0)
        for name in ("position_mm", "quaternion", "doubtful"):
            getattr(records, name)[mine] = getattr(own, name)
