"""Decoding along: the same records as from the archive, each with its arrival."""

from itertools import pairwise

import numpy as np

from stages.capture.record.following import Follower
from stages.capture.record.reader import Chunk
from stages.capture.trackers.settings import StreamSettings

ITEMS = (9, 2, 7)


def record(frame: int, station: int) -> bytes:
    numbers = np.array([10, 20, 30, 1, 0, 0, 0], "<f4").tobytes()
    return b"LY" + bytes([station, ord("C"), 0, 0, 32, 0]) + frame.to_bytes(4, "little") + numbers


def settings() -> StreamSettings:
    return StreamSettings("liberty", "binary", "cm", 240.0, (1, 2), {1: ITEMS, 2: ITEMS})


def test_records_have_the_time_at_which_their_last_byte_came() -> None:
    """A record that is cut by two chunks, and by two looks, came with the second."""
    data = b"".join(record(frame, station) for frame in range(4) for station in (1, 2))
    cuts = [0, 40, 100, 101, 290, 320]
    chunks = [Chunk(data[a:b], 1000 * n) for n, (a, b) in enumerate(pairwise(cuts))]
    follower = Follower(settings())
    looks = [follower.look(chunks[:2]), follower.look(chunks[2:]), follower.look([], final=True)]
    host_ns = np.concatenate([look.host_ns for look in looks])
    assert host_ns.tolist() == [0, 1000, 3000, 3000, 3000, 3000, 3000, 4000]
    assert np.concatenate([look.records.frame for look in looks]).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


def test_a_counter_that_wraps_goes_on() -> None:
    data = b"".join(record(frame % 2**32, 1) for frame in range(2**32 - 3, 2**32 + 3))
    look = Follower(settings()).look([Chunk(data, 1)], final=True)
    assert np.diff(look.records.frame).tolist() == [1] * 5


def test_skipped_bytes_are_counted() -> None:
    data = record(1, 1) + b"garbage" + record(2, 1) + record(3, 1)
    look = Follower(settings()).look([Chunk(data, 1)], final=True)
    assert (len(look.records), look.skipped_bytes) == (3, 7)
