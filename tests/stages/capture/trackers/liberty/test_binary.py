"""LIBERTY in binary: whatever is cut off, put in or changed costs what it must and no more."""

import struct
from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.capture.trackers.liberty.binary import BinaryDecoder
from stages.capture.trackers.records import Records, concatenated
from stages.capture.trackers.settings import StreamSettings

FULL = (8, 9, 11, 10, 12, 3, 7)


def settings(items=FULL, stations=range(1, 17), family: str = "liberty", unit: str = "cm") -> StreamSettings:
    return StreamSettings(
        family, "binary", unit, 240.0, tuple(stations), {station: tuple(items) for station in range(1, 17)}
    )


def pose(frame: int, station: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    random = np.random.default_rng([frame, station])
    q = random.normal(size=4)
    return tuple(random.uniform(-50, 50, 3)), tuple(q / np.linalg.norm(q))


def record(frame: int, station: int, items=FULL, tag: bytes = b"LY", error: bytes = b"\0") -> bytes:
    """The record as the manual's tables say, put together field by field."""
    position, quaternion = pose(frame, station)
    written = {
        0: b" ",
        1: b"\r\n",
        2: struct.pack("<3f", *position),
        3: struct.pack("<3f", *position),
        7: struct.pack("<4f", *quaternion),
        8: struct.pack("<I", frame * 1000 // 240 % 2**32),
        9: struct.pack("<I", frame % 2**32),
        10: struct.pack("<i", 1),
        11: struct.pack("<i", 2),
        12: struct.pack("<i", 0),
    }
    body = b"".join(written[item] for item in items)
    return tag + struct.pack("<BB", station, ord("C")) + error + b"\0" + struct.pack("<h", len(body)) + body


def stream(frames: int = 6, stations=range(1, 5), **how) -> list[bytes]:
    return [record(frame, station, **how) for frame in range(frames) for station in stations]


def decode(data: bytes, cuts=(), given: StreamSettings | None = None):
    """Decode a stream that comes in pieces; gives the records, the skipped bytes and the replies."""
    decoder = BinaryDecoder(given or settings())
    edges = [0, *sorted(cuts), len(data)]
    decoded = [decoder.feed(data[a:b]) for a, b in pairwise(edges)]
    decoded.append(decoder.feed(b"", final=True))
    records = concatenated([part.records for part in decoded])
    skips = [skip for part in decoded for skip in part.skipped]
    skipped = [byte for skip in skips for byte in range(skip.offset, skip.offset + skip.size)]
    replies = [reply for part in decoded for reply in part.replies]
    return records, skipped, replies


def names(records: Records) -> list[tuple[int, int]]:
    return list(zip(records.frame.tolist(), records.station.tolist(), strict=True))


@pytest.mark.parametrize("items", [FULL, (9, 2, 7), (2, 7, 8, 0), (8, 9, 11, 3, 7), (9, 2, 7, 1)])
@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("inch", 25.4)])
def test_every_number_comes_out(items, unit: str, mm: float) -> None:
    data = b"".join(stream(items=items))
    records, skipped, replies = decode(data, given=settings(items, unit=unit))
    assert len(records) == 24
    assert not skipped
    assert not replies
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


def test_patriot_and_single_polls_and_error_letters() -> None:
    polled = record(1, 1, tag=b"PA").replace(b"PA\x01C", b"PA\x01P")
    failed = record(1, 2, tag=b"PA", error=b"b")
    blank = record(2, 1, tag=b"PA", error=b" ")
    records, skipped, _ = decode(polled + failed + blank, given=settings(family="patriot"))
    assert names(records) == [(1, 1), (1, 2), (2, 1)]
    assert records.error.tolist() == [0, ord("b"), 0]
    assert not skipped


def test_each_station_has_its_own_list() -> None:
    lists = {1: (9, 2, 7), 2: FULL, 3: (2, 9)}
    data = b"".join(record(f, s, items=lists[s]) for f in range(4) for s in lists)
    own = StreamSettings("liberty", "binary", "cm", 240.0, (1, 2, 3), lists)
    records, skipped, _ = decode(data, given=own)
    assert names(records) == [(f, s) for f in range(4) for s in (1, 2, 3)]
    assert np.isnan(records.quaternion[records.station == 3]).all()
    assert not records.doubtful.any()
    assert not skipped


def test_replies_stand_apart() -> None:
    reply = b"LY\0U\0\0" + struct.pack("<h", 4) + struct.pack("<i", 1)
    error = b"LY\0O\x03\0" + struct.pack("<h", 19) + b"Invalid Parameter\r\n"
    data = b"".join([*stream(2), reply, error, *stream(2)])
    records, skipped, replies = decode(data)
    assert len(records) == 16
    assert not skipped
    assert [(r.command, r.error, r.body) for r in replies] == [
        (ord("U"), 0, b"\1\0\0\0"),
        (ord("O"), 3, b"Invalid Parameter\r\n"),
    ]


@given(cuts=st.lists(st.integers(0, 24 * 64), max_size=12), damage=st.data())
def test_the_outcome_does_not_depend_on_where_the_stream_is_cut(cuts: list[int], damage) -> None:
    data = bytearray(b"".join(stream()))
    for place in damage.draw(st.lists(st.integers(0, len(data) - 9), max_size=6)):
        data[place : place + damage.draw(st.integers(0, 9))] = damage.draw(st.binary(max_size=9))
    whole, apart = decode(bytes(data)), decode(bytes(data), [min(cut, len(data)) for cut in cuts])
    for part in fields(Records):
        np.testing.assert_array_equal(getattr(whole[0], part.name), getattr(apart[0], part.name))
    assert whole[1:] == apart[1:]


@given(damage=st.data())
def test_every_byte_is_in_a_record_a_reply_or_skipped(damage) -> None:
    data = bytearray(b"".join(stream()))
    for place in damage.draw(st.lists(st.integers(0, len(data) - 9), max_size=6)):
        data[place : place + damage.draw(st.integers(0, 9))] = damage.draw(st.binary(max_size=9))
    records, skipped, replies = decode(bytes(data))
    covered = list(skipped)
    for offset, size in zip(records.offset, records.size, strict=True):
        covered += range(offset, offset + size)
    for reply in replies:
        covered += range(reply.offset, reply.offset + 8 + len(reply.body))
    assert sorted(covered) == list(range(len(data)))


@pytest.mark.parametrize("kind", ["dropped", "flipped", "put in", "twice"])
def test_a_damaged_byte_costs_one_record(kind: str) -> None:
    pieces = stream(5)
    whole = b"".join(pieces)
    size = len(pieces[0])
    for place in range(8 * size, 12 * size):
        before, byte, after = whole[:place], whole[place : place + 1], whole[place + 1 :]
        flipped = bytes([byte[0] ^ 0x15])
        data = {
            "dropped": before + after,
            "flipped": before + flipped + after,
            "put in": before + b"\x4c" + byte + after,
            "twice": before + byte + byte + after,
        }[kind]
        records, skipped, _ = decode(data)
        good = {
            (f, s)
            for (f, s), p, q, bad in zip(
                names(records), records.position_mm, records.quaternion, records.doubtful, strict=True
            )
            if not bad
            and np.allclose(p, 10 * np.array(pose(f, s)[0]), atol=1e-4)
            and np.allclose(q, pose(f, s)[1], atol=1e-6)
        }
        expected = {(f, s) for f in range(5) for s in range(1, 5)}
        assert len(expected - good) <= 1, place
        assert len(records) + (len(skipped) > 0) >= len(expected), place


def test_garbage_between_records_costs_nothing() -> None:
    pieces = stream()
    random = np.random.default_rng(5)
    data = b"".join(random.bytes(int(random.integers(1, 40))) + piece for piece in pieces)
    records, skipped, _ = decode(data)
    assert len(records) == len(pieces)
    assert len(skipped) == len(data) - sum(map(len, pieces))


def test_a_tag_in_the_numbers_does_not_mislead() -> None:
    position = struct.unpack("<f", b"LY\x01C")[0]
    body = struct.pack("<I3f4f", 7, position, position, position, 1, 0, 0, 0)
    head = b"LY\x01C\0\0" + struct.pack("<h", len(body))
    records, skipped, _ = decode((head + body) * 5, given=settings((9, 2, 7)))
    assert len(records) == 5
    assert not skipped


def test_numbers_that_cannot_be_right_are_doubted() -> None:
    good = record(1, 1, items=(9, 2, 7))
    far = good[:12] + struct.pack("<f", 400.0) + good[16:]
    nan = good[:12] + struct.pack("<f", float("nan")) + good[16:]
    long = good[:24] + struct.pack("<4f", 1, 0.2, 0, 0) + good[40:]
    records, _, _ = decode(b"".join([good, far, nan, long, good]), given=settings((9, 2, 7)))
    assert records.doubtful.tolist() == [False, True, True, True, False]


def test_what_is_kept_for_later_stays_small() -> None:
    decoder = BinaryDecoder(settings())
    random = np.random.default_rng(1)
    for _ in range(200):
        decoder.feed(random.bytes(4096) + b"LY\x01C\0\0\x30\0")
        assert len(decoder._rest) < 6000
