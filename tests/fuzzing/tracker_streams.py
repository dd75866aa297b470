"""Byte streams of trackers, put together field by field as the manuals say: for tests and the fuzzer."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from shukotsu.trackers.protocols.stream_settings import StreamSettings

Numbers = tuple[float, ...]

_Lists = tuple[tuple[int, ...], ...]
_LIBERTY_BINARY: _Lists = ((8, 9, 11, 10, 12, 3, 7), (9, 2, 7), (2, 4, 1), (2, 6))
_LIBERTY_ASCII: _Lists = (
    *((2, 4, 1), (2, 7, 1), (2, 6), (9, 2, 7), (3, 5, 1)),
    (8, 0, 9, 0, 11, 0, 10, 0, 12, 0, 3, 7, 1),
)
_FASTRAK: _Lists = ((2, 4, 1), (2, 11, 0), (2, 5, 6, 7, 1), (2, 11, 16, 1), (52, 61, 1))


def pose(frame: int, station: int) -> tuple[Numbers, Numbers]:
    """A position within 50 of the tracker's unit, and a unit quaternion; another one for each."""
    random = np.random.default_rng([frame, station])
    q = random.normal(size=4)
    return tuple(random.uniform(-50, 50, 3).tolist()), tuple((q / np.linalg.norm(q)).tolist())


def angles_deg(quaternion: Sequence[float]) -> Numbers:
    """Azimuth, elevation and roll of a quaternion."""
    w, x, y, z = quaternion
    azimuth = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
    elevation = np.arcsin(np.clip(2 * (w * y - x * z), -1, 1))
    roll = np.arctan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    return tuple(np.degrees([azimuth, elevation, roll]).tolist())


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


def _text(form: str, numbers: Sequence[float]) -> bytes:
    return "".join(form.format(number) for number in numbers).encode()


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
        4: _floats(angles_deg(quaternion)),
        5: _floats(angles_deg(quaternion)),
        6: _floats(cosines(quaternion)),
        7: _floats(quaternion),
        8: struct.pack("<I", frame * 1000 // 240 % 2**32),
        9: struct.pack("<I", frame % 2**32),
        10: struct.pack("<i", 1),
        11: struct.pack("<i", 2),
        12: struct.pack("<i", 0),
    }
    body = b"".join(written[item] for item in items)
    return tag + struct.pack("<BB", station, ord("C")) + error + b"\0" + struct.pack("<h", len(body)) + body


def liberty_text(frame: int, station: int, items: Sequence[int], middle: bytes = b"  ") -> bytes:
    """A record of LIBERTY or PATRIOT in ASCII; `middle` stands between the station and the items."""
    position, quaternion = pose(frame, station)
    rows = [cosines(quaternion)[first : first + 3] for first in (0, 3, 6)]
    written = {
        0: b" ",
        1: b"\r\n",
        2: _text("{:8.3f} ", position),
        3: _text("{: .6E} ", position),
        4: _text("{:8.3f} ", angles_deg(quaternion)),
        5: _text("{: .6E} ", angles_deg(quaternion)),
        6: b"".join(_text("{: .5f} ", row) + b"\r\n" for row in rows),
        7: _text("{: .5f} ", quaternion),
        8: b"%d" % (frame * 1000 // 240 % 2**32),
        9: b"%d" % (frame % 2**32),
        10: b"1",
        11: b"2",
        12: b"0",
    }
    return b"%02d" % station + middle + b"".join(written[item] for item in items)


def _of_fastrak(frame: int, station: int, items: Sequence[int]) -> list[tuple[int, Numbers]]:
    position, quaternion = pose(frame, station)
    matrix = cosines(quaternion)
    numbers = {2: position, 3: (0.0, 0.0, 0.0), 4: angles_deg(quaternion), 11: quaternion}
    numbers |= {5: matrix[:3], 6: matrix[3:6], 7: matrix[6:]}
    return [(item, numbers.get(item % 50 if item > 50 else item, ())) for item in items]


def fastrak_binary(frame: int, station: int, items: Sequence[int], status: bytes = b" ") -> bytes:
    """A record of FASTRAK in binary."""
    fixed = {0: b" ", 1: b"\r\n", 16: b" 1"}
    parts = [fixed.get(item, _floats(numbers)) for item, numbers in _of_fastrak(frame, station, items)]
    return b"0%d" % station + status + b"".join(parts)


def fastrak_text(frame: int, station: int, items: Sequence[int], status: bytes = b" ") -> bytes:
    """A record of FASTRAK in ASCII."""
    forms = dict.fromkeys((2, 3, 4), "{:7.2f}") | dict.fromkeys((5, 6, 7, 11), "{:7.4f}")
    fixed = {0: b" ", 1: b"\r\n", 16: b" 1"}
    parts = [
        fixed[item] if item in fixed else _text(forms.get(item, "{: .6E} "), numbers)
        for item, numbers in _of_fastrak(frame, station, items)
    ]
    return b"0%d" % station + status + b"".join(parts)


def crc16(data: bytes) -> int:
    """CRC-16/ARC, bit by bit."""
    register = 0
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register


def viper_frame(
    frame: int,
    stations: Sequence[int],
    unit: int = 2,
    accelerated: bool = False,
) -> bytes:
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


def flock_record(frame: int, station: int, group: bool) -> bytes:
    """A record of Flock of Birds with a range of 36 inches; positions of `pose` in centimetres."""
    position, (w, x, y, z) = pose(frame, station)
    out = bytearray()
    for number in (*(10 * p / 914.4 for p in position), w, -x, -y, -z):
        word = int(np.clip(round(number * 8192), -8192, 8191)) & 0x3FFF
        out += bytes([word & 0x7F, word >> 7])
    out[0] |= 0x80
    return bytes(out) + (bytes([station]) if group else b"")


def lsl_frame(kind: int, body: bytes) -> bytes:
    """What the recorder keeps of an LSL stream."""
    word = struct.pack("<I", kind << 24 | len(body))
    head = b"LS" + struct.pack("<H", zlib.crc32(word) % 65536) + word
    return head + struct.pack("<I", zlib.crc32(body)) + body


def crc64(data: bytes) -> int:
    """CRC-64 of ECMA-182 from 0, bit by bit."""
    register = 0
    for byte in data:
        register ^= byte << 56
        for _ in range(8):
            register = register << 1 & (1 << 64) - 1 ^ (0x42F0E1EBA9EA3693 if register >> 63 else 0)
    return register


def igtl_message(
    kind: bytes, name: bytes, content: bytes, stamp_s: float = 0, told: Mapping[str, str] | None = None
) -> bytes:
    """A message of OpenIGTLink; of version 2 where metadata are told."""
    body = content
    if told is not None:
        index = struct.pack(">H", len(told))
        index += b"".join(struct.pack(">HHI", len(key), 3, len(value)) for key, value in told.items())
        values = "".join(key + value for key, value in told.items()).encode()
        body = struct.pack(">HHII", 12, len(index), len(values), 7) + content + index + values
    stamp = (int(stamp_s), int(stamp_s % 1 * 2**32))
    version = 1 if told is None else 2
    return struct.pack(">H12s20sIIQQ", version, kind, name, *stamp, len(body), crc64(body)) + body


def igtl_numbers(kind: bytes, frame: int, station: int) -> bytes:
    """The numbers of a pose as that kind of message has them."""
    position, (w, *axis) = pose(frame, station)
    if kind in (b"TRANSFORM", b"TDATA"):
        nine = cosines((w, *axis))
        return struct.pack(">12f", *nine[0::3], *nine[1::3], *nine[2::3], *position)
    return struct.pack(">7f", *position, *axis, w)


def igtl_frame(kind: bytes, frame: int, stations: Sequence[int], stamped: bool = True) -> list[bytes]:
    """The messages of a frame, of tools `Tool 1` and so on; of TRANSFORM in version 2."""
    stamp_s = 1_700_000_000 + frame / 240 if stamped else 0
    bodies = [igtl_numbers(kind, frame, station) for station in stations]
    names = [b"Tool %d" % station for station in stations]
    if kind in (b"TDATA", b"QTDATA"):
        tools = zip(names, bodies, strict=True)
        content = b"".join(struct.pack("20sBB", name, 1, 0) + body for name, body in tools)
        return [igtl_message(kind, b"Tracker", content, stamp_s)]
    told = {"TransformStatus": "OK"} if kind == b"TRANSFORM" else None
    each = zip(names, bodies, strict=True)
    return [igtl_message(kind, name, body, stamp_s, told) for name, body in each]


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
    family: str,
    mode: str = "binary",
    items: Sequence[int] = (),
    stations: Sequence[int] = (1, 2, 3, 4),
    unit: str = "cm",
    **options: Any,
) -> StreamSettings:
    """Settings with one output list for all stations."""
    lists: Mapping[int, tuple[int, ...]] = {station: tuple(items) for station in stations} if items else {}
    return StreamSettings(family, mode, unit, 240.0, tuple(stations), lists, {}, options)


def streams(frames: int = 5) -> dict[str, Stream]:
    """A clean stream of every family and mode, in several output lists, of four stations."""
    four = (1, 2, 3, 4)
    order = [(frame, station) for frame in range(1, frames + 1) for station in four]
    by_items: list[tuple[str, str, Callable[..., bytes], _Lists]] = [
        ("liberty", "binary", liberty_binary, _LIBERTY_BINARY),
        ("patriot", "binary", partial(liberty_binary, tag=b"PA"), ((2, 7),)),
        ("liberty", "ascii", liberty_text, _LIBERTY_ASCII),
        ("fastrak", "binary", fastrak_binary, _FASTRAK),
        ("fastrak", "ascii", fastrak_text, _FASTRAK),
    ]
    clean = {
        f"{family} {mode} {items}": Stream(
            settings(family, mode, items), tuple(record(f, s, items) for f, s in order)
        )
        for family, mode, record, lists in by_items
        for items in lists
    }
    clean["viper"] = Stream(settings("viper"), tuple(viper_frame(f, four) for f in range(1, 3 * frames + 1)))
    names = {str(station): f"Tool {station}" for station in four}
    for kind in (b"TRANSFORM", b"POSITION", b"TDATA", b"QTDATA"):
        stamped = kind != b"POSITION"
        numbers = range(1, 1 + (3 if kind.endswith(b"TDATA") else 1) * frames)
        messages = [message for f in numbers for message in igtl_frame(kind, f, four, stamped)]
        how = settings("openigtlink", unit="mm", names=names, stamps=stamped, steady=True)
        clean[f"openigtlink {kind.decode()}"] = Stream(how, tuple(messages))
    for group in (False, True):
        pieces = tuple(flock_record(f, s, group) for f, s in order)
        clean[f"trakstar{' group' if group else ''}"] = Stream(settings("trakstar", group=group), pieces)
    frames_of = []
    for frame in range(1, 3 * frames + 1):
        numbers = [number for s in four for part in pose(frame, s) for number in part]
        head = struct.pack("<Id", frame, frame / 240)
        frames_of.append(lsl_frame(2, head + _floats(numbers)))
    offset = lsl_frame(3, struct.pack("<dd", 0.0, 1.0))
    channels = {str(s): list(range(7 * s - 7, 7 * s)) for s in four}
    how = {"format": "float32", "channel_count": 28, "channels": channels, "stamps": True, "steady": True}
    clean["lsl"] = Stream(settings("lsl", **how), (offset + frames_of[0], *frames_of[1:]))
    return clean
