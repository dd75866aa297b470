"""The emulated FASTRAK without any port: cases of letters, records, its status and its errors."""

import struct

import numpy as np
import pytest

from shukotsu.trackers.emulate.device import World
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.fastrak.binary_decoder import BinaryDecoder
from shukotsu.trackers.fastrak.emulated_device import EmulatedFastrak
from shukotsu.trackers.fastrak.text_decoder import TextDecoder
from shukotsu.trackers.protocols.stream_settings import StreamSettings


def device(*stations: int, **world: object) -> EmulatedFastrak:
    return EmulatedFastrak(World(built_in_motion(), frozenset(stations), **world))  # type: ignore[arg-type]


def cycles(tracker: EmulatedFastrak, count: int) -> list[bytes]:
    return [tracker.next_cycle().data for _ in range(count)]


def test_receivers_take_turns() -> None:
    """120 records a second together; a round of all receivers is one step of the motion."""
    tracker = device(1, 2, 4)
    assert tracker.rate == 120
    tracker.receive(b"fuO1,2\rO2,2\rO4,2\rC")
    records = cycles(tracker, 9)
    assert [record[1:2] for record in records] == [b"1", b"2", b"4"] * 3
    position, _ = built_in_motion().poses(np.arange(3), [1, 2, 4])
    sent = np.array([struct.unpack_from("<3f", record, 3) for record in records]).reshape(3, 3, 3)
    assert sent == pytest.approx(position / 10, rel=1e-6)
    tracker.receive(b"l2,0\r")
    assert {record[1:2] for record in cycles(tracker, 4)} == {b"1", b"4"}
    assert {record[1:2] for record in (tracker.receive(b"P")[:3], tracker.receive(b"P")[15:18])} == {
        b"1",
        b"4",
    }


@pytest.mark.parametrize(
    ("typed", "code"),
    [
        (b"O9,2\r", -3),
        (b"O\r", -1),
        (b"Ox\r", -2),
        (b"O1,99\r", -3),
        (b"H1,a\r", -2),
        (b"qq\r", -99),
        (b"e1,7\r", -3),
    ],
)
def test_errors_are_told(typed: bytes, code: int) -> None:
    reply = device(1).receive(typed)
    assert reply == b"2 E*ERROR*%s*ERROR* EC %d*PS 0*FL 0*ST 0\r\n" % (typed.strip(), code)


@pytest.mark.parametrize(
    ("binary", "items"),
    [(True, (2, 11, 16, 0)), (True, (2, 4, 1)), (False, (52, 61, 1)), (False, (2, 11, 16, 1))],
)
def test_decoders_read_what_is_sent(binary: bool, items: tuple[int, ...]) -> None:
    """Every record is found, with positions as fine as the format prints them."""
    tracker = device(1, 2, 3, 4)
    chosen = ",".join(map(str, items))
    tracker.receive(b"".join(b"O%d,%s\re%d,0\r" % (s, chosen.encode(), s) for s in range(1, 5)))
    tracker.receive((b"f" if binary else b"F") + b"uC")
    lists = dict.fromkeys(range(1, 5), items)
    mode = "binary" if binary else "ascii"
    decoder = (BinaryDecoder if binary else TextDecoder)(
        StreamSettings("fastrak", mode, "cm", 30.0, (1, 2, 3, 4), lists)
    )
    got = decoder.feed(b"".join(cycles(tracker, 400)), final=True)
    assert not got.skipped
    assert len(got.records) == 400
    position, _ = built_in_motion().poses(np.arange(100), [1, 2, 3, 4])
    coarse_mm = 0.051 if 2 in items and not binary else 1e-4
    assert np.abs(got.records.position_mm - position.reshape(-1, 3)).max() < coarse_mm
