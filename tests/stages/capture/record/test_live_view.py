"""The view: what it says, and that it fits a terminal of 80 columns with every receiver there is."""

import math

import pytest

from stages.capture.record import live_view
from stages.capture.record.statistics import Moment, Row


def row(station: int = 1, **other) -> Row:
    well = {
        "rate_hz": 240.0,
        "missing_percent": 0.0,
        "error": "",
        "distortion": 0,
        "margin": 0.8,
        "absent_s": 0.0,
    }
    return Row(station, **{**well, **other})


def moment(*rows: Row, **other) -> Moment:
    well = {
        "bytes_per_s": 215_040.0,
        "lag_ms": 3.0,
        "silent_s": 0.0,
        "skipped_bytes": 0,
        "partial_cycles": 0,
        "cycles": 100,
    }
    return Moment(rows, **{**well, **other})


def recorded(**other) -> live_view.Recorded:
    well = {
        "title": "liberty at /dev/ttyUSB0 -> rom.arrows",
        "elapsed_s": 12.44,
        "remaining_s": 47.6,
        "archive_bytes": 2_660_000,
        "line_bytes_per_s": None,
    }
    return live_view.Recorded(**{**well, **other})


WORST = {
    "rate_hz": 239.96,
    "missing_percent": 100.0,
    "error": "G",
    "distortion": 255,
    "margin": -1.0,
}


def test_every_line_fits_80_columns_at_its_worst() -> None:
    rows = [row(station, **WORST) for station in range(1, 16)]
    rows.append(row(16, rate_hz=None, absent_s=123_456.0))
    worst = moment(
        *rows,
        skipped_bytes=10**10,
        partial_cycles=10**8,
        lag_ms=123_456.0,
        silent_s=86_400.0,
        bytes_per_s=1e7,
    )
    shown = live_view.lines(
        worst,
        recorded(
            title="t" * 200,
            elapsed_s=360_000.0,
            remaining_s=360_000.0,
            archive_bytes=10**12,
            line_bytes_per_s=11520.0,
            notice="n" * 200,
        ),
    )
    assert len(shown) == 5 + 16 + 1, "silence is told in one line, instead of the notice"
    assert max(map(len, shown)) <= 80
    usual = live_view.lines(moment(*rows), recorded())
    assert all(f"{station}" in line for station, line in zip(range(1, 17), usual[5:21], strict=True))


def test_it_says_what_there_is_to_see() -> None:
    shown = live_view.lines(
        moment(
            row(1),
            row(2, error="b"),
            row(3, margin=0.04),
            row(4, margin=-0.5),
            row(5, rate_hz=None, absent_s=7.2),
        ),
        recorded(line_bytes_per_s=11520.0 * 20),
    )
    text = "\n".join(shown)
    assert "elapsed 0:12.4   remaining 0:47.6   archive 2.66 MB" in text
    assert "215.0 kB/s (93 % of the line)   lag 3 ms   skipped 0 bytes   partial cycles 0" in text
    assert shown[5].split() == ["1", "240.0", "0.0", "%", "-", "none", "+0.80"]
    assert shown[6].endswith("see error")
    assert shown[7].endswith("+0.04  near the edge")
    assert shown[8].endswith("in the other half")
    assert shown[9].split() == ["5", "--", "--", "absent", "for", "7", "s"]


def test_columns_stand_under_their_heads() -> None:
    shown = live_view.lines(moment(row(16, error="I", distortion=1)), recorded())
    head, line = shown[4], shown[5]
    for name, cell in (
        ("receiver", "16"),
        ("Hz", "240.0"),
        ("missing", "0.0 %"),
        ("error", "I"),
        ("distortion", "minor"),
    ):
        assert head.index(name) + len(name) == line.index(cell) + len(cell)


def test_a_long_notice_has_two_lines() -> None:
    notice = "the line brought 11.5 kB/s of the 215 kB/s that 16 receivers need: it is too slow; see --items"
    shown = live_view.lines(moment(row()), recorded(notice=notice))
    assert " ".join(shown[-2:]) == notice
    assert len(live_view.lines(moment(row()), recorded(notice="word " * 100))) == len(shown)


@pytest.mark.parametrize(
    ("port", "archive", "shown"),
    [
        ("/dev/ttyUSB0", "rom.arrows", "liberty at /dev/ttyUSB0 -> rom.arrows"),
        ("/tmp/" + "p" * 80 + "/tracker0", "rom.arrows", "p/tracker0 -> rom.arrows"),
        ("/dev/ttyUSB0", "a" * 80 + "_rom.arrows", "liberty at /dev/ttyUSB0 -> ...a"),
        ("/tmp/" + "p" * 80 + "/tracker0", "a" * 80 + "_rom.arrows", "p/tracker0 -> ...a"),
    ],
)
def test_both_names_stay_visible_in_the_first_line(port: str, archive: str, shown: str) -> None:
    title = live_view.title("liberty", port, archive)
    assert shown in title
    assert title.endswith("rom.arrows")
    assert len(title) == min(80, len(f"liberty at {port} -> {archive}"))
    assert title.startswith(f"liberty at {'...p' if 'p' * 80 in port else port}")


def test_a_low_terminal_shows_what_fits_and_says_so() -> None:
    rows = [row(station) for station in range(1, 17)]
    shown = live_view.lines(moment(*rows), recorded(), rows=15)
    assert len(shown) == 15
    assert "and 8 more" in shown[-2]
    assert len(live_view.lines(moment(*rows), recorded(), rows=22)) == 22


def test_no_data_is_shouted() -> None:
    silent = moment(row(rate_hz=None), silent_s=4.2)
    assert live_view.lines(silent, recorded(notice="something else"))[-1].startswith("NO DATA for 4 s")
    assert live_view.one_line(silent, recorded()).startswith("NO DATA for 4 s")


@pytest.mark.parametrize(("margin", "shown"), [(math.nan, "follows"), (0.815, "+0.81"), (-0.2, "-0.20")])
def test_margins(margin: float, shown: str) -> None:
    assert shown in live_view.lines(moment(row(margin=margin)), recorded())[5]


def test_a_line_for_a_log() -> None:
    told = live_view.one_line(
        moment(row(1, rate_hz=239.5, missing_percent=0.2), row(2), row(7, rate_hz=None)), recorded()
    )
    assert (
        told == "12.4 s  2 of 3 receivers  239.5 Hz  missing 0.2 %  skipped 0 B  lag 3 ms  2.66 MB  absent 7"
    )
