"""Raw captures written field by field, as a LIBERTY sends them, and decoding captures."""

import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from shukotsu.tracker.archive import ArchiveWriter, open_archive
from shukotsu.tracker.records import Records, StreamSettings, concatenate_records
from shukotsu.tracker.stream import Tally, blocks_of

ITEMS = (8, 9, 11, 3, 7)
RATE_HZ = 240.0

Pose = Callable[[int, int], tuple[Sequence[float], Sequence[float]]]


def settings(stations: Iterable[int] = (1, 2, 3)) -> StreamSettings:
    stations = tuple(stations)
    lists = dict.fromkeys(stations, ITEMS)
    hemispheres = dict.fromkeys(stations, (1.0, 0.0, 0.0))
    return StreamSettings("liberty", "binary", "cm", RATE_HZ, stations, lists, hemispheres)


def still(frame: int, station: int) -> tuple[Sequence[float], Sequence[float]]:
    """Return a pose that differs for each frame and station: position in cm and quaternion."""
    return (20 + station, 5 + 0.001 * frame, -3.0), (1.0, 0.0, 0.0, 0.0)


def cycle(frame: int, stations: Iterable[int] = (1, 2, 3), pose: Pose = still) -> bytes:
    """Return the records of a frame, written field by field as a LIBERTY sends them."""
    data = b""
    for station in stations:
        position, quaternion = pose(frame, station)
        body = struct.pack("<IIi7f", frame * 1000 // 240, frame, 0, *position, *quaternion)
        data += b"LY" + struct.pack("<BBBBh", station, ord("C"), 0, 0, len(body)) + body
    return data


def write(
    path: Path, cycles: Iterable[bytes], how: StreamSettings | None = None, *, ended: bool = True
) -> Path:
    """Write a capture whose i-th piece arrives with the i-th frame."""
    writer, at_ns = ArchiveWriter(path, {"note": "made up"}, lambda: 0), 0
    writer.sent(b"C\r", 0)
    writer.settings((how or settings()).to_json(), 0)
    for index, piece in enumerate(cycles):
        at_ns = round(index * 1e9 / RATE_HZ)
        writer.received(piece, at_ns)
        if index % 50 == 49:
            writer.flush()
    if ended:
        writer.close({"reason": "duration"}, at_ns)
    else:
        writer.flush()
    return path


def decoded(path: Path) -> tuple[Records, Tally, StreamSettings]:
    """Return the records of a capture, its other content, and the tracker's settings."""
    tally = Tally()
    blocks = list(blocks_of(open_archive(path), tally))
    return concatenate_records([block.records for block in blocks]), tally, blocks[0].settings
