"""`record --ask`: says what it finds."""

import pytest
from tracker_processes import capture, leave_in

from shukotsu.trackers.liberty.replies import FULL_LIST
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record import session


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


@pytest.mark.slow
def test_a_check_says_what_another_program_has_left(emulated) -> None:
    port = emulated("--stations", "1-2")
    leave_in(port, b"U0\rR3\rO1,2,4,9\rO2,8,3,7\rH1,0,0,-1\rL2,1\rX0,1,0,0\r")
    done = capture("record", "--ask", "--port", port, "--no-filters")
    assert done.returncode == 0, done.stderr
    assert "units             inch -> cm" in done.stdout
    assert "output list       1: 2 4 9 -> 8 9 11 10 12 3 7; 2: 8 3 7 -> 8 9 11 10 12 3 7" in done.stdout
    assert "hemisphere        1: 0 0 -1 -> 1 0 0; 2: 1 0 0" in done.stdout
    assert "rate              120 Hz -> 240 Hz" in done.stdout
    assert "; 0 frames lost (0 records), 0 cycles partial" in done.stdout
