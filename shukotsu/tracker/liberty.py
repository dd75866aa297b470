"""Binary protocol of LIBERTY and PATRIOT: items, replies, and a decoder that resynchronises after damage.

Answers and records have the same header with a length; there is no checksum. A start is a byte at which a
plausible header begins. It is accepted if it directly follows a good record, if another start follows at its
end, or if its numbers are plausible, among them a unit quaternion. So garbage between records does no harm,
and a lost or changed byte costs only the record that contained it. Source: LIBERTY User Manual URM03PH156,
output list command ('O'), tables of output formats, commands and errors, reply framing (little-endian, 8-byte
header).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Bools, Integers
from shukotsu.errors import InputError
from shukotsu.tracker import records as protocol
from shukotsu.tracker.records import Bytes, Decoded, Records, Reply, StreamSettings

TAGS = {"liberty": b"LY", "patriot": b"PA"}
"""First two bytes of a binary record or reply."""
MAX_BODY_BYTES = 2800
"""The longest reply (a stored configuration) has 2384 bytes."""
STREAMED, SINGLE = ord("C"), ord("P")
"""Command byte of a record: while streaming, and in answer to a single poll."""
STATIONS = range(1, 17)
HEADER = (
    ("tag", "V2"), ("station", "u1"), ("command", "u1"), ("error", "u1"), ("reserved", "u1"), ("size", "<i2"),
)  # fmt: skip
HEADER_BYTES = np.dtype(list(HEADER)).itemsize

QUATERNION = 7
ITEMS: dict[int, tuple[tuple[str, ...], str]] = {
    0: (("blank",), "u1"),
    1: (("cr", "lf"), "u1"),
    2: (("x", "y", "z"), "f4"),
    3: (("x", "y", "z"), "f4"),
    4: (("azimuth", "elevation", "roll"), "f4"),
    5: (("azimuth", "elevation", "roll"), "f4"),
    QUATERNION: (("qw", "qx", "qy", "qz"), "f4"),
    8: (("device_ms",), "u4"),
    9: (("frame",), "u4"),
    10: (("button",), "i4"),
    11: (("distortion",), "i4"),
    12: (("sync",), "i4"),
}
"""Item -> names of its numbers, in order, and their NumPy type in binary."""
MOST_ITEMS = 20
DEFAULT_LIST = (2, 4, 1)
FULL_LIST = (8, 9, 11, 10, 12, 3, 7)
"""Output list that the recorder requests: both counters, distortion, stylus, sync, position and quaternion;
56 bytes."""
SHORT_LIST = (9, 2, 7)
"""Output list for slow lines: frame count, position and quaternion; 40 bytes."""

Value = int | tuple[int, ...] | tuple[float, ...]
HALVES = "<u2"

_ERRORS = (
    *("invalid command", "invalid station", "invalid parameter", "too few parameters"),
    *("too many parameters", "parameter below its limit", "parameter above its limit"),
    "no communication with the sensor processor board",
    *(f"sensor processor {number} did not start" for number in range(1, 5)),
    *("no sensor processor found", "source processor failed", "memory failed"),
    *("too many characters in a command", "not in this mode"),
    "source PROM cannot be read; defaults are used",
    *("read only", "a message, not an error", "map cannot be loaded", "sensors out of step"),
    *("firmware versions do not match", "firmware is outdated"),
)
ERRORS = dict(enumerate(_ERRORS, 1))
"""Error code of an answer -> its meaning."""


def record_type(items: Sequence[int]) -> np.dtype[np.void]:
    """Return the NumPy type of a complete binary record; repeated items get numbered field names."""
    fields, names = list(HEADER), {name for name, _ in HEADER}
    for index, item in enumerate(items):
        numbers, kind = ITEMS[item]
        for name in numbers:
            fields.append((f"{name}_{index}" if name in names else name, f"<{kind}"))
            names.add(name)
    return np.dtype(fields)


def list_of_all(lists: Mapping[int, Sequence[int]]) -> tuple[int, ...]:
    """Return the common output list of all stations; lists : station -> its list.

    Raises InputError if a station or item does not exist, or the lists differ.
    """
    for station, items in lists.items():
        if station not in STATIONS or not items or not ITEMS.keys() >= set(items):
            raise InputError(
                f"settings of the tracker: output list {list(items)} of station {station}; a LIBERTY "
                f"has stations 1 to {STATIONS[-1]} and items {', '.join(map(str, ITEMS))}; correct the lists"
            )
    several = {tuple(items) for items in lists.values()}
    if len(several) != 1:
        raise InputError(
            f"settings of the tracker: has {len(several)} output lists; expected one for all stations"
        )
    items = several.pop()
    if QUATERNION not in items or {2, 3}.isdisjoint(items):
        raise InputError(
            f"settings of the tracker: output list {list(items)} has no position (2, 3) or no quaternion (7)"
        )
    return items


@dataclass(frozen=True)
class Setting:
    """A setting that can be queried and, in most cases, set.

    command : its letter. kind : NumPy type of the answer's numbers; "<u2" for two bit masks of stations.
    count : number of these, 0 for any. per_station : whether each station has its own value.
    """

    command: bytes
    kind: str = "<i4"
    count: int = 1
    per_station: bool = False

    @property
    def _has_station(self) -> bool:
        return self.per_station or self.kind == HALVES

    def question(self, station: int = 0) -> bytes:
        """Return the bytes of a query; station 0 stands for all stations of bit masks."""
        return self.command + (str(station).encode() if self._has_station else b"") + b"\r"

    def assignment(self, value: float | Sequence[float], station: int | None = None) -> bytes:
        """Return the bytes that set it, for one station or, with None, for all."""
        numbers = [value] if isinstance(value, int | float) else value
        words = [f"{number:g}" for number in numbers]
        if self._has_station:
            words.insert(0, "*" if station is None else str(station))
        return self.command + ",".join(words).encode() + b"\r"


def binary_answers(data: bytes, tags: Iterable[bytes] = tuple(TAGS.values())) -> list[Reply]:
    """Return everything that is framed as an answer or record, including frames inside others."""
    replies = []
    for tag in re.finditer(b"|".join(tags), data):
        at = tag.start()
        if at + HEADER_BYTES <= len(data):
            station, command, error, reserved, size = struct.unpack_from("<4Bh", data, at + 2)
            body = data[at + HEADER_BYTES : at + HEADER_BYTES + max(size, 0)]
            if reserved == 0 and 0 <= size <= MAX_BODY_BYTES and len(body) == size:
                replies.append(Reply(at, station, command, 0 if error == 0x20 else error, body))
    return replies


def answers(reply: Reply, setting: Setting, station: int) -> bool:
    """Return whether a reply states the setting of the station, 0 if the setting is not per station."""
    expected = station if setting.per_station else 0
    return reply.command == setting.command[0] and reply.station == expected


def binary_value(setting: Setting, reply: Reply) -> Value | None:
    """Return the value in a binary answer, or None if its length does not fit the setting."""
    size = np.dtype(setting.kind).itemsize
    if not reply.body or len(reply.body) % size or setting.count not in (0, len(reply.body) // size):
        return None
    numbers = tuple(np.frombuffer(reply.body, setting.kind).tolist())
    if setting.count == 1:
        value: int = numbers[0]
        return value
    return numbers[: numbers.index(-1)] if -1 in numbers and not setting.count else numbers


def stations_of(bits: int) -> tuple[int, ...]:
    """Return the stations whose bits are set; the lowest bit is station 1."""
    return tuple(station for station in STATIONS if bits & 1 << (station - 1))


_IS_RECORD = np.isin(np.arange(256), [STREAMED, SINGLE])
_IS_LETTER = np.isin(np.arange(256), list(b"\x00 abcdefgABCDEFGIu"))
"""Error letters of pose records: none, source failure by axis, BIT errors, outside the mapped area."""
NO, UNKNOWN, YES = 0, 1, 2
"""Whether a start is accepted; UNKNOWN if more bytes are needed to decide."""
_MOST = {"frame": None, "device_ms": None, "button": 1, "distortion": 2, "sync": 1}
"""Other numbers of a record than its pose, and their largest valid values."""


class BinaryDecoder(protocol.PiecewiseDecoder):
    """Decoder of a LIBERTY or PATRIOT stream in binary; answers to commands count as skipped bytes.

    Raises InputError for invalid output lists.
    """

    def __init__(self, settings: StreamSettings) -> None:
        super().__init__()
        self._kind = record_type(list_of_all(settings.items))
        self._mm_per_unit = protocol.MM_PER_UNIT[settings.unit]
        self._tag = TAGS[settings.family]
        self._is_station = np.isin(np.arange(256), list(settings.items))
        self._trusted = False  # whether the kept bytes begin right after a good record

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        at, size = self._starts(b), self._kind.itemsize

        def are_good(indices: Integers) -> Bools:
            """Return for each start whether its record is complete and its numbers are possible, (M,)."""
            good = at[indices] + size <= len(b)
            good[good] = ~self._records(b, at[indices[good]]).doubtful
            return good

        walk = _Walk(at, size, len(b), final, are_good)
        others = np.flatnonzero(walk.believed == NO)
        walk.believed[others[are_good(others)]] = YES
        walk.trusted = self._trusted
        accepted = walk.accepted()
        self._trusted = walk.trusted
        first = at[accepted]
        skipped = protocol.gaps(first, first + size, walk.position)
        return Decoded(self._records(b, first), skipped), walk.position

    def _starts(self, b: Bytes) -> Integers:
        """Return the positions of plausible record headers, ascending."""
        heads = b[: max(0, len(b) - HEADER_BYTES + 1)]
        tagged = (heads == self._tag[0]) & (b[1 : len(heads) + 1] == self._tag[1])
        at = np.flatnonzero(tagged).astype(np.int64)
        station, command, error, reserved = (b[at + index] for index in (2, 3, 4, 5))
        body_bytes = b[at + 6].astype(np.int64) | b[at + 7].astype(np.int64) << 8
        possible = self._is_station[station] & _IS_RECORD[command] & _IS_LETTER[error] & (reserved == 0)
        return np.asarray(at[possible & (HEADER_BYTES + body_bytes == self._kind.itemsize)])

    def _records(self, b: Bytes, at: Integers) -> Records:
        """Read the records at these positions; impossible ones are marked as doubtful."""
        records = protocol.empty_records(len(at))
        if not len(at):
            return records
        rows = protocol.rows_at(b, at, self._kind.itemsize).view(self._kind)[:, 0]
        records.offset[:] = at
        records.size[:] = self._kind.itemsize
        records.station[:] = rows["station"]
        records.error[:] = np.where(rows["error"] == ord(" "), 0, rows["error"])
        with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs, and floats beyond any tracker
            for column, axis in enumerate("xyz"):
                np.multiply(rows[axis], self._mm_per_unit, out=records.position_mm[:, column], dtype=float)
            records.quaternion[:] = np.stack([rows[f"q{part}"] for part in "wxyz"], -1, dtype=float)
            records.doubtful[:] = protocol.doubtful_poses(records)
        for name, most in _MOST.items():
            if name in (self._kind.names or ()):
                values = getattr(records, name)
                values[:] = rows[name]
                records.doubtful[:] |= False if most is None else (values < 0) | (values > most)
        return records


class _Walk:
    """A pass over a piece of a stream that selects the record starts to accept.

    at : (N,) possible starts of records of `size` bytes. length : length of the piece. final : whether
    nothing follows it. are_good : returns whether records are complete and their numbers possible. believed :
    (N,) NO, UNKNOWN or YES, whether a start is accepted even if it does not follow a good record. position :
    everything before it is decided. trusted : whether a record that starts at `position` is accepted.

    Starts that the piece is too short to decide are left for the next one, so that the result does not depend
    on where the stream is cut.
    """

    def __init__(
        self, at: Integers, size: int, length: int, final: bool, are_good: Callable[[Integers], Bools]
    ) -> None:
        self.position, self.trusted = 0, False
        self._at, self._end, self._length, self._final = at, at + size, length, final
        self._are_good = are_good
        index = np.searchsorted(at, self._end)
        # index of the start at each record's end, or -1
        self._following = np.where(np.append(at, -1)[index] == self._end, index, -1)
        self._linked = (self._following >= 0) | ((self._end == length) & final)
        self._cut = (self._end + HEADER_BYTES > length) & (not final)
        self.believed = np.where(self._linked, YES, np.where(self._cut, UNKNOWN, NO))

    def accepted(self) -> Integers:
        """Return the indices of the accepted starts, ascending."""
        runs = [np.empty(0, np.int64)]
        believable = np.flatnonzero(self.believed)
        breaks = np.flatnonzero(self._following != np.arange(1, len(self._at) + 1))
        # With less than a header left, nothing can be decided yet.
        shortest = 1 if self._final else HEADER_BYTES
        while self.position + shortest <= self._length:
            index = int(np.searchsorted(self._at, self.position))
            if self.trusted and index < len(self._at) and self._at[index] == self.position:
                last = int(breaks[np.searchsorted(breaks, index)])
                self.position = int(self._at[last])
                is_record, goes_on = self._judge(last)
                runs.append(np.arange(index, last + is_record))
            else:
                goes_on = self._search(believable[np.searchsorted(believable, index) :])
            if not goes_on:
                break
        return np.concatenate(runs)

    def _judge(self, index: int) -> tuple[bool, bool]:
        """Decide whether a trusted start is a record although no start follows directly; return whether, and
        whether the pass can continue.
        """
        at, end = int(self._at[index]), int(self._end[index])
        if self._linked[index]:
            self.position = end
            return True, True
        if self._cut[index]:
            return False, False
        inside = self.believed[index + 1 : int(np.searchsorted(self._at, end))]
        within = np.flatnonzero(inside) + index + 1
        if len(within):  # the next record starts before this one's end: bytes of this one are missing
            if self.believed[within[0]] == UNKNOWN:
                return False, False
            self.position = int(self._at[within[0]])
            return False, True
        # It is either complete and followed by garbage or a damaged header, or not a record.
        is_record = bool(self._are_good(np.array([index]))[0])
        self.position, self.trusted = end if is_record else at + 1, False
        return is_record, True

    def _search(self, believable: Integers) -> bool:
        """Move to the next acceptable start; return whether it is accepted or needs more bytes (False)."""
        self.trusted = False
        if not len(believable):
            rest = 0 if self._final else HEADER_BYTES - 1  # these bytes may begin a header
            self.position = max(self.position, self._length - rest)
            return False
        self.position = int(self._at[believable[0]])
        self.trusted = bool(self.believed[believable[0]] == YES)
        return self.trusted
