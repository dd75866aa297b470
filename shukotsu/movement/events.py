"""Events of a hand's recordings: those that cut cycles of a movement, and those that a fingertip made."""

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
"""Shares of the median duration of an event's cycles; a shorter or longer one is another movement."""

MOST_ONSET_SD = 0.05
"""1-sigma of an onset, of the cycle's duration, above which it is not used: a sine-like course read so far
off is 16 % of its range out where it is steepest."""


@dataclass(frozen=True)
class Cycle:
    """A cycle of the events of one name; refusal : why it is not used, or empty."""

    event: str
    number: int
    onset_s: float
    duration_s: float
    refusal: str = ""


def cut_cycles(
    event: str, onset_s: Sequence[float], duration_s: Sequence[float], sd_s: Sequence[float] | None = None
) -> list[Cycle]:
    """Cycles of the events of one name, whose own duration counts where it has one (else NaN).

    A cycle without one lasts to the next onset; the last is none. Refused are those that are much shorter or
    longer than the median, and those whose ends are not known well enough. sd_s : 1-sigma of the onsets, NaN
    where nothing says it, infinite of a clock that is weak.
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
            refusal = f"its onset is known to {1e3 * off:.0f} ms (1-sigma), too little for {length:.2f} s"
        elif not SHORTEST * usual <= length <= LONGEST * usual:
            word = "short" if length < usual else "long"
            refusal = f"too {word}: {length:.2f} s, median {usual:.2f} s"
        cycles.append(Cycle(event, number, start, length, refusal))
    return cycles


def within_recording(cycles: Sequence[Cycle], time_s: Array) -> list[Cycle]:
    """The cycles, those refused that are not wholly within the recording's times (T,)."""
    first, last = time_s[0], time_s[-1]
    return [
        replace(cycle, refusal="not wholly within the recording")
        if not cycle.refusal and not first <= cycle.onset_s <= cycle.onset_s + cycle.duration_s <= last
        else cycle
        for cycle in cycles
    ]


MOST_ONSET_SD_MS = 10.0
"""Events that are known less well tell no stroke from the next."""

_PITCH = re.compile(r"\bnote \d{1,3}\b")
_SAME_CLOCK = "same clock"


@dataclass(frozen=True)
class TimedEvent:
    """A row of the events table that has a time. doubt : why its clock is not sure; empty where it is."""

    row: Mapping[str, Any]
    doubt: str


@dataclass(frozen=True)
class StruckEvent:
    """An event that a fingertip made. row : of the events table. digit : as it names it, empty where it names
    none. refusal : why it cannot be used; empty where it can.
    """

    row: Mapping[str, Any]
    digit: str
    refusal: str


def events_of(
    plan: SubjectPlan, hand: str, events: Path | None, clocks: Path | None
) -> dict[Recording, list[TimedEvent]]:
    """Return the events of a hand's evaluated recordings that have a time.

    events, clocks : the subject's tables; without clocks every event's is trusted.
    """

    def place(row: Mapping[str, Any]) -> tuple[str, ...]:
        return tuple(row[name] for name in CLOCKS.key)

    clock_rows = [] if clocks is None else rows_of(read_table(clocks, CLOCKS))
    weak = {
        place(row): row["message"] or "its clock is weak" for row in clock_rows if row["status"] == "weak"
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
    """Cycles of a recording, by its events' names in turn; none without events or times."""
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
        return []  # its import failed: the recordings table says why
    if grid_of(time_s) is None:
        return []
    finite = time_s[np.isfinite(time_s)]
    cut = (cut_cycles(name, *zip(*times, strict=True)) for name, times in by_name.items())
    return [within_recording(cycles, finite) for cycles in cut if cycles]


def struck_events(
    recording: Recording, events: Sequence[TimedEvent], digits: Sequence[str]
) -> list[StruckEvent]:
    """Events that name a pitch or a digit, but those that bring clocks together, in order of time."""
    pulses = {part.strip() for part in recording.pulses.split("=")} - {"", _SAME_CLOCK}
    struck = []
    for row, doubt in ((event.row, event.doubt) for event in events):
        words = row["name"].lower().split()
        digit = next((name for name in digits if name.lower() in words), "")
        if row["name"] in pulses or not (digit or _PITCH.search(row["name"])):
            continue
        sd_ms = row["onset_sd_ms"]
        refusal = f"its clock is not sure: {doubt}" if doubt else ""
        if not refusal and sd_ms is not None and sd_ms > MOST_ONSET_SD_MS:
            refusal = f"its onset is known to {sd_ms:.0f} ms, more than {MOST_ONSET_SD_MS:.0f}"
        struck.append(StruckEvent(row, digit, refusal))
    return sorted(struck, key=lambda event: float(event.row["onset_s"]))
