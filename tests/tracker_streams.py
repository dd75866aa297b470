"""Byte streams of trackers, put together field by field as the manuals say, and how they are decoded."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.tracker.families import StreamSettings
from shukotsu.tracker.liberty_replies import TAGS
from shukotsu.tracker.records import Decoded, PiecewiseDecoder, Reply, concatenated

Numbers = tuple[float, ...]

_Lists = tuple[tuple[int, ...], ...]
_LIBERTY_BINARY: _Lists = ((8, 9, 11, 10, 12, 3, 7), (9, 2, 7))


def pose(frame: int, station: int) -> tuple[Numbers, Numbers]:
    """A position within 50 of the tracker's unit, and a unit quaternion; another one for each."""
    random = np.random.default_rng([frame, station])
    q = random.normal(size=4)
    return tuple(random.uniform(-50, 50, 3).tolist()), tuple((q / np.linalg.norm(q)).tolist())


def cosines(quaternion: Sequence[float]) -> Numbers:
    """The nine numbers of the rotation matrix, row by row."""
    w, x, y, z = quaternion
    return (
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def _floats(numbers: Sequence[float]) -> bytes:
    return struct.pack(f"<{len(numbers)}f", *numbers)


def liberty_binary(
    frame: int, station: int, items: Sequence[int], tag: bytes = b"LY", error: bytes = b"\0"
) -> bytes:
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
    return tag + struct.pack("<BB", station, ord("C")) + error + b"\0" + struct.pack("<h", len(body)) + body


def crc16(data: bytes) -> int:
    register = 0
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register


def viper_frame(frame: int, stations: Sequence[int], unit: int = 2, accelerated: bool = False) -> bytes:
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
    """The frame of a body, with its length and checksum."""
    frame = preamble + struct.pack("<I", len(body) + 4) + body
    return frame + struct.pack("<I", crc16(frame))


@dataclass(frozen=True)
class Stream:
    """A clean stream: how it is to be read, and its records (frames, for VIPER) in turn."""

    settings: StreamSettings
    pieces: tuple[bytes, ...]

    @property
    def data(self) -> bytes:
        """All of it."""
        return b"".join(self.pieces)


def settings(
    family: str, items: Sequence[int] = (), stations: Sequence[int] = (1, 2, 3, 4), unit: str = "cm"
) -> StreamSettings:
    """Settings with one output list for all stations."""
    lists: Mapping[int, tuple[int, ...]] = {station: tuple(items) for station in stations} if items else {}
    return StreamSettings(family, "binary", unit, 240.0, tuple(stations), lists)


def streams(frames: int = 5) -> dict[str, Stream]:
    """A clean stream of every family, in several output lists, of four stations."""
    four = (1, 2, 3, 4)
    order = [(frame, station) for frame in range(1, frames + 1) for station in four]
    clean = {
        f"{family} {items}": Stream(
            settings(family, items), tuple(liberty_binary(f, s, items, TAGS[family]) for f, s in order)
        )
        for family, lists in (("liberty", _LIBERTY_BINARY), ("patriot", ((2, 7),)))
        for items in lists
    }
    clean["viper"] = Stream(settings("viper"), tuple(viper_frame(f, four) for f in range(1, 3 * frames + 1)))
    return clean


MOST_FRAMING = 12
"""Bytes of a reply that are not its body, at the most: VIPER's leader and checksum."""


def decode(decoder: PiecewiseDecoder, data: bytes) -> Decoded:
    """Feed the stream to its end, cut in the middle; give all that came out."""
    half = len(data) // 2
    parts = [decoder.feed(data[:half]), decoder.feed(data[half:]), decoder.feed(b"", final=True)]
    return Decoded(
        concatenated([part.records for part in parts]),
        tuple(skip for part in parts for skip in part.skipped),
        tuple(reply for part in parts for reply in part.replies),
    )


def skipped_bytes(decoded: Decoded) -> list[int]:
    """Return the places of all skipped bytes."""
    return [i for skip in decoded.skipped for i in range(skip.offset, skip.offset + skip.size)]


def check_tiles(decoded: Decoded, length: int) -> None:
    """AssertionError unless every byte is in one record, reply or skip; a reply is its body and its frame."""
    stretches: list[tuple[int, int | Reply]] = [(skip.offset, skip.size) for skip in decoded.skipped]
    stretches += zip(decoded.records.offset.tolist(), decoded.records.size.tolist(), strict=True)
    stretches += [(reply.offset, reply) for reply in decoded.replies]
    stretches.sort(key=lambda stretch: stretch[0])
    place = 0
    ends = [*(first for first, _ in stretches), length][1:]
    for (first, size), following in zip(stretches, ends, strict=True):
        assert first == place, f"byte {place} is in nothing, or in two things"
        if isinstance(size, Reply):
            assert 0 <= following - first - len(size.body) <= MOST_FRAMING, f"reply at {first}"
            place = following
        else:
            assert size > 0, f"nothing at {first}"
            place += size
    assert place == length, f"ends at {place}, the stream at {length}"
