"""What the summary counts of a receiver that comes and goes; losses are counted in test_losses."""

from collections.abc import Iterable

import numpy as np
import pytest

from shukotsu.tracker.decode.stream import Block
from shukotsu.tracker.protocols.records import empty_records
from shukotsu.tracker.protocols.stream_settings import StreamSettings
from shukotsu.tracker.record.statistics import Statistics

RATE_HZ = 240.0
START_NS = 5_000_000_000


def settings(stations: Iterable[int] = (1, 2), hemisphere=(1.0, 0.0, 0.0)) -> StreamSettings:
    each = tuple(stations)
    return StreamSettings("liberty", "binary", "cm", RATE_HZ, each, {}, dict.fromkeys(each, hemisphere))


def block(pairs: list[tuple[int, int]], *, position_mm=(300.0, 0.0, 0.0), **columns) -> Block:
    """Records of (frame, station), which came when their frame was measured."""
    records = empty_records(len(pairs))
    records.frame[:] = [frame for frame, _ in pairs]
    records.station[:] = [station for _, station in pairs]
    records.position_mm[:] = position_mm
    for name, value in columns.items():
        getattr(records, name)[:] = value
    host_ns = START_NS + (records.frame * 1e9 / RATE_HZ).astype(np.int64)
    return Block(settings(), records, host_ns, np.zeros(len(pairs), bool), ())


def fed(statistics: Statistics, missing: set[tuple[int, int]], frames: range, step: int = 48, **how) -> int:
    """Return frames in looks of 0.2 s, without those that are missing, and the host's time after the last."""
    for first in range(frames.start, frames.stop, step):
        here = range(first, min(first + step, frames.stop))
        pairs = [(f, s) for f in here for s in statistics.receivers if (f, s) not in missing]
        now_ns = START_NS + round(here.stop * 1e9 / RATE_HZ)
        statistics.add(block(pairs, **how), 56 * len(pairs), now_ns)
    return now_ns


def test_a_receiver_that_was_unplugged_is_absent_and_not_lossy() -> None:
    gone = {(frame, 2) for frame in range(480, 1200)}
    statistics = Statistics(settings(), START_NS)
    now_ns = fed(statistics, gone, range(960))
    assert statistics.absent() == {2}
    assert statistics.totals(now_ns)["receivers"]["2"]["absent_s"] == [[pytest.approx(2.0, abs=0.01), None]]
    now_ns = fed(statistics, gone, range(960, 1320))
    totals = statistics.totals(now_ns)["receivers"]["2"]
    assert totals["absent_s"] == [[pytest.approx(2.0, abs=0.01), pytest.approx(5.0, abs=0.01)]]
    assert totals["lost_frames"] == 0
    assert statistics.absent() == set()
    assert statistics.totals(now_ns)["partial_cycles"] < 240, "a receiver that is away makes no cycle partial"
