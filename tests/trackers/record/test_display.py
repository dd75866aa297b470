"""The view, which fits a terminal of 80 columns with every receiver there is; and the summary at the end."""

from shukotsu.trackers.record import display
from shukotsu.trackers.record.statistics import Moment, Row


def row(station: int = 1, **other) -> Row:
    well = {"rate_hz": 240.0, "missing_percent": 0.0, "error": "", "distortion": 0}
    return Row(station, **{**well, "margin": 0.8, "absent_s": 0.0, **other})


def moment(*rows: Row, **other) -> Moment:
    well = {"bytes_per_s": 215_040.0, "lag_ms": 3.0, "silent_s": 0.0, "skipped_bytes": 0}
    return Moment(rows, **{**well, "partial_cycles": 0, **other})


def recorded(**other) -> display.Recorded:
    well = {"title": "liberty at /dev/ttyUSB0 -> rom.arrows", "elapsed_s": 12.44, "remaining_s": 47.6}
    return display.Recorded(**{**well, "archive_bytes": 2_660_000, "line_bytes_per_s": None, **other})


WORST = {"rate_hz": 239.96, "missing_percent": 100.0, "error": "G", "distortion": 255, "margin": -1.0}


def test_every_line_fits_80_columns_at_its_worst() -> None:
    rows = [row(station, **WORST) for station in range(1, 16)]
    rows.append(row(16, rate_hz=None, absent_s=123_456.0))
    stream = {"skipped_bytes": 10**10, "partial_cycles": 10**8, "lag_ms": 123_456.0, "silent_s": 86_400.0}
    times = {"elapsed_s": 360_000.0, "remaining_s": 360_000.0, "archive_bytes": 10**12}
    long = recorded(title="t" * 200, line_bytes_per_s=11520.0, notice="n" * 200, **times)
    shown = display.view(moment(*rows, bytes_per_s=1e7, **stream), long)
    assert len(shown) == 5 + 16 + 1, "silence is told in one line, instead of the notice"
    assert max(map(len, shown)) <= 80
    usual = display.view(moment(*rows), recorded())
    assert all(f"{station}" in line for station, line in zip(range(1, 17), usual[5:21], strict=True))


def test_it_says_what_there_is_to_see() -> None:
    rows = [row(1), row(2, error="b"), row(3, margin=0.04), row(4, margin=-0.5)]
    rows.append(row(5, rate_hz=None, absent_s=7.2))
    shown = display.view(moment(*rows), recorded(line_bytes_per_s=11520.0 * 20))
    text = "\n".join(shown)
    assert "elapsed 0:12.4   remaining 0:47.6   archive 2.66 MB" in text
    assert "215.0 kB/s (93 % of the line)   lag 3 ms   skipped 0 bytes   partial cycles 0" in text
    assert shown[5].split() == ["1", "240.0", "0.0", "%", "-", "none", "+0.80"]
    assert shown[6].endswith("see error")
    assert shown[7].endswith("+0.04  near the edge")
    assert shown[8].endswith("in the other half")
    assert shown[9].split() == ["5", "--", "--", "absent", "for", "7", "s"]


WELL = {
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
