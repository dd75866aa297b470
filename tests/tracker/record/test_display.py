"""What people read of a recording: its state, its summary, what its line carries, what `--ask` says."""

from __future__ import annotations

import io

import pytest

from shukotsu.errors import InputError
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker.liberty.replies import FULL_LIST
from shukotsu.tracker.protocols.stream_settings import StreamSettings
from shukotsu.tracker.record import display, session
from shukotsu.tracker.record.statistics import Statistics


class Terminal(io.StringIO):
    """Text that says it is a terminal."""

    def isatty(self) -> bool:
        """It is none."""
        return True


def test_a_line_is_written_over_the_one_before_and_one_that_stays_below() -> None:
    out = Terminal()
    printer = LinePrinter(out)
    printer.show("240 Hz")
    printer.show("24 Hz")
    printer.say("note")
    assert out.getvalue() == f"\r240 Hz\r24 Hz \r{' ' * 5}\rnote\n"
    out.close()
    printer.say("a terminal that went away is no error")


def test_the_line_says_what_there_is_to_see() -> None:
    """Rates and losses since the line before, what is wrong with receivers, and which are absent."""
    stations = (1, 2, 3, 4, 5)
    statistics = Statistics(StreamSettings("liberty", "binary", "cm", 240.0, stations), 0)
    before = statistics.totals(0)
    now = {"seconds": 2.0, "skipped_bytes": 7, "received_bytes": 2_660_000}
    now["receivers"] = {str(s): {"records": 480 - s, "lost_frames": s} for s in stations}
    for station, receiver in statistics.receivers.items():
        receiver.last_host_ns = 0 if station == 5 else 2_000_000_000
    statistics.receivers[2].error, statistics.receivers[3].distortion = ord("b"), 2
    statistics.receivers[3].margin, statistics.receivers[4].margin = 0.04, -0.5
    assert display.state_line(statistics, now, before) == (
        "2.0 s  4 of 5 receivers  238.0 Hz  missing 0.8 %  skipped 7 B  2.66 MB  absent 5  "
        "2 error b  3 near the edge  3 distortion 2  4 in the other half"
    )


WELL = {
    "records": 14_400,
    "lost_frames": 0,
    "records_with_error": 0,
    "worst_distortion": 0,
    "least_hemisphere_margin": 0.82,
    "absent_s": [],
}
TOTALS = {
    "seconds": 60.04,
    "records": 28_800,
    "lost_frames": 3,
    "lost_cycles": 2,
    "cycles": 14_400,
    "partial_cycles": 2,
    "skipped_bytes": 7,
    "received_bytes": 1_612_807,
    "silent_s": [[10.0, 12.5]],
    "receivers": {
        "1": WELL,
        "16": {
            **WELL,
            "least_hemisphere_margin": None,
            "absent_s": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [50.0, None]],
        },
    },
}


def test_the_summary() -> None:
    lines = display.summary("rom.arrows", "--duration 60", TOTALS, ("the host's clock was set by +3600.0 s",))
    assert lines[0] == "rom.arrows: ended after 60.0 s (--duration 60)"
    assert lines[1] == "28800 records in 14400 cycles; 2 frames lost (3 records), 2 cycles partial"
    assert lines[2] == "1612807 bytes, 7 of them in no record"
    assert lines[4].split() == ["1", "14400", "0", "0", "0", "+0.82", "-"]
    assert lines[5].endswith("1.0 s to 2.0 s, 3.0 s to 4.0 s, 50.0 s to the end and 1 more")
    assert lines[6] == "no record at all: 10.0 s to 12.5 s"
    assert lines[7] == "note: the host's clock was set by +3600.0 s"


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


def test_settings_are_told_as_they_were_and_are() -> None:
    options = {
        "whoami": "LIBERTY 240/8",
        "before": {"units": 0, "output_list": {"1": (2, 4, 1), "2": (2, 4, 1)}, "stylus": {"1": 1, "2": 0}},
        "after": {"units": 1, "output_list": {"1": FULL_LIST, "2": FULL_LIST}, "stylus": {"1": 0, "2": 0}},
    }
    settings = StreamSettings(
        "liberty", "binary", "cm", 240.0, (1, 2), {1: FULL_LIST, 2: FULL_LIST}, {}, options
    )
    answers = [
        "tracker     LIBERTY 240/8",
        "receivers   1, 2",
        "units             inch -> cm",
        "output list       2 4 1 -> 8 9 11 10 12 3 7",
        "stylus            1: 1 -> 0; 2: 0",
        "note: a warning",
    ]
    assert session.answer_lines(settings, ["a warning"], 115200) == [
        *answers,
        "line        2 receivers x 56 bytes x 240 Hz = 26880 bytes/s, and 115200 baud carries 11520: 233 %",
        "            too slow; what fits is 1 receiver at 120 Hz with this list, "
        "1 receiver at 240 Hz or 2 receivers at 120 Hz with --items short",
    ]
    assert session.answer_lines(settings, ["a warning"], None) == [
        *answers,
        "line        needs 26.9 kB/s; the port's own rate is not known",
    ]
