"""Text for the user: counts during a recording, and the summary at its end. No input or output."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.arrays import Integers
from shukotsu.errors import InputError, count_of
from shukotsu.tracker.families import FAMILIES
from shukotsu.tracker.liberty import SHORT_LIST, list_of_all, record_type
from shukotsu.tracker.records import TRACK, StreamSettings
from shukotsu.tracker.stream import ABSENT_S, JITTER_S, Heard, Losses, RecordBlock


@dataclass
class Receiver:
    """Current state of one receiver, in addition to the counts in `Losses`.

    margin : p . h / |p|, sine of the angle by which it is inside its hemisphere; NaN if the tracker follows
    it or if it has no position. errors, worst_distortion, least_margin : since the start; the other fields :
    of the newest records. last_host_ns : of the newest record, or else of the start.
    """

    last_host_ns: int
    errors: int = 0
    error: int = 0
    distortion: int = 0
    worst_distortion: int = 0
    margin: float = np.nan
    least_margin: float = np.nan


class Statistics:
    """Counts of a recording in progress.

    start_ns : the host's monotonic time at the start of the stream. heard_ns : host time of the newest bytes.
    silences : (receiver, start, end) of each absence, in s since the start; receiver 0 means that no receiver
    sent records for longer than jitter.
    """

    def __init__(self, settings: StreamSettings, start_ns: int) -> None:
        self.receivers = {station: Receiver(start_ns) for station in settings.stations}
        self.skipped_bytes = self.received_bytes = 0
        self.silences: list[tuple[int, float, float]] = []
        self._losses = Losses(settings)
        self._settings = settings
        self._start_ns = self.heard_ns = start_ns

    def add(self, block: RecordBlock, received_bytes: int, now_ns: int) -> None:
        """Count the records decoded since the last call."""
        self.received_bytes += received_bytes
        self.skipped_bytes += sum(skip.size for skip in block.skipped)
        self.heard_ns = now_ns if received_bytes else self.heard_ns
        for station in np.unique(block.records.station).tolist():
            receiver = self.receivers.setdefault(station, Receiver(self._start_ns))
            rows = np.flatnonzero((block.records.station == station) & block.good)
            if len(rows):
                self._count(receiver, station, block, rows)
        self.silences += self._silences(self._losses.add(block)[0])

    def absent(self) -> set[int]:
        """Return the receivers that send nothing while others do."""
        last_ns = {station: receiver.last_host_ns for station, receiver in self.receivers.items()}
        latest_ns = max(last_ns.values(), default=0)
        return {station for station, ns in last_ns.items() if latest_ns - ns > ABSENT_S * 1e9}

    def totals(self, now_ns: int) -> dict[str, Any]:
        """Return the counts of the recording, as if it ended now, as JSON types.

        lost_frames : lost records, in total and by receiver; lost_cycles : lost frames (see `Losses`).
        silent_s, absent_s : [start, end] of times without records, of any receiver and of each one, in s
        since the start; end is None if the silence lasts until the end.
        """
        losses, gaps, _ = self._losses.closed()
        end_s, ends_s = self._seconds(now_ns), losses.silent_ends_s(self._start_ns, now_ns)
        gaps_s = [(0, 0.0, ends_s[0]), *self.silences, *self._silences(gaps), (0, end_s - ends_s[1], end_s)]

        def silent(station: int, newest_ns: float) -> list[list[float | None]]:
            newest_s = min(self._seconds(newest_ns), end_s)
            stretches = [(a, b if a < newest_s else end_s) for s, a, b in gaps_s if s == station and b > a]
            return [[_number(a), _number(b) if b < end_s else None] for a, b in stretches]

        receivers = {}
        for station, receiver in sorted(self.receivers.items()):
            heard = losses.stations.get(station, Heard(0, 0, 0))
            receivers[str(station)] = {
                "records": heard.records,
                "lost_frames": heard.lost,
                "records_with_error": receiver.errors,
                "worst_distortion": receiver.worst_distortion,
                "least_hemisphere_margin": _number(receiver.least_margin),
                "absent_s": silent(station, heard.host_ns) if heard.records else [[0.0, None]],
            }
        return {
            "seconds": end_s,
            "records": losses.all.records,
            "lost_frames": sum(heard.lost for heard in losses.stations.values()),
            "lost_cycles": losses.all.lost,
            "cycles": losses.cycles,
            "partial_cycles": losses.partial_cycles,
            "skipped_bytes": self.skipped_bytes,
            "received_bytes": self.received_bytes,
            "silent_s": silent(0, np.inf),
            "receivers": receivers,
        }

    def _silences(self, gaps: Integers) -> list[tuple[int, float, float]]:
        least = JITTER_S * self._settings.rate_hz
        return [
            (station, self._seconds(from_ns), self._seconds(to_ns))
            for station, first, last, from_ns, to_ns, absent in gaps.tolist()
            if absent or (station == 0 and last - first + 1 > least)
        ]

    def _count(self, receiver: Receiver, station: int, block: RecordBlock, rows: Integers) -> None:
        records = block.records
        receiver.last_host_ns = int(block.host_ns[rows[-1]])
        errors = records.error[rows]
        receiver.errors += int(np.count_nonzero(errors))
        receiver.error = int(errors[np.flatnonzero(errors)[-1]]) if errors.any() else 0
        receiver.distortion = max(0, int(records.distortion[rows].max()))
        receiver.worst_distortion = max(receiver.worst_distortion, receiver.distortion)
        vector = np.array(self._settings.hemisphere.get(station, TRACK))
        if vector.any():
            position_mm, direction = records.position_mm[rows], vector / np.linalg.norm(vector)
            with np.errstate(invalid="ignore", divide="ignore"):
                margin = position_mm @ direction / np.linalg.norm(position_mm, axis=-1)
            receiver.margin = float(margin[-1])
            receiver.least_margin = float(np.fmin.reduce(margin, initial=receiver.least_margin))

    def _seconds(self, host_ns: float) -> float:
        return (host_ns - self._start_ns) * 1e-9


def _number(value: float) -> float | None:
    """Round for display; NaN becomes None, as JSON has no NaN."""
    return round(value, 3) if np.isfinite(value) else None


BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""
VIPER_HEAD_BYTES, VIPER_RECORD_BYTES = 28, 32
MUCH_MISSING_PERCENT = 20.0


def needed_bytes_per_s(settings: StreamSettings) -> float:
    """Return the data rate of the stream, bytes/s."""
    count = len(settings.stations)
    cycle_bytes = VIPER_HEAD_BYTES + VIPER_RECORD_BYTES * count
    if settings.items:
        cycle_bytes = record_type(list_of_all(settings.items)).itemsize * count
    return cycle_bytes * settings.rate_hz


def arithmetic(settings: StreamSettings, baud: int) -> str:
    """Format the data rate that the stream needs and that the line carries."""
    count, need = len(settings.stations), needed_bytes_per_s(settings)
    return (
        f"{count_of(count, 'receiver')} x {need / settings.rate_hz / count:.4g} bytes x "
        f"{settings.rate_hz:g} Hz = {need:.0f} bytes/s, and {baud} baud carries {baud / BITS_PER_BYTE:.0f}"
    )


def check_line(settings: StreamSettings, baud: int | None, name: str) -> None:
    """Raise InputError, with the data rates and alternatives, if the line cannot carry the stream."""
    if baud is not None and needed_bytes_per_s(settings) > baud / BITS_PER_BYTE:
        raise InputError(
            f"{name}: the line is too slow: {arithmetic(settings, baud)}; {what_fits(settings, baud)}; or "
            "use the tracker's USB"
        )


def what_fits(settings: StreamSettings, baud: int) -> str:
    """Format how many receivers of LIBERTY and PATRIOT fit at each rate, with this list and the short one."""
    lists = {"with this list": list_of_all(settings.items)} if settings.items else {}
    if lists and record_type(SHORT_LIST).itemsize < record_type(lists["with this list"]).itemsize:
        lists["with --items short"] = SHORT_LIST
    fits, rates_hz = [], FAMILIES[settings.family].rates_hz
    for how, items in lists.items():
        record_bytes = record_type(items).itemsize
        counts = {hz: int(baud / BITS_PER_BYTE // (record_bytes * hz)) for hz in rates_hz}
        choices = [f"{count_of(count, 'receiver')} at {hz} Hz" for hz, count in counts.items() if count]
        fits += [f"{' or '.join(choices)} {how}"] if choices else []
    return f"what fits is {', '.join(fits)}" if fits else "not one receiver fits"


NEAR_EDGE = 0.1
"""Hemisphere margin below which a receiver may soon be taken for its mirror image."""
AT_THE_EDGE = 0.05
"""Hemisphere margin below which a receiver may have been outside its hemisphere."""
MOST_STRETCHES = 3


def state_line(statistics: Statistics, now: Mapping[str, Any], before: Mapping[str, Any]) -> str:
    """Return the state of a recording as one line; now, before : totals now and at the previous line."""
    span_s, absent = now["seconds"] - before["seconds"], statistics.absent()
    present = {station: r for station, r in sorted(statistics.receivers.items()) if station not in absent}
    rates, missing, troubles, no_counts = list[float](), [0.0], list[str](), {"records": 0, "lost_frames": 0}
    for station, receiver in present.items():
        counts, earlier = now["receivers"][str(station)], before["receivers"].get(str(station), no_counts)
        came, lost = (counts[name] - earlier[name] for name in no_counts)
        rates.append(came / span_s)
        missing.append(100 * lost / max(came + lost, 1))
        trouble = f"error {chr(receiver.error)}" if receiver.error else ""
        if not trouble and receiver.margin < NEAR_EDGE:
            trouble = "in the other half" if receiver.margin < 0 else "near the edge"
        distortion = f"distortion {receiver.distortion}" if receiver.distortion else ""
        troubles += [f"{station} {text}" for text in (trouble, distortion) if text]
    parts = [
        f"{now['seconds']:.1f} s",
        f"{len(present)} of {count_of(len(statistics.receivers), 'receiver')}",
        f"{min(rates, default=0.0):.1f} Hz",
        f"missing {max(missing):.1f} %",
        f"skipped {now['skipped_bytes']} B",
        f"{now['received_bytes'] / 1e6:.2f} MB",
        *([f"absent {','.join(map(str, sorted(absent)))}"] if absent else []),
    ]
    return "  ".join(parts + troubles)


def summary(out: str, reason: str, totals: Mapping[str, Any], notices: Sequence[str] = ()) -> list[str]:
    """Return the summary of a recording, line by line: records by receiver, and notes."""
    text = [f"{out}: ended after {totals['seconds']:.1f} s ({reason})", *totals_table(totals)]
    text += [f"no record at all: {_stretches(totals['silent_s'])}"] if totals["silent_s"] else []
    return text + [f"note: {notice}" for notice in notices]


def totals_table(totals: Mapping[str, Any]) -> list[str]:
    """Return a table of the records, in total and by receiver, line by line."""
    text = [
        f"{totals['records']} records in {totals['cycles']} cycles; "
        f"{count_of(totals['lost_cycles'], 'frame')} lost ({count_of(totals['lost_frames'], 'record')}), "
        f"{totals['partial_cycles']} cycles partial",
        f"{totals['received_bytes']} bytes, {totals['skipped_bytes']} of them in no record",
        "receiver  records    lost  errors  distortion  hemisphere  absent",
    ]
    for station, counts in totals["receivers"].items():
        margin = counts["least_hemisphere_margin"]
        text.append(
            f"{station:>8}  {counts['records']:7d}  {counts['lost_frames']:6d}  "
            f"{counts['records_with_error']:6d}  {counts['worst_distortion']:10d}  "
            f"{'-' if margin is None else f'{margin:+.2f}':>10}  {_stretches(counts['absent_s']) or '-'}"
        )
    return text


def advice(totals: Mapping[str, Any], settings: StreamSettings) -> list[str]:
    """Return advice on faults of a recording that the user can remedy.

    If both records and bytes are missing, the line is too slow; if only records are missing, bytes were
    damaged.
    """
    sentences = []
    missing_percent = 100 * totals["lost_frames"] / max(totals["records"] + totals["lost_frames"], 1)
    need, came = needed_bytes_per_s(settings), totals["received_bytes"] / max(totals["seconds"], 1e-9)
    if missing_percent > MUCH_MISSING_PERCENT and came <= (1 - MUCH_MISSING_PERCENT / 100) * need:
        who = count_of(len(settings.stations), "receiver", "need")
        sentences.append(
            f"the line carried {came / 1000:.3g} kB/s of the {need / 1000:.3g} kB/s that {who}: "
            f"it is too slow; see {FAMILIES[settings.family].remedies}"
        )
    margins = {s: counts["least_hemisphere_margin"] for s, counts in totals["receivers"].items()}
    edge = [station for station, margin in margins.items() if margin is not None and margin < AT_THE_EDGE]
    if edge:
        sentences.append(
            f"receiver {', '.join(edge)}: came to the edge of the hemisphere: positions may have jumped; "
            "`import` marks it; consider --hemisphere"
        )
    return sentences


def _stretches(stretches: Sequence[tuple[float, float | None]]) -> str:
    """Format the longest periods, in the order of time."""
    longest = sorted(stretches, key=lambda ends: ends[0] - (math.inf if ends[1] is None else ends[1]))
    shown = [
        f"{start:.1f} s to {'the end' if end is None else f'{end:.1f} s'}"
        for start, end in sorted(longest[:MOST_STRETCHES], key=lambda ends: ends[0])
    ]
    more = len(stretches) - MOST_STRETCHES
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
