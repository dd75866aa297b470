"""What a serial line carries, against the table of full cycles at 115200 baud."""

import pytest

from schemas.errors import InputError
from trackers.liberty.items import FULL_LIST, SHORT_LIST
from trackers.protocols.stream_settings import StreamSettings
from trackers.record import line_load


def settings(count: int, items=FULL_LIST, rate_hz: float = 240.0, mode: str = "binary") -> StreamSettings:
    stations = tuple(range(1, count + 1))
    return StreamSettings("liberty", mode, "cm", rate_hz, stations, dict.fromkeys(stations, items))


@pytest.mark.parametrize(
    ("items", "cycle", "cycles"),
    [((2, 4, 1), 34, 42), (SHORT_LIST, 40, 36), ((8, 9, 11, 3, 7), 48, 30), (FULL_LIST, 56, 25)],
)
def test_eight_receivers_at_115200_baud(items, cycle: int, cycles: int) -> None:
    """25.7, 36, 30 and 42.3 cycles a second: only whole ones come through."""
    assert line_load.cycle_bytes(settings(8, items)) == 8 * cycle
    told = line_load.overload(settings(8, items), 115200, "/dev/ttyUSB0", allowed=True)
    assert told is not None
    assert f"about {cycles} a second" in told


def test_a_line_that_is_just_full_is_not_too_slow() -> None:
    """48 bytes 240 times a second are all of 11520."""
    assert line_load.overload(settings(1, (8, 9, 11, 3, 7)), 115200, "p", allowed=False) is None
    with pytest.raises(InputError):
        line_load.overload(settings(1, (8, 9, 11, 3, 7, 0)), 115200, "p", allowed=False)


def test_the_sentence_has_the_arithmetic_and_what_fits() -> None:
    with pytest.raises(InputError) as told:
        line_load.overload(settings(16), 115200, "/dev/ttyUSB0", allowed=False)
    sentence = str(told.value)
    assert sentence.startswith(
        "/dev/ttyUSB0: the line is too slow: 16 receivers x 56 bytes x 240 Hz = 215040"
    )
    assert "115200 baud carries 11520" in sentence
    assert "1 receiver at 120 Hz with this list" in sentence
    assert "1 receiver at 240 Hz or 2 receivers at 120 Hz with --items short" in sentence
    assert sentence.endswith("or --allow-slower to record what comes through, about 12 frames a second")


def test_what_fits_does_fit() -> None:
    for baud in (38400, 57600, 115200, 921600):
        for rate in (120, 240):
            fitting = int(baud // 10 // (40 * rate))
            told = line_load.what_fits(settings(16), baud)
            assert (f"{fitting} receiver{'s'[: fitting > 1]} at {rate} Hz" in told) == (fitting > 0)


def test_nothing_is_said_where_the_rate_is_not_known() -> None:
    assert line_load.overload(settings(16), None, "/dev/pts/3", allowed=False) is None


def test_a_line_that_brings_too_little_is_told() -> None:
    told = line_load.too_slow(settings(16), 11_500.0, 94.6)
    assert told == (
        "the line brought 11.5 kB/s of the 215 kB/s that 16 receivers need: it is too slow; "
        "see --stations, --items short, --rate 120"
    )
    assert line_load.too_slow(settings(16), 11_500.0, 20.0) is None
    assert line_load.too_slow(settings(16), 215_040.0, 94.6) is None, "all came and much of it is damaged"
    one = line_load.too_slow(settings(1), 5_000.0, 60.0)
    assert one is not None
    assert "that 1 receiver needs: " in one


def test_other_families() -> None:
    viper = StreamSettings("viper", "binary", "cm", 240.0, tuple(range(1, 17)))
    assert line_load.cycle_bytes(viper) == 540
    fastrak = StreamSettings("fastrak", "binary", "cm", 60.0, (1, 2), dict.fromkeys((1, 2), (2, 11, 0)))
    assert line_load.cycle_bytes(fastrak) == 64
    flock = StreamSettings("trakstar", "binary", "inch", 100.0, (1, 2), options={"group": True})
    assert line_load.cycle_bytes(flock) == 30
