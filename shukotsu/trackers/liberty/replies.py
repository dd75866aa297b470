"""Answers of LIBERTY and PATRIOT to questions: picked out of whatever else came, and read.

An answer has the same header as a record and a length. Source: LIBERTY User Manual URM03PH156, reply framing,
tables of commands and of errors.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from shukotsu.trackers.liberty.items import HEADER_BYTES, MAX_BODY_BYTES, STATIONS, TAGS
from shukotsu.trackers.protocols.records import Reply

Value = int | tuple[int, ...] | tuple[float, ...]

ERRORS = {
    1: "invalid command",
    2: "invalid station",
    3: "invalid parameter",
    4: "too few parameters",
    5: "too many parameters",
    6: "parameter below its limit",
    7: "parameter above its limit",
    8: "no communication with the sensor processor board",
    9: "sensor processor 1 did not start",
    10: "sensor processor 2 did not start",
    11: "sensor processor 3 did not start",
    12: "sensor processor 4 did not start",
    13: "no sensor processor found",
    14: "source processor failed",
    15: "memory failed",
    16: "too many characters in a command",
    17: "not in this mode",
    18: "source PROM cannot be read; defaults are used",
    19: "read only",
    20: "a message, not an error",
    21: "map cannot be loaded",
    22: "sensors out of step",
    23: "firmware versions do not match",
    24: "firmware is outdated",
}
"""Error code of an answer -> what it means."""


@dataclass(frozen=True)
class Setting:
    """A setting that can be asked for, and most of them set.

    command : its letter. kind : of the answer, "number", "numbers" (a list of whole ones), "floats", "words"
    or "stations" (two halves of bits). count : how many floats. per_station : asked and set for each station.
    """

    command: bytes
    kind: str
    count: int = 1
    per_station: bool = False

    def question(self, station: int = 0) -> bytes:
        """The bytes that ask for it; of `stations`, 0 asks for all."""
        asks_station = self.per_station or self.kind == "stations"
        return self.command + (str(station).encode() if asks_station else b"") + b"\r"

    def assignment(self, value: float | Sequence[float], station: int | None = None) -> bytes:
        """The bytes that set it, of one station or (None) of all where it is a station's."""
        numbers = [value] if isinstance(value, int | float) else value
        words = [f"{number:g}" for number in numbers]
        if self.per_station or self.kind == "stations":
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
    size = len(reply.body)
    if size % 4 or not size:
        return None
    if setting.kind == "number":
        return int(struct.unpack_from("<i", reply.body)[0])
    if setting.kind == "numbers":
        items = struct.unpack(f"<{size // 4}i", reply.body)
        return items[: items.index(-1)] if -1 in items else items
    if setting.kind == "floats":
        whole = size == 4 * setting.count
        return struct.unpack(f"<{setting.count}f", reply.body) if whole else None
    if setting.kind == "words":
        return struct.unpack(f"<{size // 4}I", reply.body)
    return struct.unpack("<HH", reply.body) if size == 4 else None


def usable_stations(halves: tuple[int, ...]) -> tuple[int, ...]:
    """Stations that are connected and switched on.

    The manual does not leave it beyond doubt which half says which, and only what is in both can send.
    """
    return _stations(halves[0] & halves[1])


def half_stations(halves: tuple[int, ...]) -> tuple[int, ...]:
    """Stations that are connected and switched off, or switched on and not connected."""
    return _stations(halves[0] ^ halves[1])


def _stations(bits: int) -> tuple[int, ...]:
    return tuple(station for station in STATIONS if bits & 1 << (station - 1))
