"""What is said at the end."""

from stages.capture.record import summary
from stages.capture.trackers.liberty.items import FULL_LIST
from stages.capture.trackers.settings import StreamSettings

SETTINGS = StreamSettings("liberty", "binary", "cm", 240.0, (1, 16), dict.fromkeys((1, 16), FULL_LIST))

ONE = {
    "records": 14_400,
    "lost_frames": 0,
    "doubtful_records": 0,
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
        "1": ONE,
        "16": {
            **ONE,
            "least_hemisphere_margin": None,
            "absent_s": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [50.0, None]],
        },
    },
}


def test_the_summary() -> None:
    told = summary.lines("rom.arrows", "--duration 60", TOTALS, ("the host's clock was set by +3600.0 s",))
    assert told[0] == "rom.arrows: ended after 60.0 s (--duration 60)"
    assert told[1] == "28800 records in 14400 cycles; 2 frames lost (3 records), 2 cycles partial"
    assert told[2] == "1612807 bytes, 7 of them in no record"
    assert told[4].split() == ["1", "14400", "0", "0", "0", "+0.82", "-"]
    assert told[5].endswith("1.0 s to 2.0 s, 3.0 s to 4.0 s, 5.0 s to 6.0 s and 1 more")
    assert told[6] == "no data at all: 10.0 s to 12.5 s"
    assert told[7] == "note: the host's clock was set by +3600.0 s"


def test_an_absence_to_the_end() -> None:
    receivers = {"2": {**ONE, "absent_s": [[50.04, None]]}}
    assert summary.table({**TOTALS, "receivers": receivers})[-1].endswith("50.0 s to the end")


def test_a_good_recording_needs_no_advice() -> None:
    assert summary.advice(TOTALS, SETTINGS) == []


def test_a_line_that_is_too_slow_is_told() -> None:
    totals = {**TOTALS, "lost_frames": 7_300, "received_bytes": 690_000}
    (told,) = summary.advice(totals, SETTINGS)
    assert told.startswith("the line brought 11.5 kB/s of the 26.9 kB/s that 2 receivers need")
    assert summary.advice({**totals, "lost_frames": 7_100}, SETTINGS) == []


def test_receivers_at_the_edge_of_the_hemisphere_are_named() -> None:
    margins = {"1": 0.05, "2": 0.04, "3": None, "5": -0.3}
    receivers = {s: {**ONE, "least_hemisphere_margin": margin} for s, margin in margins.items()}
    assert summary.advice({**TOTALS, "receivers": receivers}, SETTINGS) == [
        "receiver 2, 5: came to the edge of the hemisphere: positions may have jumped; `decode` marks it; "
        "consider --hemisphere"
    ]
