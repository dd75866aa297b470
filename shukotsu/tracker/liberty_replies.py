"""Items, records and replies of LIBERTY and PATRIOT in binary.

An answer has the same header as a record and a length. Source: LIBERTY User Manual URM03PH156, output list
command ('O'), tables of output formats, reply framing, tables of commands and of errors.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.errors import InputError
from shukotsu.tracker.records import Reply

TAGS = {"liberty": b"LY", "patriot": b"PA"}
"""First two bytes of a binary record or reply."""
MAX_BODY_BYTES = 2800
"""The longest reply (a stored configuration) has 2384 bytes; a longer one is none."""
STREAMED, SINGLE = ord("C"), ord("P")
"""The command byte of a record: while streaming, and in answer to a single poll."""
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
"""Item -> what its numbers are, in turn, and their NumPy letter in binary."""
MOST_ITEMS = 20
DEFAULT_LIST = (2, 4, 1)
FULL_LIST = (8, 9, 11, 10, 12, 3, 7)
"""What a recorder asks for: both counters, distortion, stylus, sync, position and quaternion; 56 bytes."""
SHORT_LIST = (9, 2, 7)
"""Frame count, position and quaternion: 40 bytes, for a line that cannot carry more."""

Value = int | tuple[int, ...] | tuple[float, ...]
HALVES = "<u2"

ERRORS = dict(
    enumerate(
        (
            *("invalid command", "invalid station", "invalid parameter", "too few parameters"),
            *("too many parameters", "parameter below its limit", "parameter above its limit"),
            "no communication with the sensor processor board",
            *(f"sensor processor {number} did not start" for number in range(1, 5)),
            *("no sensor processor found", "source processor failed", "memory failed"),
            *("too many characters in a command", "not in this mode"),
            "source PROM cannot be read; defaults are used",
            *("read only", "a message, not an error", "map cannot be loaded", "sensors out of step"),
            *("firmware versions do not match", "firmware is outdated"),
        ),
        1,
    )
)
"""Error code of an answer -> what it means."""


def record_type(items: Sequence[int]) -> np.dtype[np.void]:
    """Return the NumPy type of a whole binary record; an item that is given twice keeps its first numbers."""
    fields, names = list(HEADER), {name for name, _ in HEADER}
    for index, item in enumerate(items):
        numbers, kind = ITEMS[item]
        for name in numbers:
            fields.append((f"{name}_{index}" if name in names else name, f"<{kind}"))
            names.add(name)
    return np.dtype(fields)


def list_of_all(lists: Mapping[int, Sequence[int]]) -> tuple[int, ...]:
    """Return the output list that all stations have; lists : station -> its list.

    Raises InputError where there is no such station or item, or the lists differ.
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
    """A setting that can be asked for, and most of them set.

    command : its letter. kind : of an answer's numbers, as NumPy names it; "<u2" for two halves of bits.
    count : how many there are, 0 for any. per_station : asked and set for each station.
    """

    command: bytes
    kind: str = "<i4"
    count: int = 1
    per_station: bool = False

    @property
    def _has_station(self) -> bool:
        return self.per_station or self.kind == HALVES

    def question(self, station: int = 0) -> bytes:
        """Return the bytes that ask for it; of halves, 0 asks for all stations."""
        return self.command + (str(station).encode() if self._has_station else b"") + b"\r"

    def assignment(self, value: float | Sequence[float], station: int | None = None) -> bytes:
        """Return the bytes that set it, of one station or (None) of all where it is a station's."""
        numbers = [value] if isinstance(value, int | float) else value
        words = [f"{number:g}" for number in numbers]
        if self._has_station:
            words.insert(0, "*" if station is None else str(station))
        return self.command + ",".join(words).encode() + b"\r"


def binary_answers(data: bytes, tags: Iterable[bytes] = tuple(TAGS.values())) -> list[Reply]:
    """Return all that is framed as an answer or record, also inside others."""
    replies = []
    for tag in tags:
        at = data.find(tag)
        while at >= 0:
            if at + HEADER_BYTES <= len(data):
                station, command, error, reserved, size = struct.unpack_from("<4Bh", data, at + 2)
                body = data[at + HEADER_BYTES : at + HEADER_BYTES + max(size, 0)]
                if reserved == 0 and 0 <= size <= MAX_BODY_BYTES and len(body) == size:
                    replies.append(Reply(at, station, command, 0 if error == 0x20 else error, body))
            at = data.find(tag, at + 1)
    return sorted(replies, key=lambda reply: reply.offset)


def answers(reply: Reply, setting: Setting, station: int) -> bool:
    """Whether a reply tells that setting, of that station (0: of none)."""
    expected = station if setting.per_station else 0
    return reply.command == setting.command[0] and reply.station == expected


def binary_value(setting: Setting, reply: Reply) -> Value | None:
    """Read a binary answer; None where its length cannot be that of one."""
    size = np.dtype(setting.kind).itemsize
    if not reply.body or len(reply.body) % size or setting.count not in (0, len(reply.body) // size):
        return None
    numbers = tuple(np.frombuffer(reply.body, setting.kind).tolist())
    if setting.count == 1:
        value: int = numbers[0]
        return value
    return numbers[: numbers.index(-1)] if -1 in numbers and not setting.count else numbers


def stations_of(bits: int) -> tuple[int, ...]:
    """Return stations whose bits are set, the lowest of station 1."""
    return tuple(station for station in STATIONS if bits & 1 << (station - 1))
