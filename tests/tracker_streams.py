"""Byte streams of trackers, written field by field as in the manuals, and decoding them."""

import struct
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from shukotsu.tracker.records import Decoded, PiecewiseDecoder, StreamSettings, concatenate_records

Numbers = tuple[float, ...]


def pose(frame: int, station: int) -> tuple[Numbers, Numbers]:
    """Return a random position within 50 units and a unit quaternion, fixed for each frame and station."""
    random = np.random.default_rng([frame, station])
    q = random.normal(size=4)
    return tuple(random.uniform(-50, 50, 3).tolist()), tuple((q / np.linalg.norm(q)).tolist())


def _floats(numbers: Sequence[float]) -> bytes:
    return struct.pack(f"<{len(numbers)}f", *numbers)


def liberty_binary(frame: int, station: int, items: Sequence[int], tag: bytes = b"LY") -> bytes:
    """Return a binary record of a LIBERTY or PATRIOT."""
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
    """Return a VIPER's frame of poses; unit : 0 inch, 1 foot, 2 cm, 3 m."""
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
    """Return a VIPER's answer to a command."""
    return viper_closed(b"VPRC", struct.pack("<5I", 7, command, action, 2**32 - 1, 0) + payload)


def viper_closed(preamble: bytes, body: bytes) -> bytes:
    """Return a body framed with preamble, length and checksum (CRC-16/ARC)."""
    frame, register = preamble + struct.pack("<I", len(body) + 4) + body, 0
    for byte in frame:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return frame + struct.pack("<I", register)


def settings(
    family: str, items: Sequence[int] = (), stations: Sequence[int] = (1, 2, 3, 4), unit: str = "cm"
) -> StreamSettings:
    """Return settings with one output list for all stations."""
    lists: Mapping[int, tuple[int, ...]] = {station: tuple(items) for station in stations} if items else {}
    return StreamSettings(family, "binary", unit, 240.0, tuple(stations), lists)


MOST_FRAMING = 12
"""Largest number of bytes of a reply besides its body: VIPER's preamble, length and checksum."""


def decode(decoder: PiecewiseDecoder, data: bytes) -> Decoded:
    """Decode a stream in two pieces and return all results.

    Checks that every byte belongs to exactly one record, reply or skipped part; a reply includes its frame.
    """
    half = len(data) // 2
    parts = [decoder.feed(data[:half]), decoder.feed(data[half:]), decoder.feed(b"", final=True)]
    decoded = Decoded(
        concatenate_records([part.records for part in parts]),
        tuple(skip for part in parts for skip in part.skipped),
        tuple(reply for part in parts for reply in part.replies),
    )
    stretches = [(skip.offset, skip.size, 0) for skip in decoded.skipped]
    offsets, sizes = decoded.records.offset.tolist(), decoded.records.size.tolist()
    stretches += [(offset, size, 0) for offset, size in zip(offsets, sizes, strict=True)]
    stretches += [(reply.offset, len(reply.body), MOST_FRAMING) for reply in decoded.replies]
    stretches.sort()
    starts = [offset for offset, _, _ in stretches]
    assert starts[0] == 0
    for (offset, size, framing), end in zip(stretches, [*starts[1:], len(data)], strict=True):
        assert 0 < size <= end - offset <= size + framing, f"byte {offset}: a gap, overlap or empty part"
    return decoded
