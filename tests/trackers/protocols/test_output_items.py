"""Output lists: how many bytes a record takes, and which lists there are not."""

import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.fastrak.items import OUTPUT_ITEMS as FASTRAK
from shukotsu.trackers.liberty.items import FULL_LIST, SHORT_LIST
from shukotsu.trackers.liberty.items import OUTPUT_ITEMS as LIBERTY


@pytest.mark.parametrize(
    ("items", "binary", "ascii_bytes"),
    [
        ((2, 4, 1), 34, 60),
        ((2, 7), 36, 67),
        (SHORT_LIST, 40, 77),
        ((2, 7, 8, 0), 41, 78),
        ((8, 9, 11, 3, 7), 48, 106),
        (FULL_LIST, 56, 108),
        ((2,), 20, 31),
        ((6,), 44, 91),
    ],
)
def test_a_record_of_liberty_has_the_bytes_of_the_manual(items, binary: int, ascii_bytes: int) -> None:
    assert LIBERTY.record_bytes(items) == LIBERTY.record_type(items).itemsize == binary
    assert LIBERTY.record_bytes(items, "ascii") == ascii_bytes


def test_a_record_of_fastrak_has_the_bytes_of_the_manual() -> None:
    assert [FASTRAK.record_bytes((2, 4, 1), mode) for mode in ("binary", "ascii")] == [29, 47]
    assert [FASTRAK.record_bytes((2, 11, 16, 1), mode) for mode in ("binary", "ascii")] == [35, 56]
    assert FASTRAK.record_bytes((52, 61), "ascii") == 3 + 7 * 15


@pytest.mark.parametrize(
    ("table", "lists"),
    [
        (LIBERTY, {1: (2, 13)}),
        (LIBERTY, {17: (2,)}),
        (LIBERTY, {1: ()}),
        (FASTRAK, {1: (2, 8)}),
        (FASTRAK, {5: (2,)}),
    ],
)
def test_lists_that_a_tracker_does_not_take(table, lists) -> None:
    with pytest.raises(
        InputError, match=r"output list .* of station .*; a (LIBERTY|FASTRAK) has stations 1 to"
    ):
        table.one_list(lists)
