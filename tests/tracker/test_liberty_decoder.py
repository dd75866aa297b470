"""LIBERTY in binary: what is cut off, put in or changed costs what it must; answers among records."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from tracker_streams import decode, liberty_binary, pose, skipped_bytes

from shukotsu.errors import InputError
from shukotsu.tracker.families import StreamSettings
from shukotsu.tracker.liberty_decoder import BinaryDecoder
from shukotsu.tracker.liberty_replies import list_of_all
from shukotsu.tracker.records import Records

FULL = (8, 9, 11, 10, 12, 3, 7)


def settings(items=FULL, family: str = "liberty", unit: str = "cm") -> StreamSettings:
    lists = dict.fromkeys(range(1, 17), tuple(items))
    return StreamSettings(family, "binary", unit, 240.0, tuple(lists), lists)


def record(frame: int, station: int, items=FULL, **how: bytes) -> bytes:
    return liberty_binary(frame, station, items, **how)


def stream(frames: int = 6, stations=range(1, 5), **how) -> list[bytes]:
    return [record(frame, station, **how) for frame in range(frames) for station in stations]


def read(data: bytes, how: StreamSettings | None = None) -> tuple[Records, list[int]]:
    decoded = decode(BinaryDecoder(how or settings()), data)
    return decoded.records, skipped_bytes(decoded)


@pytest.mark.parametrize("items", [FULL, (9, 2, 7), (2, 7, 8, 0), (8, 9, 11, 3, 7), (9, 2, 7, 1)])
@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("inch", 25.4)])
def test_every_number_comes_out(items, unit: str, mm: float) -> None:
    data = b"".join(stream(items=items))
    records, skipped = read(data, how=settings(items, unit=unit))
    assert len(records) == 24
    assert not skipped
    for row, (frame, station) in enumerate((f, s) for f in range(6) for s in range(1, 5)):
        position, quaternion = pose(frame, station)
        sent = np.array(position, np.float32).astype(float)
        assert records.position_mm[row].tolist() == (sent * mm).tolist()
        assert records.quaternion[row].tolist() == np.array(quaternion, np.float32).astype(float).tolist()
        assert records.station[row] == station
        assert records.frame[row] == (frame if 9 in items else -1)
        assert records.device_ms[row] == (frame * 1000 // 240 if 8 in items else -1)
        assert records.distortion[row] == (2 if 11 in items else -1)
        assert records.button[row] == (1 if 10 in items else -1)
        assert records.sync[row] == (0 if 12 in items else -1)
    assert not records.doubtful.any()
    assert not records.error.any()


def test_a_tag_in_the_numbers_does_not_mislead() -> None:
    position = struct.unpack("<f", b"LY\x01C")[0]
    body = struct.pack("<I3f4f", 7, position, position, position, 1, 0, 0, 0)
    head = b"LY\x01C\0\0" + struct.pack("<h", len(body))
    records, skipped = read((head + body) * 5, how=settings((9, 2, 7)))
    assert len(records) == 5
    assert not skipped


def test_numbers_that_cannot_be_right_are_doubted() -> None:
    good = record(1, 1, items=(9, 2, 7))
    far = good[:12] + struct.pack("<f", 400.0) + good[16:]
    nan = good[:12] + struct.pack("<f", float("nan")) + good[16:]
    long = good[:24] + struct.pack("<4f", 1, 0.2, 0, 0) + good[40:]
    records, _ = read(b"".join([good, far, nan, long, good]), how=settings((9, 2, 7)))
    assert records.doubtful.tolist() == [False, True, True, True, False]


@pytest.mark.parametrize("lists", [{1: (2, 13)}, {17: (2,)}, {1: ()}])
def test_lists_that_a_tracker_does_not_take(lists) -> None:
    with pytest.raises(InputError, match=r"output list .* of station .*; a LIBERTY has stations 1 to"):
        list_of_all(lists)
