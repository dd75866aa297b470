"""Events of a hand's recordings: those that cut cycles, and those that a fingertip made."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.schemas.catalogue import CLOCKS, EVENTS
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import pose_blocks
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import read_table, rows_of
from shukotsu.stages.measure_movement.cycles import Cycle, cut_cycles, within_recording
from shukotsu.stages.measure_movement.sampling import grid_of

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

    known = [] if clocks is None else rows_of(read_table(clocks, CLOCKS))
    weak = {place(row): row["message"] or "its clock is weak" for row in known if row["status"] == "weak"}
    found: dict[tuple[str, str], list[TimedEvent]] = {}
    for row in [] if events is None else rows_of(read_table(events, EVENTS)):
        if (row["session"], row["hand"]) == (plan.session, hand) and row["onset_s"] is not None:
            timed = TimedEvent(row, weak.get(place(row), ""))
            found.setdefault((row["task"], row["trial"]), []).append(timed)
    return {recording: found.get((recording.task, recording.trial), []) for recording in plan.evaluated(hand)}


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
    known = time_s[np.isfinite(time_s)]
    cut = (cut_cycles(name, *zip(*times, strict=True)) for name, times in by_name.items())
    return [within_recording(cycles, known) for cycles in cut if cycles]


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
