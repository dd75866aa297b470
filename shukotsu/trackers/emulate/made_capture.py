"""A recording through the emulated device into a raw capture, as a recorder would have kept it.

Time is made up: the device's cycles at their exact period, pieces that arrive about every 10 ms,
cut anywhere. The same input gives the same bytes.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.trackers.archive import ArchiveWriter
from shukotsu.trackers.emulate.device import FOLLOWING, EmulatedLiberty
from shukotsu.trackers.emulate.pose_sources import Motion
from shukotsu.trackers.emulate.server import SECOND_NS, Emulator
from shukotsu.trackers.liberty.replies import FULL_LIST
from shukotsu.trackers.protocols.stream_settings import StreamSettings

BEGINNING_NS = SECOND_NS
"""The made-up clock's reading when the recorder opens the port."""

PIECE_NS, MOST_JITTER_NS = 10_000_000, 1_000_000
_COMMAND_NS = 20_000_000
_MOST_HELD_BACK_BYTES = 80
_TEXT_REPLY_HEADER_BYTES = 5
_GLOBAL_QUERIES = (b"U\r", b"R\r", b"X\r", b"Y\r", b"Z\r", b"\x150\r", b"\x14\r", b"\x05\r", b"@B\r")
_STATION_QUERIES = b"OHBANL"


def write_archive(device: EmulatedLiberty, out: Path, about: Mapping[str, Any]) -> None:
    """Record the device from the first to the last frame of its motion.

    Positions pass through float32 centimetres: they come back within 1e-4 mm up to 1 m from the transmitter.
    about : kept with the recording. The hemisphere is one that no receiver leaves, or following. Raises
    InputError where `out` exists.
    """
    arrived = bytearray()

    def write(data: bytes) -> int:
        arrived.extend(data)
        return len(data)

    emulator = Emulator(device, write, BEGINNING_NS)
    archive = ArchiveWriter(out, {"emulated": True, **about}, utc_offset_ns=lambda: 0)
    vector = home_hemisphere(device.motion)
    now_ns = BEGINNING_NS
    replies: dict[bytes, bytes] = {}
    for command in _handshake(device, vector):
        replies[command] = _exchange(emulator, archive, arrived, command, now_ns)
        now_ns += _COMMAND_NS
    settings = StreamSettings(
        device.family,
        "binary",
        "cm",
        float(device.rate),
        device.active(),
        dict.fromkeys(device.stations, FULL_LIST),
        dict.fromkeys(device.stations, vector),
        {
            "whoami": replies[b"\x16\r"][_TEXT_REPLY_HEADER_BYTES:].decode("latin-1").strip(),
            "position_filter": list(device.numbers[b"X", 0]),
            "attitude_filter": list(device.numbers[b"Y", 0]),
        },
    )
    archive.settings(settings.to_json(), now_ns)
    for command in (b"Q0\r", b"C\r"):
        _exchange(emulator, archive, arrived, command, now_ns)
    begun_ns = emulator.due_ns
    end_ns = begun_ns + len(device.motion.position_mm) * SECOND_NS // int(device.rate) - 1
    pieces = 0
    ticks_ns = [*range(begun_ns + PIECE_NS, end_ns, PIECE_NS), end_ns]
    for pieces, due_ns in enumerate(ticks_ns, 1):
        emulator.run(due_ns)
        draw = random.Random(pieces)
        now_ns = due_ns + draw.randrange(MOST_JITTER_NS)
        held_back = 0 if due_ns == end_ns else draw.randrange(_MOST_HELD_BACK_BYTES)
        count = len(arrived) - held_back  # the others come with the next piece
        if count > 0:
            archive.received(bytes(arrived[:count]), now_ns)
            del arrived[:count]
        if pieces % (SECOND_NS // PIECE_NS) == 0:
            archive.flush()
    _exchange(emulator, archive, arrived, b"P", now_ns)
    duration_s = (end_ns + 1 - begun_ns) / SECOND_NS
    archive.close({"reason": "duration", "duration_s": duration_s}, now_ns + _COMMAND_NS)


def home_hemisphere(motion: Motion) -> tuple[float, float, float]:
    """The axis on whose side all receivers stay, nearest to where they are; FOLLOWING where there is none."""
    positions = motion.position_mm.reshape(-1, 3)
    positions = positions[np.isfinite(positions).all(-1)]
    mean = positions.mean(0) if len(positions) else np.zeros(3)
    axis = int(np.argmax(np.abs(mean)))
    if not (positions[:, axis] * np.sign(mean[axis]) > 0).all():
        return FOLLOWING
    x, y, z = np.where(np.arange(3) == axis, np.sign(mean), 0.0).tolist()
    return (x, y, z)


def _handshake(device: EmulatedLiberty, hemisphere: Sequence[float]) -> Iterator[bytes]:
    """Commands of a recorder in turn, up to those that start the stream."""
    items = ",".join(map(str, FULL_LIST))
    vector = ",".join(f"{part:g}" for part in hemisphere)
    rate = f"R{device.numbers[b'R', 0][0]}\r".encode()
    yield from (b"P", b"\r", b"F0\r", b"\x16\r", b"F1\r", b"U1\r", rate, f"O*,{items}\r".encode())
    yield from (f"H*,{vector}\r".encode(), b"L*,0\r", b"Z1\r", b"X0,1,0,0\r", b"Y0,1,0,0\r")
    yield from _GLOBAL_QUERIES
    for letter in _STATION_QUERIES:
        for station in device.stations:
            yield bytes([letter]) + f"{station}\r".encode()


def _exchange(
    emulator: Emulator, archive: ArchiveWriter, arrived: bytearray, command: bytes, now_ns: int
) -> bytes:
    """Send a command and keep what is answered."""
    archive.sent(command, now_ns)
    emulator.receive(command, now_ns)
    reply = bytes(arrived)
    arrived.clear()
    if reply:
        archive.received(reply, now_ns + MOST_JITTER_NS)
    return reply
