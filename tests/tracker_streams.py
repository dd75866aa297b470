"""Byte streams of trackers, put together field by field as the manuals say, and how they are decoded."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from shukotsu.tracker.records import Decoded, PiecewiseDecoder, Reply, StreamSettings, concatenate_records

Numbers = tuple[float, ...]


def pose(frame: int, station: int) -> tuple[Numbers, Numbers]:
    """A position within 50 of the tracker's unit, and a unit quaternion; another one for each."""
    random = np.random.default_rng([frame, station])
    q = random.normal(size=4)
    return tuple(random.uniform(-50, 50, 3).tolist()), tuple((q / np.linalg.norm(q)).tolist())


def _floats(numbers: Sequence[float]) -> bytes:
    return struct.pack(f"<{len(numbers)}f", *numbers)


def liberty_binary(frame: int, station: int, items: Sequence[int], tag: bytes = b"LY") -> bytes:
    """A record of LIBERTY or PATRIOT in binary."""
    position, quaternion = pose(frame, station)
    written = {
        0: b" ",
        1: b"\r\n",
        2: _floats(position),
        3: _floats(position),
        7: _floats(quaternion),
        8: struct.pack("<I", frame * 1000 // 240 % 2**32),
        9: struct.pack("<I", frame % 2**32),
        10: struct.pack("<i", 1),
        11: struct.pack("<i", 2),
        12: struct.pack("<i", 0),
    }
    body = b"".join(written[item] for item in items)
    return tag + struct.pack("<BB", station, ord("C")) + b"\0\0" + struct.pack("<h", len(body)) + body


@cache
def viper_frame(frame: int, stations: tuple[int, ...], unit: int = 2, accelerated: bool = False) -> bytes:
    """A frame of poses of VIPER; unit 0 inch, 1 foot, 2 cm, 3 m."""
    body = struct.pack("<4I", 7, frame, int(accelerated), len(stations))
    for station in stations:
        position, quaternion = pose(frame, station)
        info = station - 1 | unit << 8 | 2 << 10 | 1 << 12 | 37 << 14
        if accelerated:
            sent = struct.pack("<8h", *(round(number * 32768) for number in quaternion), 1, 2, 3, 4)
        else:
            sent = _floats(quaternion)
        body += struct.pack("<I", info) + _floats(position) + sent
    return viper_closed(b"VPRP", body)


def viper_reply(command: int, payload: bytes, action: int = 3) -> bytes:
    """The answer of VIPER to a command."""
    return viper_closed(b"VPRC", struct.pack("<5I", 7, command, action, 2**32 - 1, 0) + payload)


def viper_closed(preamble: bytes, body: bytes) -> bytes:
    """The frame of a body, with its length and checksum (CRC-16/ARC)."""
    frame, register = preamble + struct.pack("<I", len(body) + 4) + body, 0
    for byte in frame:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return frame + struct.pack("<I", register)


def settings(
    family: str, items: Sequence[int] = (), stations: Sequence[int] = (1, 2, 3, 4), unit: str = "cm"
) -> StreamSettings:
    """Settings with one output list for all stations."""
    lists: Mapping[int, tuple[int, ...]] = {station: tuple(items) for station in stations} if items else {}
    return StreamSettings(family, "binary", unit, 240.0, tuple(stations), lists)


MOST_FRAMING = 12
"""Bytes of a reply that are not its body, at the most: VIPER's leader and checksum."""


def decode(decoder: PiecewiseDecoder, data: bytes) -> Decoded:
    """Feed the stream to its end, cut in the middle; return all that came out.

    AssertionError unless every byte is in one record, reply or skip; a reply is its body and its frame.
    """
    half = len(data) // 2
    parts = [decoder.feed(data[:half]), decoder.feed(data[half:]), decoder.feed(b"", final=True)]
    decoded = Decoded(
        concatenate_records([part.records for part in parts]),
        tuple(skip for part in parts for skip in part.skipped),
        tuple(reply for part in parts for reply in part.replies),
    )
    stretches: list[tuple[int, int | Reply]] = [(skip.offset, skip.size) for skip in decoded.skipped]
    stretches += zip(decoded.records.offset.tolist(), decoded.records.size.tolist(), strict=True)
    stretches += [(reply.offset, reply) for reply in decoded.replies]
    stretches.sort(key=lambda stretch: stretch[0])
    offset = 0
    ends = [*(first for first, _ in stretches), len(data)][1:]
    for (first, size), following in zip(stretches, ends, strict=True):
        assert first == offset, f"byte {offset} is in nothing, or in two things"
        if isinstance(size, Reply):
            assert 0 <= following - first - len(size.body) <= MOST_FRAMING, f"reply at {first}"
            offset = following
        else:
            assert size > 0, f"nothing at {first}"
            offset += size
    assert offset == len(data)
    return decoded
