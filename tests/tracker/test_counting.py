"""Frame numbers increase although the tracker's counter overflows, restarts or is damaged."""

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from shukotsu.tracker.records import Records, StreamSettings, empty_records
from shukotsu.tracker.stream import Counter

STATIONS = (1, 2, 5)


def decoded(counters, stations) -> Records:
    records = empty_records(len(counters))
    records.frame[:], records.station[:] = counters, stations
    return records


def number(pieces: list[Records]):
    counter = Counter(StreamSettings("liberty", "binary", "cm", 240.0, STATIONS))
    frames, odd = [], []
    for index, piece in enumerate(pieces):
        arrivals = np.zeros(len(piece), np.int64)
        records, _, wrong = counter.number(piece, arrivals, final=index == len(pieces) - 1)
        frames += records.frame.tolist()
        odd += wrong.tolist()
    return frames, odd


def cycles(frames) -> tuple[list[int], list[int]]:
    return [f for f in frames for _ in STATIONS], list(STATIONS) * len(list(frames))


TOP = 2**32


@pytest.mark.parametrize(
    ("counts", "numbers"),
    [
        ([TOP - 2, TOP - 1, 0, 1, 5], [TOP - 2, TOP - 1, TOP, TOP + 1, TOP + 5]),
        ([500, 501, 0, 1, 2], [500, 501, 502, 503, 504]),
    ],
    ids=["overflow of 32 bits", "restart"],
)
def test_a_counter_that_restarts_is_continued(counts: list[int], numbers: list[int]) -> None:
    frames, odd = number([decoded(*cycles(counts))])
    assert frames[::3] == numbers
    assert not any(odd)


@pytest.mark.parametrize("bit", range(0, 32, 3))
@pytest.mark.parametrize("row", range(4, 11))
def test_a_flipped_bit_in_a_count_spoils_only_its_record(row: int, bit: int) -> None:
    counters, stations = cycles(range(1000, 1006))
    hurt = counters.copy()
    hurt[row] ^= 1 << bit
    frames, odd = number([decoded(hurt, stations)])
    good = [f for f, wrong in zip(frames, odd, strict=True) if not wrong]
    spoilt = [i for i, wrong in enumerate(odd) if wrong]
    assert spoilt == [row]
    assert [f for f, wrong in zip(counters, odd, strict=True) if not wrong] == good


def test_a_damaged_header_costs_its_record_alone_in_any_pieces() -> None:
    counters, stations = cycles([count % 2**32 for count in range(2**32 - 4, 2**32 + 4)])
    for row, count, station in product((10,), counters[::3], STATIONS):
        hurt_counters, hurt_stations = counters.copy(), stations.copy()
        hurt_counters[row], hurt_stations[row] = count, station
        whole = number([decoded(hurt_counters, hurt_stations)])
        is_hurt = (count, station) != (counters[row], stations[row])
        assert np.flatnonzero(whole[1]).tolist() == [row] * is_hurt
        singly = zip(hurt_counters, hurt_stations, strict=True)
        assert number([decoded([count], [station]) for count, station in singly]) == whole


COUNTS = st.one_of(st.integers(0, 3), st.integers(2**32 - 4, 2**32 - 1), st.integers(0, 2**32 - 1))


@given(row=st.integers(0, 23), count=COUNTS, station=st.sampled_from(STATIONS), cut=st.integers(0, 24))
@example(row=10, count=0, station=1, cut=12)
def test_numbering_does_not_depend_on_where_pieces_end(row: int, count: int, station: int, cut: int) -> None:
    counters, stations = cycles([count % 2**32 for count in range(2**32 - 4, 2**32 + 4)])
    counters[row], stations[row] = count, station
    apart = [decoded(counters[:cut], stations[:cut]), decoded(counters[cut:], stations[cut:])]
    assert number(apart) == number([decoded(counters, stations)])
