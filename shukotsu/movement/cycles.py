"""Events of a hand's recordings: those that delimit cycles of a movement, and those made by a fingertip."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.movement.sampling import grid_of
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import CLOCKS, EVENTS
from shukotsu.tables.poses import pose_blocks
from shukotsu.tables.typed_table import read_table, rows_of

SHORTEST, LONGEST = 0.5, 2.0
"""Shortest and longest cycle, as shares of the median duration; others are taken for another movement."""

MOST_ONSET_SD = 0.05
"""Largest usable 1-sigma error of an onset as a share of the cycle's duration. With such an error, the values
of a sine-like course are off by up to 16 % of its range."""


@dataclass(frozen=True)
class Cycle:
    """A cycle that starts at an event; refusal : why it is not used, or empty."""

    event: str
    number: int
    onset_s: float
    duration_s: float
    refusal: str = ""


def cut_cycles(
    event: str, onset_s: Sequence[float], duration_s: Sequence[float], sd_s: Sequence[float] | None = None
) -> list[Cycle]:
    """Return the cycles of the events of one name, in order of time.

    A cycle lasts as long as its event, or, if its event has no duration (NaN), until the next onset; the last
    event without a duration has no cycle. Cycles that are much shorter or longer than the median, or whose
    ends are too uncertain, get a refusal.

    Parameters
    ----------
    event : str
        Name of the events.
    onset_s, duration_s, sd_s : sequence of float, length N
        Onsets, durations and 1-sigma errors of the onsets, s. An error is NaN if unknown and infinite if the
        events' clock is weak.

    """
    order = np.argsort(np.asarray(onset_s, float), kind="stable")
    onset, stated = np.asarray(onset_s, float)[order], np.asarray(duration_s, float)[order]
    sd = np.nan_to_num(np.zeros(len(stated)) if sd_s is None else np.asarray(sd_s, float), posinf=np.inf)[
        order
    ]
    to_next = ~(stated > 0)
    duration = np.where(to_next, np.append(np.diff(onset), np.nan), stated)
    sd = np.where(to_next, np.maximum(sd, np.append(sd[1:], 0.0)), sd)
    kept = duration > 0
    onset, duration, sd = onset[kept], duration[kept], sd[kept]
    usual = float(np.median(duration)) if len(duration) else np.nan
    cycles = []
    for number, (start, length, off) in enumerate(
        zip(onset.tolist(), duration.tolist(), sd.tolist(), strict=True)
    ):
        refusal = ""
        if np.isinf(off):
            refusal = "the clock of its events is weak"
        elif off > MOST_ONSET_SD * length:
            refusal = f"the 1-sigma error of its onset, {1e3 * off:.0f} ms, is too large for {length:.2f} s"
        elif not SHORTEST * usual <= length <= LONGEST * usual:
            word = "short" if length < usual else "long"
            refusal = f"too {word}: {length:.2f} s, median {usual:.2f} s"
        cycles.append(Cycle(event, number, start, length, refusal))
    return cycles


def within_recording(cycles: Sequence[Cycle], time_s: Array) -> list[Cycle]:
    """Return the cycles, with a refusal for those not entirely within the recording's times (T,), s."""
    first, last = time_s[0], time_s[-1]
    return [
        replace(cycle, refusal="not entirely within the recording")
        if not cycle.refusal and not first <= cycle.onset_s <= cycle.onset_s + cycle.duration_s <= last
        else cycle
        for cycle in cycles
    ]


MOST_ONSET_SD_MS = 10.0
"""Largest usable 1-sigma error of an event's onset; less certain ones cannot be assigned to a stroke."""

_PITCH = re.compile(r"\bnote \d{1,3}\b")
_SAME_CLOCK = "same clock"


@dataclass(frozen=True)
class TimedEvent:
    """A row of the events table that has a time; doubt : why its clock is uncertain, or empty."""

    row: Mapping[str, Any]
    doubt: str


@dataclass(frozen=True)
class StruckEvent:
    """An event that a fingertip made. row : its row of the events table. digit : the digit in its name, or
    empty. refusal : why it cannot be used, or empty.
    """

    row: Mapping[str, Any]
    digit: str
    refusal: str


def events_of(
    plan: SubjectPlan, hand: str, events: Path | None, clocks: Path | None
) -> dict[Recording, list[TimedEvent]]:
    """Return the events that have a time, for each recording in which the hand's movement is measured.

    events, clocks : the subject's tables; without a table of clocks, all clocks are trusted.
    """

    def place(row: Mapping[str, Any]) -> tuple[str, ...]:
        return tuple(row[name] for name in CLOCKS.key)

    clock_rows = [] if clocks is None else rows_of(read_table(clocks, CLOCKS))
    weak = {
        place(row): row["message"] or "its status is weak" for row in clock_rows if row["status"] == "weak"
    }
    by_recording: dict[tuple[str, str], list[TimedEvent]] = {}
    for row in [] if events is None else rows_of(read_table(events, EVENTS)):
        if (row["session"], row["hand"]) == (plan.who.session, hand) and row["onset_s"] is not None:
            timed = TimedEvent(row, weak.get(place(row), ""))
            by_recording.setdefault((row["task"], row["trial"]), []).append(timed)
    return {
        recording: by_recording.get((recording.task, recording.trial), []) for recording in plan.posed(hand)
    }


def cycles_of(plan: SubjectPlan, recording: Recording, events: Sequence[TimedEvent]) -> list[list[Cycle]]:
    """Return the cycles of a recording, one list per event name; empty without events or frame times."""
    by_name: dict[str, list[tuple[float, float, float]]] = {}
    for event in events:
        duration_s, sd_ms = (
            np.nan if event.row[name] is None else event.row[name] for name in ("duration_s", "onset_sd_ms")
        )
        times = event.row["onset_s"], duration_s, np.inf if event.doubt else sd_ms / 1e3
        by_name.setdefault(event.row["name"], []).append(times)
    if not by_name:
        return []
    try:
        blocks = pose_blocks(plan.poses(recording), plan.layouts[recording.hand.hand].measured)
        time_s = np.concatenate([poses.time_s for poses in blocks])
    except InputError:
        return []  # its import failed; the reason is in the recordings table
    if grid_of(time_s) is None:
        return []
    finite = time_s[np.isfinite(time_s)]
    cut = (cut_cycles(name, *zip(*times, strict=True)) for name, times in by_name.items())
    return [within_recording(cycles, finite) for cycles in cut if cycles]


def struck_events(
    recording: Recording, events: Sequence[TimedEvent], digits: Sequence[str]
) -> list[StruckEvent]:
    """Return the events that name a pitch or a digit, in order of time, without those that align clocks."""
    pulses = {part.strip() for part in recording.pulses.split("=")} - {"", _SAME_CLOCK}
    struck = []
    for row, doubt in ((event.row, event.doubt) for event in events):
        words = row["name"].lower().split()
        digit = next((name for name in digits if name.lower() in words), "")
        if row["name"] in pulses or not (digit or _PITCH.search(row["name"])):
            continue
        sd_ms = row["onset_sd_ms"]
        refusal = f"its clock is uncertain: {doubt}" if doubt else ""
        if not refusal and sd_ms is not None and sd_ms > MOST_ONSET_SD_MS:
            refusal = f"1-sigma error of its onset: {sd_ms:.0f} ms, more than {MOST_ONSET_SD_MS:.0f} ms"
        struck.append(StruckEvent(row, digit, refusal))
    return sorted(struck, key=lambda event: float(event.row["onset_s"]))
