"""Texts about a recording: its status line, its summary, and the refusal of a line that is too slow."""

import pytest
from tracker_streams import settings

from shukotsu.errors import InputError
from shukotsu.tracker import display
from shukotsu.tracker.display import Statistics
from shukotsu.tracker.liberty import FULL_LIST


def test_the_status_line_reports_rates_losses_and_receivers() -> None:
    """It has rates and losses since the previous line, receivers with errors, and absent ones."""
    stations = (1, 2, 3, 4, 5)
    statistics = Statistics(settings("liberty", stations=stations), 0)
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


def test_the_summary_lists_losses_absences_and_notes() -> None:
    well = {"records": 14_400, "lost_frames": 0, "records_with_error": 0, "worst_distortion": 0}
    absent_s = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [50.0, None]]
    receivers = {
        "1": {**well, "least_hemisphere_margin": 0.82, "absent_s": []},
        "16": {**well, "least_hemisphere_margin": None, "absent_s": absent_s},
    }
    totals = {"seconds": 60.04, "records": 28_800, "lost_frames": 3, "lost_cycles": 2, "cycles": 14_400}
    totals |= {"partial_cycles": 2, "skipped_bytes": 7, "received_bytes": 1_612_807}
    totals |= {"silent_s": [[10.0, 12.5]], "receivers": receivers}
    lines = display.summary("rom.arrows", "--duration 60", totals, ("the host's clock was set by +3600.0 s",))
    assert lines[0] == "rom.arrows: ended after 60.0 s (--duration 60)"
    assert lines[1] == "28800 records in 14400 cycles; 2 frames lost (3 records), 2 cycles partial"
    assert lines[2] == "1612807 bytes, 7 of them in no record"
    assert lines[4].split() == ["1", "14400", "0", "0", "0", "+0.82", "-"]
    assert lines[5].endswith("1.0 s to 2.0 s, 3.0 s to 4.0 s, 50.0 s to the end and 1 more")
    assert lines[6:] == ["no record at all: 10.0 s to 12.5 s", "note: the host's clock was set by +3600.0 s"]


def test_a_line_that_is_too_slow_is_refused_with_settings_that_fit() -> None:
    """At 115200 baud a line carries 11520 bytes/s, exactly 48 bytes at 240 Hz."""

    def check(count: int, items: tuple[int, ...]) -> None:
        display.check_line(settings("liberty", items, range(1, count + 1)), 115200, "/dev/ttyUSB0")

    check(1, (8, 9, 11, 3, 7))
    with pytest.raises(InputError):
        check(1, (8, 9, 11, 3, 7, 0))
    slow = (
        r"^/dev/ttyUSB0: the line is too slow: 16 receivers x 56 bytes x 240 Hz = 215040.*115200 baud carries"
    )
    fitting = (
        ".*1 receiver at 120 Hz with this list, 1 receiver at 240 Hz or 2 receivers at 120 Hz with --items"
    )
    with pytest.raises(InputError, match=slow + fitting):
        check(16, FULL_LIST)
