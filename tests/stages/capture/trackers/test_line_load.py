"""What a line carries: the arithmetic that a recorder refuses with."""

import pytest

from schemas.errors import InputError
from stages.capture.trackers.liberty.items import FULL_LIST, SHORT_LIST, check_items, record_bytes
from stages.capture.trackers.line_load import full_cycles_per_s, load_percent, stream_bytes_per_s

BAUD = 115200


@pytest.mark.parametrize(
    ("items", "mode", "size", "cycles"),
    [
        ((2, 4, 1), "binary", 34, [338, 169, 84, 42, 21]),
        ((2, 4, 1), "ascii", 60, [192, 96, 48, 24, 12]),
        ((2, 7), "binary", 36, [320, 160, 80, 40, 20]),
        (SHORT_LIST, "binary", 40, [288, 144, 72, 36, 18]),
        ((8, 9, 11, 3, 7), "binary", 48, [240, 120, 60, 30, 15]),
        (FULL_LIST, "binary", 56, [205, 102, 51, 25, 12]),
        ((2,), "binary", 20, [576, 288, 144, 72, 36]),
    ],
)
def test_cycles_that_115200_baud_carry(items, mode: str, size: int, cycles: list[int]) -> None:
    assert record_bytes(items, mode) == size
    assert [full_cycles_per_s(stations, size, BAUD) for stations in (1, 2, 4, 8, 16)] == cycles


def test_one_receiver_with_48_bytes_fills_the_line() -> None:
    assert load_percent(1, 48, 240, BAUD) == 100
    assert stream_bytes_per_s(16, 56, 240) == 215_040


def test_lists_that_a_tracker_does_not_take() -> None:
    check_items(FULL_LIST)
    with pytest.raises(InputError, match="item 13 is unknown; known are 0, 1, 2"):
        check_items((2, 13))
    with pytest.raises(InputError, match="expected at most 20 items and 1000 bytes"):
        check_items((2,) * 21)
