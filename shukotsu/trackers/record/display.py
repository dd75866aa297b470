"""Write what people read of a recording: the live view while it is made, and the summary when it has ended.

No line of the view is longer than 80 columns. No I/O here.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from shukotsu.trackers.decode.losses import ABSENT_S
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.line_load import too_slow
from shukotsu.trackers.record.statistics import Moment, Row

COLUMNS = 80
NOTICE_LINES = 2
NEAR_EDGE = 0.1
"""A receiver whose direction is closer to the edge of its half of space may be taken for its mirror image."""

MOST_STRETCHES = 3
AT_THE_EDGE = 0.05
"""A receiver whose direction came so close to the edge of its half of space may have been beyond it."""

_DISTORTION = {0: "none", 1: "minor", 2: "HEAVY"}


@dataclass(frozen=True)
class Recorded:
    """Hold what the view says beside the receivers.

    remaining_s : None where it goes on until it is stopped. line_bytes_per_s : what the serial line carries,
    None where that is not known. notice : the last thing that happened.
    """

    title: str
    elapsed_s: float
    remaining_s: float | None
    archive_bytes: int
    line_bytes_per_s: float | None
    notice: str = ""


def title(family: str, port: str, archive: str) -> str:
    """Give the view's first line; of long names the ends, by which they differ."""
    room = COLUMNS - len(f"{family} at  -> ")
    archive = _end_of(archive, max(room // 2, room - len(port)))
    return f"{family} at {_end_of(port, room - len(archive))} -> {archive}"


def view(moment: Moment, recorded: Recorded, rows: int | None = None) -> list[str]:
    """Give the whole view; `rows` is how many lines the terminal has room for."""
    head = [
        recorded.title,
        _times(recorded),
        f"{_line(moment, recorded)}   lag {_lag(moment)}   skipped {moment.skipped_bytes} bytes   "
        f"partial cycles {moment.partial_cycles}",
        "",
        "receiver      Hz  missing  error  distortion  hemisphere",
    ]
    body = [_row(row) for row in moment.rows]
    foot = textwrap.wrap(_no_data(moment) or recorded.notice, COLUMNS)[:NOTICE_LINES] or [""]
    if rows is not None and len(head) + len(body) + len(foot) > rows:
        room = max(0, rows - len(head) - len(foot) - 1)
        body = [*body[:room], f"  ... and {len(body) - room} more; make the window higher"]
    return [line[:COLUMNS] for line in head + body + foot]


def one_line(moment: Moment, recorded: Recorded) -> str:
    """Give the view as a line for a log."""
    there = [row for row in moment.rows if row.rate_hz is not None]
    absent = [str(row.station) for row in moment.rows if row.rate_hz is None]
    rates = [row.rate_hz for row in there if row.rate_hz is not None]
    missing = max((row.missing_percent for row in there), default=0.0)
    parts = [
        f"{recorded.elapsed_s:.1f} s",
        f"{len(there)} of {len(moment.rows)} receivers",
        f"{min(rates, default=0.0):.1f} Hz",
        f"missing {missing:.1f} %",
        f"skipped {moment.skipped_bytes} B",
        f"lag {_lag(moment)}",
        _size(recorded.archive_bytes),
    ]
    parts += [f"absent {','.join(absent)}"] if absent else []
    return _no_data(moment) or "  ".join(parts)


def _end_of(name: str, room: int) -> str:
    return name if len(name) <= room else f"...{name[3 - room :]}"


def _times(recorded: Recorded) -> str:
    remaining = "" if recorded.remaining_s is None else f"   remaining {_clock(recorded.remaining_s)}"
    return (
        f"elapsed {_clock(recorded.elapsed_s)}{remaining}   archive {_size(recorded.archive_bytes)}   q stops"
    )


def _line(moment: Moment, recorded: Recorded) -> str:
    load = f"{moment.bytes_per_s / 1000:.1f} kB/s"
    if recorded.line_bytes_per_s is None:
        return load
    return f"{load} ({100 * moment.bytes_per_s / recorded.line_bytes_per_s:.0f} % of the line)"


def _row(row: Row) -> str:
    if row.rate_hz is None:
        return (
            f"{row.station:8d}      --       --                              absent for {row.absent_s:.0f} s"
        )
    margin = "follows" if math.isnan(row.margin) else f"{row.margin:+.2f}"
    error = row.error or "-"
    distortion = _DISTORTION.get(row.distortion, str(row.distortion))
    columns = (
        f"{row.station:8d}  {row.rate_hz:6.1f}  {row.missing_percent:5.1f} %  {error:>5}  {distortion:>10}"
    )
    return f"{columns}  {margin:>10}  {_trouble(row)}".rstrip()


def _trouble(row: Row) -> str:
    if row.error:
        return "see error"
    if row.margin < 0:
        return "in the other half"
    if row.margin < NEAR_EDGE:
        return "near the edge"
    return "frames missing" if row.missing_percent >= 1 else ""


def _no_data(moment: Moment) -> str:
    if moment.silent_s < ABSENT_S:
        return ""
    return f"NO DATA for {moment.silent_s:.0f} s: is the tracker on, its cable in?"


def _lag(moment: Moment) -> str:
    return "-" if moment.lag_ms is None else f"{moment.lag_ms:.0f} ms"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(0.0, seconds), 60)
    hours, minutes = divmod(int(minutes), 60)
    return f"{hours}:{minutes:02d}:{rest:04.1f}" if hours else f"{minutes}:{rest:04.1f}"


def _size(count: int) -> str:
    return f"{count / 1e9:.2f} GB" if count >= 1e9 else f"{count / 1e6:.2f} MB"


def summary(out: str, reason: str, totals: Mapping[str, Any], notices: Sequence[str] = ()) -> list[str]:
    """Give the summary: what was kept, of each receiver, and what to know of it."""
    text = [f"{out}: ended after {totals['seconds']:.1f} s ({reason})", *totals_table(totals)]
    text += [f"no record at all: {_stretches(totals['silent_s'])}"] if totals["silent_s"] else []
    return text + [f"note: {notice}" for notice in notices]


def totals_table(totals: Mapping[str, Any]) -> list[str]:
    """Tabulate what came, in all and of each receiver."""
    text = [
        f"{totals['records']} records in {totals['cycles']} cycles; "
        f"{totals['lost_cycles']} frames lost ({totals['lost_frames']} records), "
        f"{totals['partial_cycles']} cycles partial",
        f"{totals['received_bytes']} bytes, {totals['skipped_bytes']} of them in no record",
        "receiver  records    lost  errors  distortion  hemisphere  absent",
    ]
    return text + [_receiver_row(station, counts) for station, counts in totals["receivers"].items()]


def advice(totals: Mapping[str, Any], settings: StreamSettings) -> list[str]:
    """List what was wrong with a recording and can be bettered."""
    slow = too_slow(
        settings,
        totals["received_bytes"] / max(totals["seconds"], 1e-9),
        100 * totals["lost_frames"] / max(totals["records"] + totals["lost_frames"], 1),
    )
    margins = {s: counts["least_hemisphere_margin"] for s, counts in totals["receivers"].items()}
    edge = [station for station, margin in margins.items() if margin is not None and margin < AT_THE_EDGE]
    sentences = [slow] if slow else []
    if edge:
        sentences.append(
            f"receiver {', '.join(edge)}: came to the edge of the hemisphere: positions may have jumped; "
            "`import` marks it; consider --hemisphere"
        )
    return sentences


def _receiver_row(station: str, counts: Mapping[str, Any]) -> str:
    margin = counts["least_hemisphere_margin"]
    errors, distortion = counts["records_with_error"], counts["worst_distortion"]
    return (
        f"{station:>8}  {counts['records']:7d}  {counts['lost_frames']:6d}  {errors:6d}  {distortion:10d}  "
        f"{'-' if margin is None else f'{margin:+.2f}':>10}  {_stretches(counts['absent_s']) or '-'}"
    )


def _stretches(stretches: Sequence[tuple[float, float | None]]) -> str:
    """Write the longest stretches of time, in turn."""
    longest = sorted(stretches, key=lambda ends: ends[0] - (math.inf if ends[1] is None else ends[1]))
    shown = [
        f"{start:.1f} s to {'the end' if end is None else f'{end:.1f} s'}"
        for start, end in sorted(longest[:MOST_STRETCHES], key=itemgetter(0))
    ]
    more = len(stretches) - MOST_STRETCHES
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
