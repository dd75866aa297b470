"""Frame numbers only grow, however the tracker's counter wraps, starts anew or is damaged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers.decode.counting import Counter
from trackers.protocols.records import Decoded, empty_records
from trackers.protocols.stream_settings import StreamSettings

STATIONS = (1, 2, 5)


def settings(rate_hz: float = 240.0) -> StreamSettings:
    return StreamSettings("liberty", "binary", "cm", rate_hz, STATIONS)


def decoded(counters, stations, *, clock: bool = False, offsets=None) -> Decoded:
    records = empty_records(len(counters))
    records.station[:] = stations
    if counters[:1] != [None]:
        (records.device_ms if clock else records.frame)[:] = counters
    records.size[:] = 40
    records.offset[:] = np.arange(len(counters)) * 40 if offsets is None else offsets
    return Decoded(records)


def number(pieces: list[Decoded], rate_hz: float = 240.0):
    counter = Counter(settings(rate_hz))
    frames, odd = [], []
    for index, piece in enumerate(pieces):
        arrivals = np.zeros(len(piece.records), np.int64)
        records, _, wrong = counter.number(piece, arrivals, final=index == len(pieces) - 1)
        frames += records.frame.tolist()
        odd += wrong.tolist()
    return frames, odd


def cycles(frames) -> tuple[list[int], list[int]]:
    return [f for f in frames for _ in STATIONS], list(STATIONS) * len(list(frames))


def test_the_counter_is_kept_as_it_is() -> None:
    assert number([decoded(*cycles([7, 8, 11]))]) == ([7] * 3 + [8] * 3 + [11] * 3, [False] * 9)


def test_it_goes_on_behind_its_32_bits() -> None:
    top = 2**32
    frames, odd = number([decoded(*cycles([top - 2, top - 1, 0, 1, 5]))])
    assert frames[::3] == [top - 2, top - 1, top, top + 1, top + 5]
    assert not any(odd)


def test_a_counter_set_anew_goes_on() -> None:
    frames, odd = number([decoded(*cycles([500, 501, 0, 1, 2]))])
    assert frames[::3] == [500, 501, 502, 503, 504]
    assert not any(odd)


@pytest.mark.parametrize("bit", range(32))
@pytest.mark.parametrize("place", range(4, 11))
def test_a_flipped_bit_in_a_count_spoils_its_own_record(place: int, bit: int) -> None:
    counters, stations = cycles(range(1000, 1006))
    hurt = counters.copy()
    hurt[place] ^= 1 << bit
    frames, odd = number([decoded(hurt, stations)])
    good = [f for f, wrong in zip(frames, odd, strict=True) if not wrong]
    spoilt = [i for i, wrong in enumerate(odd) if wrong]
    assert place in spoilt
    # One more or less may be the neighbour's fault as well.
    assert len(spoilt) <= (2 if bit == 0 else 1)
    assert [f for f, wrong in zip(counters, odd, strict=True) if not wrong] == good


def test_a_station_out_of_order_is_told_from_its_neighbours() -> None:
    counters, stations = cycles(range(4))
    stations[4] = 9
    assert [i for i, wrong in enumerate(number([decoded(counters, stations)])[1]) if wrong] == [4]
    stations[4] = 1
    assert [i for i, wrong in enumerate(number([decoded(counters, stations)])[1]) if wrong] == [4]
    stations[3:5] = [2, 2]
    assert [i for i, wrong in enumerate(number([decoded(counters, stations)])[1]) if wrong] == [3]


def test_time_stands_in_for_a_count() -> None:
    """The tracker's clock is floor(frame * 1000 / rate) ms."""
    frames = list(range(100, 400))
    clock = [f * 1000 // 240 for f in frames]
    assert number([decoded(clock, [1] * 300, clock=True)]) == (frames, [False] * 300)


def test_cycles_are_counted_where_nothing_else_is() -> None:
    none = [None] * 9
    assert number([decoded(none, list(STATIONS) * 3)])[0] == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    stations = [1, 2, 5, 2, 5, 1, 5, 1, 2]  # 1, then 2, then 5 of a cycle missing
    assert number([decoded(none, stations)])[0] == [0, 0, 0, 1, 1, 2, 2, 3, 3]


def test_skipped_bytes_count_as_cycles() -> None:
    offsets = [0, 40, 80, 120 + 240, 160 + 240, 200 + 240]  # six records' bytes are lost: two cycles
    assert number([decoded([None] * 6, list(STATIONS) * 2, offsets=offsets)])[0] == [0, 0, 0, 3, 3, 3]


@given(st.data())
def test_where_pieces_end_does_not_matter(data: st.DataObject) -> None:
    counters, stations = cycles(range(2**32 - 4, 2**32 + 4))
    counters = [c % 2**32 for c in counters]
    for place in data.draw(st.lists(st.integers(0, len(counters) - 1), max_size=1)):
        counters[place] = data.draw(st.integers(0, 2**32 - 1))
        stations[place] = data.draw(st.sampled_from(STATIONS))
    cut = data.draw(st.integers(0, len(counters)))
    apart = [decoded(counters[:cut], stations[:cut]), decoded(counters[cut:], stations[cut:])]
    assert number(apart) == number([decoded(counters, stations)])
