"""Events of a hand's recordings, the cycles of a movement that they delimit, and joint angles over the cycle.

The angles are averaged over a recording's cycles, with their standard deviation, at every percent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.hand.recorded_movement import AngleSeries
from shukotsu.movement.sampling import Grid, grid_of
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import CLOCKS, EVENTS
from shukotsu.tables.poses import pose_blocks
from shukotsu.tables.typed_table import read_table, rows_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import CycleCurvesRow

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
    event: str, onset_s: Sequence[float], duration_s: Sequence[float], sd_s: Sequence[float] | float = 0.0
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
        events' clock is weak; a single number is the error of all.

    """
    order = np.argsort(np.asarray(onset_s, float), kind="stable")
    onset, stated = np.asarray(onset_s, float)[order], np.asarray(duration_s, float)[order]
    sd = np.nan_to_num(np.broadcast_to(sd_s, len(stated)), posinf=np.inf)[order]
    to_next = ~(stated > 0)
    duration = np.where(to_next, np.append(np.diff(onset), np.nan), stated)
    sd = np.where(to_next, np.maximum(sd, np.append(sd[1:], 0.0)), sd)
    kept = duration > 0
    onset, duration, sd = onset[kept], duration[kept], sd[kept]
    usual = float(np.median(duration)) if len(duration) else np.nan
    cycles = []
    times = zip(onset.tolist(), duration.tolist(), sd.tolist(), strict=True)
    for number, (start, length, off) in enumerate(times):
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


@dataclass(frozen=True)
class TimedEvent:
    """A row of the events table that has a time; doubt : why its clock is uncertain, or empty."""

    row: Mapping[str, Any]
    doubt: str


def events_of(
    plan: SubjectPlan, hand: str, events: Path | None, clocks: Path | None
) -> dict[Recording, list[TimedEvent]]:
    """Return the events that have a time, for each recording in which the hand's movement is measured.

    events, clocks : the subject's tables; without a table of clocks, all clocks are trusted.
    """

    def place(row: Mapping[str, Any]) -> tuple[str, ...]:
        return tuple(row[name] for name in CLOCKS.key)

    clock_rows = [] if clocks is None else rows_of(read_table(clocks, CLOCKS))
    weak_rows = [row for row in clock_rows if row["status"] == "weak"]
    weak = {place(row): row["message"] or "its status is weak" for row in weak_rows}
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


PERCENT = np.arange(101)

MOST_EVENTS = 4
"""Largest number of event names per recording for which curves are computed: those with the most cycles.

In recordings of music every pitch is an event name.
"""


def averaged_cycles(cycles: Sequence[Sequence[Cycle]]) -> list[list[Cycle]]:
    """Return the cycles that curves are averaged over: one list for each event name that has usable cycles.

    cycles : the cycles of a recording, one list per event name.
    """
    used = [[cycle for cycle in of_event if not cycle.refusal] for of_event in cycles]
    return sorted(filter(None, used), key=len, reverse=True)[:MOST_EVENTS]


def over_cycles(time_s: Array, values: Array, cycles: Sequence[Cycle], grid: Grid) -> Array:
    """Sample a series at every percent of each cycle, by linear interpolation between neighbouring frames.

    Parameters
    ----------
    time_s, values : array, shape (T,)
        Device times of the frames, NaN where unknown, and the series, NaN in gaps.
    cycles : sequence of Cycle, length C
        Cycles, which must be within the recording.
    grid : Grid
        Even grid of the frames; grid points without a frame are gaps.

    Returns
    -------
    array, shape (C, 101)
        Values in the unit of the series; NaN if the frame before or after is a gap, however short.

    """
    timed = np.isfinite(time_s)
    times_s = np.interp(np.arange(grid.count), grid.index[timed], time_s[timed])
    begin_s = np.array([[cycle.onset_s] for cycle in cycles])
    length_s = np.array([[cycle.duration_s] for cycle in cycles])
    read_at_s = begin_s + length_s * (PERCENT / PERCENT[-1])
    return np.asarray(np.interp(read_at_s, np.maximum.accumulate(times_s), grid.spread(values)))


def curve_rows(
    series: AngleSeries, time_s: Array, cycles: Sequence[Sequence[Cycle]], grid: Grid
) -> Iterator[CycleCurvesRow]:
    """Yield the rows of cycle_curves of an angle, if any cycle has it; cycles : from `averaged_cycles`."""
    for of_event in cycles:
        courses = over_cycles(time_s, series.angle_deg, of_event, grid)
        measured = ~np.isnan(courses)
        n = measured.sum(axis=0)
        if not n.any():
            continue
        mean = np.where(measured, courses, 0.0).sum(axis=0) / np.maximum(n, 1)
        squares = np.where(measured, (courses - mean) ** 2, 0.0).sum(axis=0)
        sd = np.sqrt(squares / np.maximum(n - 1, 1))
        for percent in PERCENT.tolist():
            count = int(n[percent])
            yield {
                "event": of_event[0].event,
                "joint": series.joint,
                "angle": series.angle,
                "cycle_percent": percent,
                "mean_deg": float(mean[percent]) if count else None,
                "sd_deg": float(sd[percent]) if count > 1 else None,
                "n_cycles": count,
            }
