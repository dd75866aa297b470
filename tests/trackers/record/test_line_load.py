"""What a serial line carries, against the table of full cycles at 115200 baud."""

import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.liberty.replies import FULL_LIST
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record import display


def settings(count: int, items=FULL_LIST, rate_hz: float = 240.0) -> StreamSettings:
    stations = tuple(range(1, count + 1))
    return StreamSettings("liberty", "binary", "cm", rate_hz, stations, dict.fromkeys(stations, items))


def test_a_line_that_is_just_full_is_not_too_slow() -> None:
    """48 bytes 240 times a second are all of 11520."""
    display.check_line(settings(1, (8, 9, 11, 3, 7)), 115200, "p")
    with pytest.raises(InputError):
        display.check_line(settings(1, (8, 9, 11, 3, 7, 0)), 115200, "p")


def test_the_sentence_has_the_arithmetic_and_what_fits() -> None:
    with pytest.raises(InputError) as told:
        display.check_line(settings(16), 115200, "/dev/ttyUSB0")
    sentence = str(told.value)
    assert sentence.startswith(
        "/dev/ttyUSB0: the line is too slow: 16 receivers x 56 bytes x 240 Hz = 215040"
    )
    assert "115200 baud carries 11520" in sentence
    assert "1 receiver at 120 Hz with this list" in sentence
    assert "1 receiver at 240 Hz or 2 receivers at 120 Hz with --items short" in sentence
    assert sentence.endswith("; or use the tracker's USB")
