"""`record --ask`: says what it finds."""

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
