"""What the view and the summary count, on streams of which the losses are known."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from trackers.decode.stream import Block
from trackers.protocols.records import empty_records
from trackers.protocols.stream_settings import StreamSettings
from trackers.record.statistics import Moment, Statistics

RATE_HZ = 240.0
START_NS = 5_000_000_000


def settings(stations: Iterable[int] = (1, 2), hemisphere=(1.0, 0.0, 0.0)) -> StreamSettings:
    each = tuple(stations)
    return StreamSettings("liberty", "binary", "cm", RATE_HZ, each, {}, dict.fromkeys(each, hemisphere))


def block(
    pairs: list[tuple[int, int]], *, position_mm=(300.0, 0.0, 0.0), late_ms: float = 0.0, **columns
) -> Block:
    """Records of (frame, station), which came when their frame was measured, or later."""
    records = empty_records(len(pairs))
    records.frame[:] = [frame for frame, _ in pairs]
    records.station[:] = [station for _, station in pairs]
    records.position_mm[:] = position_mm
    for name, value in columns.items():
        getattr(records, name)[:] = value
    host_ns = START_NS + (records.frame * 1e9 / RATE_HZ + late_ms * 1e6).astype(np.int64)
    return Block(settings(), records, host_ns, np.zeros(len(pairs), bool))


def fed(statistics: Statistics, missing: set[tuple[int, int]], frames: range, step: int = 48, **how) -> int:
    """Give frames in looks of 0.2 s, without those that are missing; gives the host's time after the last."""
    for first in range(frames.start, frames.stop, step):
        here = range(first, min(first + step, frames.stop))
        pairs = [(f, s) for f in here for s in statistics.receivers if (f, s) not in missing]
        now_ns = START_NS + round(here.stop * 1e9 / RATE_HZ)
        statistics.add(block(pairs, **how), 56 * len(pairs), now_ns)
    return now_ns


def counted(missing: set[tuple[int, int]], frames: int, **how) -> tuple[dict[str, Any], Moment]:
    """Totals, and the moment at their end, of so many frames without those that are missing."""
    statistics = Statistics(settings(), START_NS)
    now_ns = fed(statistics, missing, range(frames), **how)
    return statistics.totals(now_ns), statistics.moment(now_ns)


def test_all_is_well() -> None:
    totals, moment = counted(set(), 1200)
    assert [row.rate_hz for row in moment.rows] == pytest.approx([240.0, 240.0])
    assert [row.missing_percent for row in moment.rows] == [0.0, 0.0]
    assert moment.bytes_per_s == pytest.approx(2 * 56 * 240)
    assert moment.partial_cycles == 0
    assert moment.lag_ms == pytest.approx(0.0, abs=0.01)
    assert totals["records"] == 2400
    assert totals["lost_frames"] == 0
    assert totals["seconds"] == pytest.approx(5.0)
    assert json.loads(json.dumps(totals)) == totals


def test_lost_frames_are_of_the_receiver_that_lost_them() -> None:
    totals, moment = counted({(700, 2), (701, 2), (900, 1)}, 960)
    assert totals["receivers"]["1"]["lost_frames"] == 1
    assert totals["receivers"]["2"]["lost_frames"] == 2
    assert totals["partial_cycles"] == 3
    assert [row.missing_percent for row in moment.rows] == pytest.approx([100 / 480, 200 / 480], rel=0.01)


def test_a_cycle_that_nobody_sent_is_lost_by_all_and_not_partial() -> None:
    totals, _ = counted({(500, 1), (500, 2)}, 960)
    assert totals["lost_frames"] == 2
    assert totals["partial_cycles"] == 0
    assert totals["lost_cycles"] == 1
    assert totals["cycles"] == 959


def test_a_receiver_that_was_unplugged_is_absent_and_not_lossy() -> None:
    gone = {(frame, 2) for frame in range(480, 1200)}
    statistics = Statistics(settings(), START_NS)
    now_ns = fed(statistics, gone, range(960))
    row = statistics.moment(now_ns).rows[1]
    assert row.rate_hz is None
    assert row.absent_s == pytest.approx(2.0, abs=0.01)
    assert statistics.totals(now_ns)["receivers"]["2"]["absent_s"] == [[pytest.approx(2.0, abs=0.01), None]]
    now_ns = fed(statistics, gone, range(960, 1320))
    totals = statistics.totals(now_ns)["receivers"]["2"]
    assert totals["absent_s"] == [[pytest.approx(2.0, abs=0.01), pytest.approx(5.0, abs=0.01)]]
    assert totals["lost_frames"] == 0
    assert statistics.moment(now_ns).rows[1].rate_hz == pytest.approx(240.0, rel=0.02)
    assert statistics.totals(now_ns)["partial_cycles"] < 240, "a receiver that is away makes no cycle partial"


def test_an_absence_between_two_looks_is_found() -> None:
    totals, _ = counted({(frame, 2) for frame in range(300, 700)}, 960, step=960)
    (absence,) = totals["receivers"]["2"]["absent_s"]
    assert absence == pytest.approx([1.25, 2.917], abs=0.01)


def test_a_receiver_that_never_came_is_absent_from_the_start() -> None:
    totals, moment = counted({(frame, 2) for frame in range(960)}, 960)
    assert totals["receivers"]["2"]["absent_s"] == [[0.0, None]]
    assert moment.rows[1].rate_hz is None


def test_silence_is_told_apart_from_absence() -> None:
    statistics = Statistics(settings(), START_NS)
    fed(statistics, set(), range(480))
    for tenths in range(20, 50):
        statistics.add(block([]), 0, START_NS + tenths * 100_000_000)
    moment = statistics.moment(START_NS + 4_900_000_000)
    assert moment.silent_s == pytest.approx(2.9)
    now_ns = fed(statistics, set(), range(1200, 1440))
    totals = statistics.totals(now_ns)
    assert totals["silent_s"] == [[pytest.approx(2.0), pytest.approx(5.2)]]
    assert totals["receivers"]["1"]["absent_s"] == [
        [pytest.approx(2.0, abs=0.01), pytest.approx(5.0, abs=0.01)]
    ]


def test_errors_and_distortion_are_of_now_and_of_the_worst() -> None:
    statistics = Statistics(settings(), START_NS)
    fed(statistics, set(), range(240), error=ord("b"), distortion=2)
    row = statistics.moment(START_NS + 10**9).rows[0]
    assert (row.error, row.distortion) == ("b", 2)
    now_ns = fed(statistics, set(), range(240, 480), distortion=0)
    row = statistics.moment(now_ns).rows[0]
    assert (row.error, row.distortion) == ("", 0)
    totals = statistics.totals(now_ns)["receivers"]["1"]
    assert totals["records_with_error"] == 240
    assert totals["worst_distortion"] == 2


def test_the_margin_is_the_sine_of_the_angle_to_the_edge() -> None:
    statistics = Statistics(settings(hemisphere=(0.0, 0.0, 2.0)), START_NS)
    fed(statistics, set(), range(48), position_mm=(300.0, 0.0, 300.0))
    now_ns = fed(statistics, set(), range(48, 96), position_mm=(0.0, 100.0, 0.0))
    assert statistics.moment(now_ns).rows[0].margin == pytest.approx(0.0)
    fed(statistics, set(), range(96, 144), position_mm=(300.0, 0.0, 300.0))
    assert statistics.moment(now_ns).rows[0].margin == pytest.approx(np.sqrt(0.5))
    assert statistics.totals(now_ns)["receivers"]["1"]["least_hemisphere_margin"] == pytest.approx(0.0)


def test_no_margin_while_the_tracker_follows() -> None:
    statistics = Statistics(settings(hemisphere=(0.0, 0.0, 0.0)), START_NS)
    now_ns = fed(statistics, set(), range(48))
    assert np.isnan(statistics.moment(now_ns).rows[0].margin)
    assert statistics.totals(now_ns)["receivers"]["1"]["least_hemisphere_margin"] is None


def test_lag_is_how_much_later_than_at_its_fastest_the_newest_record_came() -> None:
    statistics = Statistics(settings(), START_NS)
    fed(statistics, set(), range(480), late_ms=1.0)
    now_ns = fed(statistics, set(), range(480, 528), late_ms=41.0)
    lag_ms = statistics.moment(now_ns).lag_ms
    assert lag_ms == pytest.approx(40.0, abs=0.01)


def test_what_cannot_be_believed_is_counted_and_not_used() -> None:
    statistics = Statistics(settings((1,)), START_NS)
    fed(statistics, set(), range(48))
    wild = block([(48, 1), (4_000_000, 1), (49, 1)])
    wild.out_of_order[1] = True
    statistics.add(wild, 168, START_NS + 208_000_000)
    totals = statistics.totals(START_NS + 208_000_000)
    assert totals["receivers"]["1"]["doubtful_records"] == 1
    assert totals["receivers"]["1"]["records"] == 50
    assert totals["lost_frames"] == 0


def test_a_cycle_that_two_looks_share_is_one_and_whole() -> None:
    statistics = Statistics(settings(), START_NS)
    pairs = [(frame, station) for frame in range(10) for station in (1, 2)]
    for first in range(0, 20, 3):
        here = pairs[first : first + 3]
        statistics.add(block(here), 56 * len(here), START_NS + 10**7 * (first + 1))
    totals = statistics.totals(START_NS + 10**9)
    assert (totals["cycles"], totals["partial_cycles"]) == (10, 0)


def test_what_the_stop_cuts_is_no_loss() -> None:
    """The cycle in which the stop comes lacks receiver 2; the answer to the stop is a frame of its own."""
    totals, _ = counted({(500, 1), (500, 2), (600, 1), (960, 2), (961, 1), (961, 2)}, 963)
    assert (totals["lost_frames"], totals["lost_cycles"], totals["partial_cycles"]) == (3, 1, 1)
    assert [one["lost_frames"] for one in totals["receivers"].values()] == [2, 1]
    assert totals["cycles"] == 961


def test_a_silence_of_all_is_no_lost_frame() -> None:
    totals, _ = counted({(frame, station) for frame in range(300, 600) for station in (1, 2)}, 960)
    assert (totals["lost_frames"], totals["lost_cycles"]) == (0, 0)
